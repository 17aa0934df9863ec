#!/usr/bin/env python3
"""Checks tessera's VDB files from outside, with Debian's python3-openvdb and python3-vtk9.

For every mesh: `tessera resample` writes a VDB file and `tessera tets` the tetrahedra. vtkProbeFilter probes the tetrahedra in double at the world
places of the VDB's own voxels, taken from each grid's transform, so that a shift of half a voxel shows. Where VTK and the file disagree, the
elements around the point are evaluated one by one in numpy: VTK's search has a slop of 0.1 % of an element and may pick a neighbour or miss one.

A disagreement counts unless the point lies within 1 % of a voxel of the mesh boundary or, for cell data, of a face. Exit code 1 when one counts.
"""

import argparse
import functools
import json
import pathlib
import sys
import tempfile
import time

import numpy as np
import pyopenvdb as vdb
import vtk
from vtk.util.numpy_support import numpy_to_vtk, vtk_to_numpy

NEAR_VOXELS = 0.01  # points this close to the boundary may differ
PLACE_VOXELS = 2.0**-24  # place tolerance of contract clause 4
DEPTH_VOXELS = 2.0**-12  # an element within this distance may own the point
FLOAT_ULP = 2.0**-23
MESH_SUFFIXES = (".vtu", ".vts", ".vtk")


sys.path.insert(0, str(pathlib.Path(__file__).parent.parent / "app"))
from forked_tessera import ForkedTessera  # noqa: E402

forked = functools.cache(ForkedTessera)


def call(tool, *arguments):
    result = forked(tool).run(arguments)
    if result.returncode != 0:
        raise RuntimeError(f"tessera {' '.join(map(str, arguments))}: exit {result.returncode}: {result.stderr.strip()}")
    return result.stdout


class Tets:
    """The tetrahedra that tessera made of a mesh, as VTK and as numpy sees them."""

    def __init__(self, path):
        reader = vtk.vtkXMLUnstructuredGridReader()
        reader.SetFileName(str(path))
        reader.Update()
        self.grid = reader.GetOutput()
        self.points = vtk_to_numpy(self.grid.GetPoints().GetData()).astype(float)
        self.tets = vtk_to_numpy(self.grid.GetCells().GetConnectivityArray()).reshape(-1, 4)
        corners = self.points[self.tets]
        # A row for each axis, so that looking along one reads what lies side by side.
        self.low, self.high = np.ascontiguousarray(corners.min(axis=1).T), np.ascontiguousarray(corners.max(axis=1).T)
        self.fields = {}
        for location, data in (("point", self.grid.GetPointData()), ("cell", self.grid.GetCellData())):
            for i in range(data.GetNumberOfArrays()):
                array = data.GetArray(i)
                if array is not None:
                    values = vtk_to_numpy(array).astype(float)
                    self.fields[location, array.GetName()] = values.reshape(len(values), -1)
        self.make_probe_source()

    def make_probe_source(self):
        """The grid with one double array a location, so that a probe interpolates in double and names cannot clash."""
        self.source = vtk.vtkUnstructuredGrid()
        self.source.CopyStructure(self.grid)
        for (location, name), values in self.fields.items():
            array = numpy_to_vtk(np.ascontiguousarray(values), deep=True)
            array.SetName(f"{location}:{name}")
            (self.source.GetPointData() if location == "point" else self.source.GetCellData()).AddArray(array)

    def probe(self, places):
        """Which places VTK finds inside, and the values of every field there."""
        points = vtk.vtkPoints()
        points.SetDataTypeToDouble()
        points.SetData(numpy_to_vtk(np.ascontiguousarray(places), deep=True))
        cloud = vtk.vtkPolyData()
        cloud.SetPoints(points)
        probe = vtk.vtkProbeFilter()
        probe.SetInputData(cloud)
        probe.SetSourceData(self.source)
        probe.Update()
        data = probe.GetOutput().GetPointData()
        inside = vtk_to_numpy(data.GetArray(probe.GetValidPointMaskArrayName())).astype(bool)
        values = {}
        for key in self.fields:
            array = data.GetArray(f"{key[0]}:{key[1]}")
            values[key] = vtk_to_numpy(array).astype(float).reshape(len(places), -1)
        return inside, values

    def around(self, place, margin):
        """Elements within `margin` of a place so far as their four sides tell: indices, weights, signed depths, gradients of the weights."""
        near = np.flatnonzero((self.low[0] <= place[0] + margin) & (self.high[0] >= place[0] - margin))
        for axis in (1, 2):
            near = near[(self.low[axis][near] <= place[axis] + margin) & (self.high[axis][near] >= place[axis] - margin)]
        p = self.points[self.tets[near]] - place
        weights = np.empty((len(near), 4))
        gradients = np.empty((len(near), 4, 3))
        for i in range(4):
            a, b, c = (p[:, (i + k) % 4] for k in (1, 2, 3))
            normal = np.cross(b - a, c - a)
            with np.errstate(divide="ignore", invalid="ignore"):
                height = np.einsum("ij,ij->i", normal, p[:, i] - a)
                gradients[:, i] = normal / height[:, None]
                weights[:, i] = np.einsum("ij,ij->i", normal, -a) / height
        with np.errstate(divide="ignore", invalid="ignore"):
            depth = (weights / np.linalg.norm(gradients, axis=2)).min(axis=1)
        keep = np.isfinite(depth) & (depth >= -margin)
        return near[keep], weights[keep], depth[keep], gradients[keep]

    def boundary(self):
        surface = vtk.vtkDataSetSurfaceFilter()
        surface.SetInputData(self.grid)
        surface.Update()
        distance = vtk.vtkImplicitPolyDataDistance()
        distance.SetInput(surface.GetOutput())
        return distance


