"""Reads Tessera's VDB files with pyopenvdb and numpy: active voxels as sorted arrays, in the mesh's axes."""

import dataclasses
import json

import numpy
import pyopenvdb

from plans.geometry import IN, Values
from plans.oracle import Tree, keys_of

MOST_DENSE = 6_000_000


@dataclasses.dataclass
class Grid:
    """Active voxels of one grid."""

    name: str
    level: int
    components: int
    half: bool
    background: float
    points: numpy.ndarray  # (voxels, 3)
    values: numpy.ndarray  # (voxels, components), doubles
    keys: numpy.ndarray  # sorted, of points
    off_values_wrong: list  # inactive voxels in leaf nodes that don't hold the background
    vdb: object

    def find(self, points):
        """Position of each point's voxel; -1 where it isn't active."""
        wanted = keys_of(points)
        if not len(self.keys):
            return numpy.full(len(wanted), -1)
        found = numpy.minimum(numpy.searchsorted(self.keys, wanted), len(self.keys) - 1)
        return numpy.where(self.keys[found] == wanted, found, -1)


def read_grid(vdb):
    is_vector, is_bool = isinstance(vdb, pyopenvdb.Vec3SGrid), isinstance(vdb, pyopenvdb.BoolGrid)
    components = 3 if is_vector else 1
    background = numpy.array(vdb.background, float).reshape(-1)
    wrong = []
    points, values = numpy.zeros((0, 3), numpy.int64), numpy.zeros((0, components))
    low, high = (numpy.array(x, numpy.int64) for x in vdb.evalLeafBoundingBox())
    shape = tuple(int(n) for n in high - low + 1)
    if vdb.activeVoxelCount() == 0:
        pass
    elif float(numpy.prod([float(n) for n in shape])) <= MOST_DENSE:
        first = tuple(int(x) for x in low)
        # copyToArray doesn't tell active voxels, so a copy is made that does.
        mask = vdb.deepCopy()
        mask.mapOn(lambda _: True if is_bool else ((1.0,) * 3 if is_vector else 1.0))
        mask.mapOff(lambda _: False if is_bool else ((0.0,) * 3 if is_vector else 0.0))
        kind = bool if is_bool else numpy.float32
        full = shape + (3,) if is_vector else shape
        marks, dense = numpy.zeros(full, kind), numpy.zeros(full, kind)
        mask.copyToArray(marks, ijk=first)
        vdb.copyToArray(dense, ijk=first)
        active = (marks[..., 0] if is_vector else marks) == 1
        points = numpy.argwhere(active) + low
        values = dense[active].astype(float).reshape(-1, components)
        off = (dense.reshape(shape + (components,)) != background.astype(kind)).any(axis=-1) & ~active
        wrong = [tuple(p + low) for p in numpy.argwhere(off)[:3]]
    else:
        found = [(v.min, v.max, v.value) for v in vdb.citerOnValues()]
        assert all(a == b for a, b, _ in found), "tiles are read by the dense way only"
        points = numpy.array([a for a, _, _ in found], numpy.int64)
        values = numpy.array([v for _, _, v in found], float).reshape(-1, components)
    keys = keys_of(points)
    order = numpy.argsort(keys)
    return Grid(
        vdb.name, int(vdb.metadata["tessera_level"]), components, bool(vdb.saveFloatAsHalf), float(background[0]),
        points[order], values[order], keys[order], wrong, vdb,
    )  # fmt: skip


def turn_back(values, up_axis):
    """Vectors of the file in the mesh's axes."""
    x, y, z = values.T
    if up_axis == "y":
        return numpy.stack([x, -z, y], axis=1)
    if up_axis == "z":
        return numpy.stack([x, z, -y], axis=1)
    return values


def turn(places, up_axis):
    x, y, z = numpy.asarray(places).T
    if up_axis == "y":
        return numpy.stack([x, z, -y], axis=-1)
    if up_axis == "z":
        return numpy.stack([x, -z, y], axis=-1)
    return numpy.stack([x, y, z], axis=-1)


