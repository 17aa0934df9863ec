#!/usr/bin/env bash
# Configures and builds one preset: scripts/build.sh [release|debug|asan|tsan|fuzz] [target...]. Uses ccache when it is there,
# unless TESSERA_CCACHE=0.
# TESSERA_CMAKE_ARGS adds arguments to the configuration; TESSERA_JOBS sets the number of compilers at once.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

preset=${1:-release}
shift || true
arguments=()
if [[ ${TESSERA_CCACHE:-1} != 0 ]] && command -v ccache >/dev/null; then
  arguments+=(-DCMAKE_C_COMPILER_LAUNCHER=ccache -DCMAKE_CXX_COMPILER_LAUNCHER=ccache)
fi
read -r -a extra <<<"${TESSERA_CMAKE_ARGS:-}"
# Finding VTK prints a page of packages; it is worth reading only when something is missing.
if ! log=$(cmake --preset "$preset" "${arguments[@]}" "${extra[@]}" 2>&1); then
  echo "$log" >&2
  exit 1
fi
targets=()
for target in "$@"; do targets+=(--target "$target"); done
cmake --build "build/$preset" --parallel "${TESSERA_JOBS:-$(nproc)}" "${targets[@]}"