class Samples:
    """Coverage and values of one level of a VDB file, dense over the covered box and one voxel around it."""

    def __init__(self, grids, level, fields, unit_scale):
        coverage = grids[f"coverage_level_{level}"]
        low, high = coverage.evalActiveVoxelBoundingBox()
        low, high = np.array(low) - 1, np.array(high) + 1
        self.spacing = coverage.transform.voxelSize()[0] / unit_scale
        shape = tuple(int(n) for n in high - low + 1)
        self.covered = self.dense(coverage, low, shape, bool).reshape(-1)
        index = np.stack(np.meshgrid(*(np.arange(l, h + 1) for l, h in zip(low, high)), indexing="ij"), axis=-1).reshape(-1, 3)
        base = np.array(coverage.transform.indexToWorld((0, 0, 0)))
        steps = [np.array(coverage.transform.indexToWorld(tuple(int(a == b) for b in range(3)))) - base for a in range(3)]
        self.places = (base + index @ np.array(steps)) / unit_scale
        # A linear map, but let the grid itself tell the place of one far voxel.
        far = np.array(coverage.transform.indexToWorld(tuple(int(n) for n in index[-1]))) / unit_scale
        assert np.allclose(far, self.places[-1], rtol=1e-12, atol=1e-9 * self.spacing)
        self.values = {}
        for field in fields:
            self.values[field["location"], field["source"]] = self.read_field(grids, level, field, low, shape)

    @staticmethod
    def dense(grid, low, shape, dtype):
        array = np.zeros(shape, dtype=dtype)
        grid.copyToArray(array, ijk=tuple(int(n) for n in low))
        return array

    def read_field(self, grids, level, field, low, shape):
        name, components = field["name"], field["components"]
        if components in (1, 3):
            full = shape if components == 1 else shape + (3,)
            return self.dense(grids[f"{name}_level_{level}"], low, full, np.float32).reshape(-1, components)
        parts = [self.dense(grids[f"{name}_{c}_level_{level}"], low, shape, np.float32).reshape(-1) for c in range(components)]
        return np.stack(parts, axis=1)


class Verdict:
    """Counts for one file."""

    def __init__(self):
        self.points = self.inside = self.near_boundary = self.vtk_slop = self.vtk_missed = self.coverage = 0
        self.other_element = self.near_face = self.values = 0
        self.worst = 0.0  # accepted difference to VTK's own value, over the field's range
        self.examples = []

    def bad(self):
        return self.coverage + self.values

    def add_example(self, text):
        if len(self.examples) < 3:
            self.examples.append(text)


