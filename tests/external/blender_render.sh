#!/bin/sh
# Opens VDB files in Blender (3.4 or later, headless), lists their grids and renders one field of the first to a picture.
# usage: blender_render.sh picture.png field min max flat.vdb [other.vdb ...]
set -eu
if [ $# -lt 5 ]; then
    sed -n 3p "$0" | cut -c3- >&2
    exit 2
fi
if ! command -v blender > /dev/null; then
    echo "blender isn't installed: apt-get install --no-install-recommends blender" >&2
    exit 77
fi
picture=$1
rm -f "$picture"
blender --background --factory-startup --python-exit-code 1 --python "$(dirname "$0")/blender_render.py" -- "$@"
if [ ! -s "$picture" ]; then
    echo "blender wrote no picture" >&2
    exit 1
fi
