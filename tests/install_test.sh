#!/usr/bin/env bash
# Installs a build into a fresh folder and builds and runs a project of its own against it: install_test.sh BUILD SOURCE
set -euo pipefail
build=$1
source=$2
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT

cmake --install "$build" --prefix "$folder/prefix" >/dev/null
"$folder/prefix/bin/tessera" --version
launcher=()
if command -v ccache >/dev/null; then launcher=(-DCMAKE_CXX_COMPILER_LAUNCHER=ccache); fi
cmake -S "$source/tests/consumer" -B "$folder/build" -G Ninja -DCMAKE_BUILD_TYPE=Release -DCMAKE_PREFIX_PATH="$folder/prefix" \
  "${launcher[@]}" >"$folder/log" 2>&1 || { cat "$folder/log"; exit 1; }
cmake --build "$folder/build"
"$folder/build/consumer"
"$folder/build/io_consumer" "$source/data/freefem-stokes-sphere/stokes_p1.vtu" "$folder/out.vdb"
"$folder/prefix/bin/tessera" info "$folder/out.vdb"
