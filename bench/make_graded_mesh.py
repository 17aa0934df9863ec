#!/usr/bin/env python3
"""Makes the graded Delaunay mesh that Tessera's speed is measured on, about one million tetrahedra.

Points: the 8 corners of the unit cube and 150,000 points x = 1/2 + sign(u - 1/2) |2u - 1|^2.2 / 2 with u uniform, each coordinate alike, so that
elements are small in the middle. TetGen (Debian's `tetgen`, run as a separate program) makes their Delaunay tetrahedralisation. One scalar
field, sin(9x) cos(7y) + z^2. Written as appended, zlib-compressed .vtu.
"""

import argparse
import pathlib
import struct
import subprocess
import tempfile
import zlib

import numpy as np

SEED = 20011024
EXPONENT = 2.2
BLOCK = 32768


def graded_points(count):
    u = np.random.default_rng(SEED).random((count, 3))
    inner = 0.5 + np.sign(u - 0.5) * np.abs(2 * u - 1) ** EXPONENT / 2
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
    return np.vstack([corners, inner])


def delaunay(points):
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder) / "points.node"
        with open(path, "w") as out:
            out.write(f"{len(points)} 3 0 0\n")
            for i, p in enumerate(points):
                out.write(f"{i} {p[0]:.17g} {p[1]:.17g} {p[2]:.17g}\n")
        subprocess.run(["tetgen", "-zQBFN", str(path)], check=True, stdout=subprocess.DEVNULL)
        with open(pathlib.Path(folder) / "points.1.ele") as file:
            header = file.readline().split()
            rows = np.fromstring(file.read().split("#")[0], dtype=np.int64, sep=" ")
    return rows.reshape(int(header[0]), 5)[:, 1:]


def oriented(points, tets):
    p = points[tets]
    volume = np.einsum("ij,ij->i", np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), p[:, 3] - p[:, 0])
    tets[volume < 0] = tets[volume < 0][:, [1, 0, 2, 3]]
    return tets


def compressed(array):
    raw = array.tobytes()
    blocks = [zlib.compress(raw[i : i + BLOCK], 6) for i in range(0, len(raw), BLOCK)]
    head = [len(blocks), BLOCK, len(raw) % BLOCK] + [len(b) for b in blocks]
    return struct.pack(f"<{len(head)}Q", *head) + b"".join(blocks)


def write_vtu(path, points, tets, field):
    arrays = [
        ("PointData", '<DataArray type="Float64" Name="f"', field.astype("<f8")),
        ("Points", '<DataArray type="Float64" Name="Points" NumberOfComponents="3"', points.astype("<f8")),
        ("Cells", '<DataArray type="Int64" Name="connectivity"', tets.astype("<i8")),
        ("Cells", '<DataArray type="Int64" Name="offsets"', np.arange(4, 4 * len(tets) + 4, 4, dtype="<i8")),
        ("Cells", '<DataArray type="UInt8" Name="types"', np.full(len(tets), 10, dtype="u1")),
    ]
    body, appended, section = "", b"", None
    for name, start, array in arrays:
        if name != section:
            body += (f"</{section}>\n" if section else "") + f"<{name}>\n"
            section = name
        body += f'{start} format="appended" offset="{len(appended)}"/>\n'
        appended += compressed(array)
    with open(path, "wb") as out:
        out.write(
            b'<?xml version="1.0"?>\n<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian" '
            b'header_type="UInt64" compressor="vtkZLibDataCompressor">\n<UnstructuredGrid>\n'
            + f'<Piece NumberOfPoints="{len(points)}" NumberOfCells="{len(tets)}">\n{body}</{section}>\n'.encode()
            + b'</Piece>\n</UnstructuredGrid>\n<AppendedData encoding="raw">\n_'
            + appended
            + b"\n</AppendedData>\n</VTKFile>\n"
        )


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("output", help="the .vtu file")
    parser.add_argument("--points", type=int, default=150000)
    arguments = parser.parse_args()
    points = graded_points(arguments.points)
    tets = oriented(points, delaunay(points))
    field = np.sin(9 * points[:, 0]) * np.cos(7 * points[:, 1]) + points[:, 2] ** 2
    write_vtu(arguments.output, points, tets, field)
    print(f"{arguments.output}: {len(points)} points, {len(tets)} tetrahedra")


if __name__ == "__main__":
    main()
