#!/usr/bin/env bash
# Installs the Debian 12 packages that Tessera is built from. Needs root or sudo; does nothing when all are there.
set -euo pipefail

packages=(
  g++ clang-14 libclang-rt-14-dev llvm-14 cmake ninja-build ccache pkg-config git ca-certificates
  libvtk9-dev libopenvdb-dev libnanovdb-dev libopenvdb-tools libopenexr-dev openexr libtbb-dev libblosc-dev liblz4-dev libpng-dev zlib1g-dev libdeflate-dev
  libglm-dev libgmp-dev libhwy-dev libcli11-dev nlohmann-json3-dev libfmt-dev libmimalloc-dev libseccomp-dev
  libgl-dev libegl-dev libegl1 libegl-mesa0 libgl1-mesa-dri libosmesa6
  libglfw3-dev libimgui-dev libstb-dev xvfb openbox xdotool
  libgtest-dev libbenchmark-dev clang-format libtet1.5-dev
  python3 python3-vtk9 python3-openvdb python3-numpy python3-jsonschema python3-xlib python3-pil
)

missing=()
for package in "${packages[@]}"; do
  status=$(dpkg-query -W -f='${db:Status-Status}' "$package" 2>/dev/null || true)
  [[ $status == installed ]] || missing+=("$package")
done
if [[ ${#missing[@]} -eq 0 ]]; then
  echo "install_deps: every package is installed"
  exit 0
fi

as_root=()
if [[ $(id -u) -ne 0 ]]; then
  if ! command -v sudo >/dev/null; then
    echo "install_deps: these packages are missing, and installing them needs root: ${missing[*]}" >&2
    exit 1
  fi
  as_root=(sudo)
fi
echo "install_deps: installing ${missing[*]}"
export DEBIAN_FRONTEND=noninteractive
"${as_root[@]}" apt-get update -qq
"${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${missing[@]}"