def check_coverage(tets, samples, inside, complete, verdict):
    """`complete`: every point of the box is sampled at this level, so one that is not covered must lie outside."""
    differs = samples.covered & ~inside
    if complete:
        differs |= inside & ~samples.covered
    rows = np.flatnonzero(differs)
    if len(rows) == 0:
        return
    boundary = tets.boundary()
    for row in rows:
        place = samples.places[row]
        if abs(boundary.FunctionValue(place)) <= NEAR_VOXELS * samples.spacing:
            verdict.near_boundary += 1
            continue
        _, _, depth, _ = tets.around(place, NEAR_VOXELS * samples.spacing)
        deepest = depth.max() if len(depth) else -np.inf
        if samples.covered[row] and deepest >= -DEPTH_VOXELS * samples.spacing:
            verdict.vtk_missed += 1
        elif not samples.covered[row] and deepest < 0:
            verdict.vtk_slop += 1
        else:
            verdict.coverage += 1
            verdict.add_example(f"coverage {bool(samples.covered[row])} at {place.tolist()}, VTK {bool(inside[row])}, depth {deepest:g}")


def allowed_difference(tets, key, elements, depth, gradients, spacing):
    values = tets.fields[key]
    if key[0] == "cell":
        return 4 * FLOAT_ULP * np.abs(values[elements]).max(axis=1)
    nodes = values[tets.tets[elements]]
    gradient = np.linalg.norm(np.einsum("nik,nic->nkc", gradients, nodes), axis=(1, 2))
    outside = np.maximum(0, -depth)
    return 4 * FLOAT_ULP * np.abs(nodes).max(axis=(1, 2)) + gradient * (PLACE_VOXELS * spacing + 2 * outside)


def explain_value(tets, key, place, stored, spacing, verdict):
    """Whether some element at the place gives the stored value."""
    margin = (NEAR_VOXELS if key[0] == "cell" else DEPTH_VOXELS) * spacing
    elements, weights, depth, gradients = tets.around(place, margin)
    if len(elements) == 0:
        return False
    values = tets.fields[key]
    if key[0] == "cell":
        exact = values[elements]
    else:
        clamped = np.maximum(weights, 0)
        clamped /= clamped.sum(axis=1, keepdims=True)
        exact = np.einsum("ni,nic->nc", clamped, values[tets.tets[elements]])
    difference = np.abs(exact - stored).max(axis=1)
    fits = difference <= allowed_difference(tets, key, elements, depth, gradients, spacing) + 1e-37
    if not fits.any():
        return False
    if depth[fits].max() < -DEPTH_VOXELS * spacing:
        verdict.near_face += 1
    else:
        verdict.other_element += 1
    return True


def check_values(tets, samples, inside, probed, verdict):
    both = np.flatnonzero(samples.covered & inside)
    verdict.inside += len(both)
    for key, stored in samples.values.items():
        field = tets.fields[key]
        largest = float(np.abs(field).max())
        width = float((field.max(axis=0) - field.min(axis=0)).max()) or largest or 1.0
        difference = np.abs(stored[both].astype(float) - probed[key][both]).max(axis=1)
        close = difference <= 4 * FLOAT_ULP * largest
        if close.any():
            verdict.worst = max(verdict.worst, float(difference[close].max()) / width)
        for row in both[~close]:
            place = samples.places[row]
            if not explain_value(tets, key, place, stored[row].astype(float), samples.spacing, verdict):
                verdict.values += 1
                verdict.add_example(f"{key[1]} is {stored[row].tolist()} at {place.tolist()}, VTK {probed[key][row].tolist()}")


def check_file(tets, path, info, complete):
    grids = {grid.name: grid for grid in vdb.readAll(str(path))[0]}
    metadata = vdb.readMetadata(str(path))
    fields = [
        {"name": f["name"], "source": f["source"], "location": f["location"], "components": f["components"]}
        for f in json.loads(metadata["tessera_fields"])
    ]
    verdict = Verdict()
    for level in range(info["lattice"]["levels"]):
        if f"coverage_level_{level}" not in grids or grids[f"coverage_level_{level}"].activeVoxelCount() == 0:
            continue
        samples = Samples(grids, level, fields, info["unit_scale"])
        chosen = np.arange(len(samples.covered)) if complete else np.flatnonzero(samples.covered)
        samples.covered, samples.places = samples.covered[chosen], samples.places[chosen]
        samples.values = {key: value[chosen] for key, value in samples.values.items()}
        inside, probed = tets.probe(samples.places)
        verdict.points += len(chosen)
        check_coverage(tets, samples, inside, complete, verdict)
        check_values(tets, samples, inside, probed, verdict)
    return verdict


