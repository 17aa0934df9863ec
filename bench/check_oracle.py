#!/usr/bin/env python3
"""Works the errors of a benchmark's report out anew, in rational arithmetic and by none of Tessera's code.

check_oracle.py MESH.vtu REPORT_FOLDER [--places 1000]

Reads a mesh of tetrahedra with VTK (of another one what `tessera tets` writes), and oracle.csv and report.json
of `tessera bench`. For each place the element that holds it is found and the field interpolated exactly; the
value must be that of the file to the last bits of a double, and the errors of every variant, over as many
places as the report has, must be those of the report. Exit code 1 where they aren't.
"""

import argparse
import csv
import json
import math
import pathlib
import sys
from fractions import Fraction

import numpy
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader


def read_mesh(path, field, location):
    reader = vtkXMLUnstructuredGridReader()
    reader.SetFileName(str(path))
    reader.Update()
    grid = reader.GetOutput()
    types = {grid.GetCellType(c) for c in range(grid.GetNumberOfCells())}
    if types != {10}:
        sys.exit(f"{path}: not tetrahedra alone (types {sorted(types)}); use what `tessera tets` writes")
    points = vtk_to_numpy(grid.GetPoints().GetData()).astype(numpy.float64)
    tets = vtk_to_numpy(grid.GetCells().GetConnectivityArray()).reshape(-1, 4)
    data = grid.GetCellData() if location == "cell" else grid.GetPointData()
    values = vtk_to_numpy(data.GetArray(field)).astype(numpy.float64)
    return points, tets, values if values.ndim == 1 else values[:, 0]


def determinant(a, b, c):
    return (a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0])
            + a[2] * (b[0] * c[1] - b[1] * c[0]))  # fmt: skip


def weights(corners, place):
    """Barycentric coordinates, exact; None for an element without volume."""
    edges = [[x - y for x, y in zip(corner, corners[0])] for corner in corners[1:]]
    whole = determinant(*edges)
    if whole == 0:
        return None
    to = [x - y for x, y in zip(place, corners[0])]
    three = [determinant(*(edges[:i] + [to] + edges[i + 1:])) / whole for i in range(3)]
    return [1 - sum(three), *three]


class Mesh:
    def __init__(self, points, tets, values, location):
        self.points, self.tets, self.values, self.location = points, tets, values, location
        corners = points[tets]
        self.low, self.high = corners.min(axis=1), corners.max(axis=1)

    def values_at(self, place):
        """The exact values of the elements that hold it."""
        near = numpy.array([float(x) for x in place])
        slack = 1e-9 * (1 + numpy.abs(near))
        found = []
        for e in numpy.flatnonzero(((self.low <= near + slack) & (self.high >= near - slack)).all(axis=1)):
            corners = [[Fraction(float(x)) for x in self.points[n]] for n in self.tets[e]]
            share = weights(corners, place)
            if share is None or min(share) < 0:
                continue
            if self.location == "cell":
                found.append(Fraction(float(self.values[e])))
            else:
                found.append(sum(w * Fraction(float(self.values[n])) for w, n in zip(share, self.tets[e])))
        return found


def close(a, b, tolerance=1e-9):
    return abs(a - b) <= tolerance * max(abs(a), abs(b)) + 1e-300


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("mesh", type=pathlib.Path)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--places", type=int, default=1000)
    arguments = parser.parse_args()
    report = json.loads((arguments.folder / "report.json").read_text())
    if report["input"]["components"] != 1:
        print(f"{report['input']['field']}: it isn't a scalar field; oracle.csv has one component only", file=sys.stderr)
        return 2
    given, field_range = report["input"], Fraction(report["input"]["range"])
    mesh = Mesh(*read_mesh(arguments.mesh, given["field"], given["location"]), given["location"])
    with open(arguments.folder / "oracle.csv", newline="") as file:
        rows = list(csv.DictReader(file))[: arguments.places]
    names = [v["variant"] for v in report["oracle"]["variants"]]
    errors, problems, missing = {name: [] for name in names}, [], 0
    for row in rows:
        index = [int(row[a]) for a in "ijk"]
        place = [Fraction(float(row[a])) + i * Fraction(float(row["spacing"])) for a, i in zip("xyz", index)]
        exact = mesh.values_at(place)
        if not exact:
            missing += 1
            continue
        if not any(close(float(row["exact"]), float(value), 2**-48) for value in exact):
            problems.append(f"{index}: the report has {row['exact']}, exact is {float(exact[0])!r}")
        for name in names:
            sample = float(numpy.float32(row[name]))  # as shortly as a 32-bit float is written
            if math.isfinite(sample):
                error = min(abs(Fraction(sample) - value) for value in exact)
                errors[name].append(error / field_range if field_range else Fraction(0))
    if missing:
        problems.append(f"{missing} places lie in no element")
    for variant in report["oracle"]["variants"]:
        own = sorted(float(e) for e in errors[variant["variant"]])
        if len(rows) < report["oracle"]["places"] or not own:
            continue
        figures = {"max": own[-1], "p999": own[math.ceil(0.999 * len(own)) - 1],
                   "rms": math.sqrt(math.fsum(e * e for e in own) / len(own))}  # fmt: skip
        for name, value in figures.items():
            if not close(value, variant[name], 1e-6):
                problems.append(f"{variant['variant']}: {name} is {value!r}, the report has {variant[name]!r}")
    for problem in problems:
        print(problem)
    print(f"{len(rows)} places, {len(names)} variants: {len(problems)} differences")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
