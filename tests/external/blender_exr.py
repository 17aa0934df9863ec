#!/usr/bin/env python3
"""Opens files of `tessera slice -o x.exr` in Blender (3.4, headless) and compares size and pixels with the fields.

usage: blender_exr.py --tessera PROGRAM
Exit code 1 when Blender doesn't show the first field, 77 without Blender.
"""

import argparse
import pathlib
import shutil
import subprocess
import sys
import tempfile

CELLS = 4
SIZE = 40
# Names that Blender would take for layers or colours, and one, two, three and six components; the first is shown.
FIELDS = {
    "plain": lambda x, y: [x + 2 * y],
    "Power": lambda x, y: [y - x],
    "wind.speed": lambda x, y: [x, y, 1 - x],
    "pair": lambda x, y: [x, 2 * y],
    "stress": lambda x, y: [x, y, 2 * x, 3 * y, x + y, 4],
}


def square_text():
    """A flat box of hexahedra, 1 by 1, with the fields, as .vtu."""
    steps = range(CELLS + 1)
    points = [(x / CELLS, y / CELLS, z) for z in (0, 1) for y in steps for x in steps]
    corners = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
    cells = [[(x + a) + (CELLS + 1) * ((y + b) + (CELLS + 1) * c) for a, b, c in corners] for y in range(CELLS) for x in range(CELLS)]

    def array(name, rows, kind="Float64"):
        text = " ".join(repr(v) for row in rows for v in row)
        return f'<DataArray type="{kind}" Name="{name}" NumberOfComponents="{len(rows[0])}" format="ascii">{text}</DataArray>'

    fields = "".join(array(name, [field(x, y) for x, y, _ in points]) for name, field in FIELDS.items())
    offsets, types = [[8 * (i + 1)] for i in range(len(cells))], [[12]] * len(cells)
    return (
        '<VTKFile type="UnstructuredGrid" version="0.1" byte_order="LittleEndian"><UnstructuredGrid>'
        f'<Piece NumberOfPoints="{len(points)}" NumberOfCells="{len(cells)}"><PointData>{fields}</PointData>'
        f'<Points>{array("places", points)}</Points><Cells>{array("connectivity", [[n] for c in cells for n in c], "Int64")}'
        f'{array("offsets", offsets, "Int64")}{array("types", types, "UInt8")}</Cells></Piece></UnstructuredGrid></VTKFile>'
    )


def drive():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tessera", required=True)
    arguments = parser.parse_args()
    if not shutil.which("blender"):
        print("blender isn't installed: apt-get install --no-install-recommends blender", file=sys.stderr)
        return 77
    with tempfile.TemporaryDirectory() as folder:
        mesh = pathlib.Path(folder) / "square.vtu"
        mesh.write_text(square_text())
        for name in FIELDS:
            others = ",".join([name, *(other for other in FIELDS if other != name)])
            picture = pathlib.Path(folder) / f"{name}.exr"
            command = [arguments.tessera, "slice", mesh, "-o", picture, "--normal", "0,0,1", "--resolution", SIZE, "--field", others, "--quiet"]
            subprocess.run(list(map(str, command)), check=True)
        blender = ["blender", "--background", "--factory-startup", "--python-exit-code", "1", "--python", __file__, "--", folder]
        return subprocess.run(blender, check=False).returncode


def compare(folder):
    """Runs inside Blender."""
    import bpy

    failed = False
    for name, field in FIELDS.items():
        image = bpy.data.images.load(f"{folder}/{name}.exr")
        pixels, worst = list(image.pixels), 0.0
        if tuple(image.size) == (SIZE, SIZE):
            for i in range(SIZE * SIZE):
                values = field((i % SIZE + 0.5) / SIZE, (i // SIZE + 0.5) / SIZE)
                shown = 3 * values if len(values) == 1 else [*values, 0][:3]
                worst = max(worst, *(abs(a - b) for a, b in zip(pixels[4 * i : 4 * i + 4], [*shown, 1])))
        good = tuple(image.size) == (SIZE, SIZE) and image.type == "IMAGE" and worst < 1e-6
        failed |= not good
        print(f"{name}: {image.size[0]} x {image.size[1]}, {image.type}, pixels off by {worst:.2g} at most: {'good' if good else 'BAD'}")
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    if "--" in sys.argv and "blender" in pathlib.Path(sys.argv[0]).name:
        compare(sys.argv[-1])
    else:
        sys.exit(drive())
