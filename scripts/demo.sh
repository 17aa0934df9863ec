#!/usr/bin/env bash
# From a bundled simulation result to an adaptive OpenVDB file and a picture of one slice: out/stokes.vdb, out/stokes.png.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

scripts/install_deps.sh
scripts/build.sh release tessera
mkdir -p out
build/release/apps/tessera/tessera resample data/freefem-stokes-sphere/stokes_p1.vtu -o out/stokes.vdb \
  --refine error --max-error 5% --brick-size 8 --extend 1 --json out/stokes.json
build/release/apps/tessera/tessera picture out/stokes.vdb -o out/stokes.png --field pressure --axis y
echo "demo: wrote out/stokes.vdb, out/stokes.json and out/stokes.png"