def check_mesh(tool, mesh, resolution, folder):
    """Yields (mode, verdict, seconds)."""
    tets_path = folder / "tets.vtu"
    call(tool, "tets", mesh, "-o", tets_path, "--quiet")
    tets = Tets(tets_path)
    size = float((tets.points[np.unique(tets.tets)].max(axis=0) - tets.points[np.unique(tets.tets)].min(axis=0)).max())
    spacing = size / (resolution - 1)
    modes = (
        ("uniform", True, ["--refine", "uniform", "--resolution", resolution]),
        # A lattice that no mesh is aligned with.
        ("shifted", True, ["--refine", "uniform", "--spacing", spacing * 1.0371]),
        ("adaptive", False, ["--refine", "element-size", "--spacing", spacing * 0.77, "--max-levels", 4, "--brick-size", 8]),
    )
    for mode, complete, arguments in modes:
        start = time.time()
        path = folder / f"{mode}.vdb"
        call(tool, "resample", mesh, "-o", path, "--quiet", *arguments)
        info = json.loads(call(tool, "info", path, "--json", "-"))
        yield mode, check_file(tets, path, info, complete), time.time() - start


def list_meshes(folders):
    """Each mesh once: the bundled ones also stand among the larger collection, in folders of the same names."""
    seen = set()
    for folder in folders:
        for path in sorted(pathlib.Path(folder).rglob("*")):
            if path.suffix in MESH_SUFFIXES and path.is_file() and (path.parent.name, path.name) not in seen:
                seen.add((path.parent.name, path.name))
                yield path


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tessera", required=True, help="the program")
    parser.add_argument("--resolution", type=int, default=36, help="lattice points along the longest axis")
    parser.add_argument("--only", help="meshes with this in their path")
    parser.add_argument("folders", nargs="+", help="folders of meshes; absent ones are skipped")
    arguments = parser.parse_args()
    vtk.vtkObject.GlobalWarningDisplayOff()
    for folder in arguments.folders:
        if not pathlib.Path(folder).is_dir():
            print(f"skipped: there is no {folder}")
    meshes = [m for m in list_meshes(arguments.folders) if not arguments.only or arguments.only in str(m)]
    print(f"{'mesh':<34} {'mode':<9} {'points':>8} {'both in':>8} | {'cover.':>6} {'near':>5} {'slop':>5} {'missed':>6} |"
          f" {'values':>6} {'other':>6} {'face':>5} {'worst/range':>11} {'s':>5}")
    bad = 0
    for mesh in meshes:
        with tempfile.TemporaryDirectory() as folder:
            for mode, v, seconds in check_mesh(arguments.tessera, mesh, arguments.resolution, pathlib.Path(folder)):
                print(f"{mesh.parent.name[:14] + '/' + mesh.name:<34.34} {mode:<9} {v.points:>8} {v.inside:>8} | {v.coverage:>6}"
                      f" {v.near_boundary:>5} {v.vtk_slop:>5} {v.vtk_missed:>6} | {v.values:>6} {v.other_element:>6} {v.near_face:>5}"
                      f" {v.worst:>11.2g} {seconds:>5.1f}", flush=True)
                for example in v.examples:
                    print(f"    {example}")
                bad += v.bad()
    print("columns: cover., values: disagreements that count; near: within 1 % of a voxel of the boundary; slop, missed: VTK found or lost a "
          "point that direct evaluation does not; other, face: the value of another element at that point, or within 1 % of a voxel")
    print(f"{len(meshes)} meshes, {bad} disagreements")
    return 1 if bad or not meshes else 0


if __name__ == "__main__":
    sys.exit(main())
