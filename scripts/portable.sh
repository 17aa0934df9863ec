#!/usr/bin/env bash
# Packs a release build into one archive for another x86-64 Linux machine with a GPU driver and nothing else installed:
# scripts/portable.sh [OUT.tar.xz]. There: tar xJf tessera-portable.tar.xz && tessera-portable/device_report.sh
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
out=${1:-build/tessera-portable.tar.xz}
build=build/release
[[ -x $build/apps/tessera/tessera-vtk-peer ]] || scripts/build.sh release
stage=$(mktemp -d)
trap 'rm -rf "$stage"' EXIT
root=$stage/tessera-portable
mkdir -p "$root/bin" "$root/lib/own"
cp $build/apps/tessera/{tessera,tessera_read_mesh,tessera-vtk-peer} \
  $build/tests/{contract_test,contract_random_test,hard_cases_test,raster_{generator,records,run}_test} "$root/bin"
cp bench/device_report.sh "$root"
cp -r data LICENSE "$root"

# Libraries that a program links: the other machine has those of C and of its driver; of the C++ run time and OpenGL's loader it
# uses its own, if it has any.
libraries() { ldd "$@" 2>/dev/null | awk '/=> \//{print $1, $3}' | sort -u; }
loader=$(ldconfig -p | awk '$1 == "libEGL.so.1" {print $NF; exit}')
{ libraries "$root"/bin/*; libraries "$loader"; echo "libEGL.so.1 $loader"; } | sort -u | while read -r name path; do
  case $name in
    libc.so* | libm.so* | libpthread.so* | libdl.so* | librt.so* | ld-linux* | libX* | libxcb*) ;;
    libstdc++* | libgcc_s* | libEGL.so* | libGLdispatch*)
      mkdir -p "$root/lib/own/$name"
      cp -L "$path" "$root/lib/own/$name/$name" ;;
    *) cp -L "$path" "$root/lib/$name" ;;
  esac
done
strip "$root"/bin/* "$root"/lib/*.so* 2>/dev/null || true
mkdir -p "$(dirname "$out")"
tar -C "$stage" -cf - tessera-portable | xz -6 -T0 >"$out"
ls -l "$out"
