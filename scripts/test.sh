#!/usr/bin/env bash
# Installs what is missing, builds the release preset and runs every test. Ends with CTest's summary.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

scripts/install_deps.sh
scripts/build.sh release
exec ctest --preset release --output-on-failure "$@"
