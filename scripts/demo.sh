#!/usr/bin/env bash
# From a bundled simulation result to an adaptive OpenVDB file and a picture of one slice: out/stokes.vdb, out/stokes.png.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

scripts/install_deps.sh
scripts/build.sh release tessera
mkdir -p out
tessera=build/release/apps/tessera/tessera
mesh=data/freefem-stokes-sphere/stokes_p1.vtu
"$tessera" resample "$mesh" -o out/stokes.vdb --refine error --max-error 5% --brick-size 8 --json out/stokes.json
# The channel is 20 wide and the sphere 0.1: the picture shows the surroundings of the sphere.
"$tessera" picture out/stokes.vdb -o out/stokes.png --field pressure --axis y --at 0 --bounds=-0.3,-1,-0.2,0.3,1,0.2 --bricks --mesh "$mesh"
echo "demo: wrote out/stokes.vdb, out/stokes.json and out/stokes.png"
