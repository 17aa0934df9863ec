#!/usr/bin/env bash
# Makes the pictures of docs/viewer.md and docs/effects.md anew, of the disk in data/.
# (docs/images/window.png is probe.png of tests/view/window_test.py --keep FOLDER.)
# usage: scripts/docs_pictures.sh [folder] (default docs/images); TESSERA: the program
set -euo pipefail
cd "$(dirname "$0")/.."
folder=${1:-docs/images}
tessera=${TESSERA:-build/release/apps/tessera/tessera}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
mesh=$PWD/data/disk_out_ref/disk_out_ref.vtu

"$tessera" resample "$mesh" -o "$work/disk.vdb" --quiet --field V --refine error --max-error 3% --extend 1 \
    --brick-statistics
"$tessera" render "$work/disk.vdb" -o "$folder/disk.png" --size 900x640

# picture NAME SCENE-WITHOUT-ITS-BRACES
picture() {
    echo "{\"version\": 1, \"legend\": false, \"length_unit\": \"m\", $2}" >"$work/scene.json"
    "$tessera" render "$work/disk.vdb" --scene "$work/scene.json" -o "$folder/effect_$1.png" --size 400x300 --quiet
}
opaque='"clip": {"box": [-3.4, -3.4, -11, 3.4, 3.4, 11]}, "transfer_function": {"stops": [
    {"value": 0, "color": [0.4, 0.7, 1], "opacity": 0.9999}, {"value": 5, "color": [0.4, 0.7, 1], "opacity": 0.9999},
    {"value": 5.001, "color": [0, 0, 0], "opacity": 0}, {"value": 11.999, "color": [0, 0, 0], "opacity": 0},
    {"value": 12, "color": [0.95, 0.6, 0.3], "opacity": 0.9999}, {"value": 23, "color": [0.95, 0.6, 0.3], "opacity": 0.9999}]}'
faint='"transfer_function": {"opacity": [[0, 0.02], [1, 0.02]]}'
shell='"transfer_function": {"opacity": [[0, 0], [0.45, 0], [0.5, 0.95], [1, 0.95]]}'
shells='"transfer_function": {"stops": [
    {"value": 4.9, "color": [0.2, 0.5, 0.8], "opacity": 0}, {"value": 5, "color": [0.2, 0.5, 0.8], "opacity": 1},
    {"value": 5.1, "color": [0.2, 0.5, 0.8], "opacity": 0}, {"value": 13.9, "color": [0.9, 0.5, 0.2], "opacity": 0},
    {"value": 14, "color": [0.9, 0.5, 0.2], "opacity": 1}, {"value": 14.1, "color": [0.9, 0.5, 0.2], "opacity": 0}]}'

picture axes '"effects": {"axes": {}}'
picture bricks '"effects": {"bricks": {"width": 0.6}}'
picture cuts "$faint"', "effects": {"cuts": {"planes": [{"normal": [0, 1, 0], "offset": 0}, {"normal": [0, 0, 1], "offset": 1}],
    "contours": {"count": 8}}}'
picture errors '"effects": {"errors": {"bound": 0.03}}'
picture isosurfaces "$faint"', "effects": {"isosurfaces": {"surfaces": [
    {"value": 9, "color": [0.2, 0.6, 0.8], "opacity": 0.4}, {"value": 15, "color": [0.9, 0.5, 0.2], "opacity": 0.9}]}}'
picture occlusion "$opaque"', "slices": 1, "effects": {"occlusion": {}, "preintegration": {}}'
picture outline "\"effects\": {\"outline\": {\"mesh\": \"$mesh\"}}"
picture preintegration "$shells"', "slices": 1, "effects": {"preintegration": {}}'
picture probes '"effects": {"probes": {"lit": true, "shapes": [
    {"difference": [{"plane": {"normal": [0, -1, 0], "offset": 0}}, {"sphere": {"center": [0, 0, 3], "radius": 2.5}}]},
    {"sphere": {"center": [4, 3, 9], "radius": 3}}]}}'
picture scale_bar '"effects": {"scale_bar": {}}'
picture shading "$shell"', "effects": {"shading": {"light": [1, -1, 2]}}'
picture shadows "$opaque"', "effects": {"shadows": {"light": [-2, -1, 1.5]}, "preintegration": {}}'