class TesseraFile:
    def __init__(self, path):
        grids, self.metadata = pyopenvdb.readAll(str(path))
        self.grids = {vdb.name: read_grid(vdb) for vdb in grids}
        self.layout = self.metadata["tessera_layout"]
        self.up_axis = self.metadata["tessera_up_axis"]
        self.unit_scale = float(self.metadata["tessera_unit_scale"])
        self.extend = int(self.metadata.get("tessera_extend", "0"))
        self.fields = json.loads(self.metadata["tessera_fields"])
        self.report = json.loads(self.metadata["tessera_report"])
        self.samples_report = json.loads(self.metadata["tessera_samples_report"]) if "tessera_samples_report" in self.metadata else None
        self.voxel_shift = float(self.metadata.get("tessera_voxel_shift", "0"))
        self.tree = Tree(json.loads(self.metadata["tessera_bricks"]))
        self.flat_level = int(self.metadata["tessera_flat_level"])
        self.bounds = json.loads(self.metadata["tessera_bounds"]) if "tessera_bounds" in self.metadata else None
        for field in self.fields:
            for name in field["grids"]:
                for grid in self.grids_of(name):
                    if grid.components == 3:
                        grid.values = turn_back(grid.values, self.up_axis)

    def levels(self):
        return [self.flat_level] if self.layout == "flat" else [m for m in range(self.tree.levels) if len(self.tree.bricks[m])]

    def grid_name(self, name, level):
        return name if self.layout == "flat" else f"{name}_level_{level}"

    def grid(self, name, level):
        return self.grids.get(self.grid_name(name, level))

    def grids_of(self, name):
        return [g for g in (self.grid(name, level) for level in self.levels()) if g is not None]

    def channel_grids(self, level):
        """(grid, component, channel, position of the grid) of every channel at a level."""
        channel = position = 0
        for field in self.fields:
            for name in field["grids"]:
                grid = self.grid(name, level)
                for c in range(3 if field["components"] == 3 else 1):
                    yield grid, c, channel, position
                    channel += 1
                position += 1


class FileSamples:
    """Voxels as a reader of the file finds them; what isn't active is filled from the mesh and remembered.

    In a flat file without an extension, what isn't active has no value: the report leaves out the places that need it.
    """

    def __init__(self, file, mesh_samples):
        self.file, self.mesh = file, mesh_samples
        self.table, self.channels, self.grids = mesh_samples.table, mesh_samples.channels, mesh_samples.grids
        self.missing = []  # (grid name, points): needed where they may be absent only beyond the mesh, and there is an extension
        self.has_gaps = file.layout == "flat" and not file.extend

    def read(self, level, points, fill):
        """Active voxels of the grids of one level; `fill(rows)` gives the values of those rows that aren't."""
        count = len(points)
        values = Values.none(count, self.channels, self.grids)
        values.finite[:] = True
        absent = numpy.zeros((count, self.grids), bool)
        names = {}
        for grid, component, channel, position in self.file.channel_grids(level):
            found = grid.find(points) if grid is not None else numpy.full(count, -1)
            absent[:, position] |= found < 0
            names[position] = grid.name if grid is not None else f"(grid {position}, which is absent at level {level})"
            if grid is not None and len(grid.values):
                values.low[:, channel] = values.high[:, channel] = grid.values[found, component]
        rows = numpy.flatnonzero(absent.any(axis=1))
        if len(rows):
            exact = fill(rows)
            in_mesh = self.mesh.states(level, points[rows]) == IN
            for position in range(self.grids):
                here = absent[rows, position]
                wanted = here & exact.finite[:, position] & ~exact.broken[:, position] & (in_mesh | (self.file.extend > 0))
                if wanted.any():
                    self.missing.append((names[position], points[rows[wanted]]))
                channels = numpy.flatnonzero(self.table.channel_grid == position)
                at = numpy.ix_(rows[here], channels)
                values.low[at], values.high[at] = exact.low[here][:, channels], exact.high[here][:, channels]
                values.finite[rows[here], position] = exact.finite[here, position] & ~self.has_gaps
                values.broken[rows[here], position] = exact.broken[here, position]
        return values

    def sample(self, level, points):
        """Levels layout: from the leaf that owns the point; what no leaf owns, from the grid where the rules end."""
        owner = self.file.tree.owner(level, points)
        owner[owner < 0] = level
        result = Values.none(len(points), self.channels, self.grids)
        for m in numpy.unique(owner):
            rows = numpy.flatnonzero(owner == m)
            at = points[rows] << (level - int(m)) if m <= level else points[rows] >> (int(m) - level)
            result.put(rows, self.read(int(m), at, lambda which, at=at, m=int(m): self.mesh.sample(m, at[which])))
        return result
