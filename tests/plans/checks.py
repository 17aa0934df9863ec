"""Checks of the voxels of one file against its mesh: coverage, values, what is active and what isn't."""

import numpy

from plans.findings import Findings, some
from plans.geometry import IN, OUT, float_ulp
from plans.oracle import Reconstruction, keys_of
from plans.places import PlaceChecker
from plans.vdb_reader import turn

SPILL = {"software": 2.0**-12, "slicing": 2.0**-8, "hybrid": 2.0**-8, "compute": 2.0**-8}
PLACE = {"software": 2.0**-24, "slicing": 2.0**-8, "hybrid": 2.0**-8, "compute": 2.0**-8}


class Kept:
    """The lattice points that --bounds keeps."""

    def __init__(self, file):
        self.file = file
        tree = file.tree
        self.boxes = {}
        if file.bounds:
            b = numpy.array(file.bounds).reshape(2, 3)
            for level in range(tree.levels + 1):
                index = (b - tree.origin) / tree.level_spacing(level)
                near = numpy.abs(index - numpy.round(index)) < 1e-6
                self.boxes[level] = (
                    numpy.where(near[0], numpy.round(index[0]), numpy.floor(index[0])).astype(numpy.int64),
                    numpy.where(near[1], numpy.round(index[1]), numpy.ceil(index[1])).astype(numpy.int64),
                )

    def inside(self, level, points):
        low, high = self.boxes[level]
        return ((points >= low) & (points <= high)).all(axis=1)

    def keeps(self, level, points):
        if not self.file.bounds:
            return numpy.ones(len(points), bool)
        result = self.inside(level, points)
        if self.file.layout == "levels":
            result |= (points % 2 == 0).all(axis=1) & self.inside(level + 1, points // 2)
        return result


def stored_points(mesh, file, level, kept):
    """Lattice points that the leaves own: those of one level, or all of the flat grid's level."""
    tree = file.tree
    n = tree.cells
    cube = numpy.stack(numpy.meshgrid(*(numpy.arange(n),) * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    if file.layout == "levels":
        points = (tree.bricks[level][:, None, :] * n + cube).reshape(-1, 3)
        # Corners of coarse bricks beyond the box are needed only where there are such bricks: places.py looks for them.
        return points[kept.inside(level, points)] if file.bounds else points
    if not file.bounds:
        # All of the mesh is stored, so its whole box is looked at.
        low, high = (numpy.floor((x - tree.origin) / tree.level_spacing(level)).astype(numpy.int64) for x in mesh.bounds())
        if float((high - low + 2.0).prod()) < 4e6:
            axes = [numpy.arange(a, b + 2) for a, b in zip(low, high)]
            return numpy.stack(numpy.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    parts = []
    for m in range(tree.levels):
        if m >= level:
            edge = n << (m - level)
            local = numpy.stack(numpy.meshgrid(*(numpy.arange(edge),) * 3, indexing="ij"), axis=-1).reshape(-1, 3)
            for brick in tree.bricks[m]:
                points = brick * edge + local
                parts.append(points[kept.keeps(level, points)])
        else:
            step = 1 << (level - m)
            for brick in tree.bricks[m]:
                low, high = -((-brick * n) // step), -((-(brick + 1) * n) // step)
                axes = [numpy.arange(a, b) for a, b in zip(low, high)]
                points = numpy.stack(numpy.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
                parts.append(points[kept.keeps(level, points)])
    return numpy.concatenate(parts) if parts else numpy.zeros((0, 3), numpy.int64)


class Checker:
    def __init__(self, mesh, mesh_samples, file, algorithm):
        self.mesh, self.samples, self.file, self.algorithm = mesh, mesh_samples, file, algorithm
        self.findings = Findings()
        self.kept = Kept(file)
        self.oracle = Reconstruction(file.tree, mesh_samples)

    def run(self, rng):
        self.structure()
        for level in self.file.levels():
            self.coverage(level)
            self.values(level)
            self.surface(level)
        self.report()
        PlaceChecker(self.mesh, self.samples, self.file, self.oracle, self.kept, self.findings).run(rng)
        return self.findings

    def structure(self):
        """Grids, backgrounds, transforms, half floats."""
        file, out = self.file, self.findings
        expected = {file.grid_name(name, level) for f in file.fields for name in f["grids"] for level in file.levels()}
        expected |= {file.grid_name("coverage", level) for level in file.levels()}
        if file.layout == "levels" and file.extend:
            has_surface = any(file.grid("surface", level) is not None for level in file.levels())
            expected |= {file.grid_name("surface", level) for level in file.levels() if has_surface}
        if expected != set(file.grids):
            out.problem("grids", f"expected {sorted(expected)}, the file has {sorted(file.grids)}")
        for grid in file.grids.values():
            if grid.off_values_wrong:
                out.problem("background", f"inactive voxels of {grid.name} don't hold {grid.background}: {grid.off_values_wrong}")
            self.transform(grid)

    def transform(self, grid):
        file = self.file
        tree, corner = file.tree, grid.points if len(grid.points) else numpy.zeros((1, 3), numpy.int64)
        for index in (corner.min(axis=0), corner.max(axis=0)):
            wanted = file.unit_scale * turn(tree.origin + tree.level_spacing(grid.level) * (index + file.voxel_shift), file.up_axis)
            got = numpy.array(grid.vdb.transform.indexToWorld(tuple(int(i) for i in index)))
            size = numpy.abs(wanted).max() + numpy.abs(file.unit_scale * tree.origin).max()
            allowed = 2.0**-50 * size * (1 + numpy.abs(index).max()) + 1e-12 * file.unit_scale * tree.level_spacing(grid.level)
            self.findings.ratio("transform", numpy.abs(got - wanted).max() / allowed)
            if not (numpy.abs(got - wanted) <= allowed).all():
                self.findings.problem("transform", f"{grid.name} voxel {some([index])}: expected place {wanted}, got {got}")

    def coverage(self, level):
        """Active exactly at the stored points in the mesh, but for what lies within rounding of its boundary."""
        out, grid = self.findings, self.file.grid("coverage", level)
        if grid is None:
            return
        points = stored_points(self.mesh, self.file, level, self.kept)
        state = self.samples.states(level, points)
        covered = grid.find(points) >= 0
        out.count("stored points", len(points))
        out.count("covered points", covered.sum())
        holes = points[(state == IN) & ~covered]
        if len(holes):
            out.problem("holes", f"coverage level {level}: in the mesh and not active: {some(holes)}")
        spilt = points[(state == OUT) & covered]
        stray = grid.points[~numpy.isin(grid.keys, keys_of(points))]
        outside = stray[~self.kept.keeps(level, stray)]
        if len(outside):
            out.problem("bounds", f"coverage level {level} is active beyond the bounds at {some(outside)}")
        stray = stray[self.kept.keeps(level, stray)]
        foreign = stray[self.file.tree.owner(level, stray) != level]
        if len(foreign) and self.file.layout == "levels":
            out.problem("bricks", f"coverage level {level} is active in no brick of the level at {some(foreign)}")
        spilt = numpy.concatenate([spilt, stray[self.samples.states(level, stray) == OUT]])
        if len(spilt):
            distance, _ = self.samples.level(level).nearest(spilt)
            bound = SPILL[self.algorithm]
            out.ratio("spill", distance.max() / bound)
            if (distance > bound + 1e-9).any():
                far = distance > bound + 1e-9
                out.problem("spill", f"coverage level {level}: active {distance.max():g} voxel from the mesh: {some(spilt[far])}")

    def report(self):
        """Counts in the report are those of the grids."""
        file = self.file
        if file.layout != "levels":
            return
        covered = {level: file.grid("coverage", level) for level in file.levels()}
        if any(grid is None for grid in covered.values()):
            return
        count = sum(len(grid.points) for grid in covered.values())
        if count != file.report["covered_points"]:
            self.findings.problem("counts", f"covered_points is {file.report['covered_points']}, the coverage has {count}")
        for field, claim in zip(file.fields, file.report["fields"]):
            valid = 0
            for level in file.levels():
                grids = [file.grid(name, level) for name in field["grids"]]
                points = covered[level].points
                valid += numpy.all([grid.find(points) >= 0 for grid in grids if grid is not None], axis=0).sum()
            if valid != claim["valid_points"]:
                self.findings.problem("counts", f"valid_points of {field['name']} is {claim['valid_points']}, its grids have {valid}")

    def values(self, level):
        """Every active voxel holds R(p), or the value at the nearest mesh point; the right ones are active."""
        file, out = self.file, self.findings
        points = self.active_points(level)
        if not len(points):
            return
        kept = self.kept.keeps(level, points)
        if not kept.all():
            out.problem("bounds", f"value grids of level {level} are active beyond the bounds at {some(points[~kept])}")
        if file.layout == "levels":
            owner = file.tree.owner(level, points)
            wrong = (owner >= 0) & (owner != level)
            if wrong.any():
                out.problem("owners", f"level {level} stores points that bricks of level {owner[wrong][0]} own: {some(points[wrong])}")
            expected = self.samples.sample(level, points)
        else:
            expected = self.oracle.at(level, points)
        coverage = file.grid("coverage", level)
        covered = coverage.find(points) >= 0 if coverage is not None else numpy.zeros(len(points), bool)
        out.count("extension voxels", (~covered).sum())
        self.reach(level, points[~covered])
        for grid, component, channel, position in file.channel_grids(level):
            if grid is None:
                continue
            found = grid.find(points)
            active = found >= 0
            here = (covered & ~active & expected.finite[:, position] & ~expected.broken[:, position])
            if here.any():
                out.problem("activity", f"{grid.name} isn't active at covered points with a value: {some(points[here])}")
            here = active & ~expected.finite[:, position]
            if here.any():
                out.problem("activity", f"{grid.name} is active where the value isn't finite: {some(points[here])}")
            rows = active & expected.finite[:, position]
            self.compare(grid, component, points[rows], grid.values[found[rows], component], expected.low[rows, channel],
                         expected.high[rows, channel], covered[rows])  # fmt: skip

    def surface(self, level):
        """How far from the boundary of the mesh points are, below 0 in the mesh: those of cells that it runs through."""
        out, file = self.findings, self.file
        grid, coverage = (file.grid(name, level) for name in ("surface", "coverage"))
        if coverage is None or not file.extend or file.layout != "levels":
            return
        # Pairs of points next to each other in a brick, one in the mesh and one outside.
        for axis in range(3):
            beside = coverage.points + numpy.eye(3, dtype=numpy.int64)[axis]
            # On - faces they may be interpolated from a coarser brick.
            is_inside = ((beside % file.tree.cells) * (coverage.points % file.tree.cells) > 0).all(axis=1)
            crossed = is_inside & (coverage.find(beside) < 0) & self.kept.keeps(level, coverage.points) & self.kept.keeps(level, beside)
            for points in (coverage.points[crossed], beside[crossed]):
                missing = points if grid is None else points[grid.find(points) < 0]
                if len(missing):
                    out.problem("surface", f"level {level} has no distance from the surface at {some(missing)}")
        if grid is None or not len(grid.points):
            return
        voxels = grid.values[:, 0] / (file.tree.level_spacing(level) * file.unit_scale)
        distance, _ = self.samples.level(level).nearest(grid.points)
        if file.bounds:
            distance = numpy.minimum(distance, 1.75)  # where bounds end the points nobody looks for more than a cell's diagonal
        off = numpy.abs(numpy.abs(voxels) - numpy.minimum(distance, 3.5))
        off[(distance >= 1.75) & (numpy.abs(voxels) >= 1.75) & bool(file.bounds)] = 0
        out.count("distances from the surface", len(off))
        out.ratio("distance from the surface", off.max() / 1e-5)
        state = self.samples.states(level, grid.points)
        wrong = (off > 1e-5) | ((state == IN) & (voxels > 0)) | ((state == OUT) & (voxels < 0))
        if wrong.any():
            i = numpy.flatnonzero(wrong)[:3]
            out.problem("surface", f"{grid.name} at {some(grid.points[i])}: {voxels[i]} voxels, expected {distance[i]}, state {state[i]}")

    def active_points(self, level):
        """Points that are active in any grid of the level."""
        grids = [g for g in self.file.grids.values() if g.level == level and not g.name.startswith("surface_level_")]
        points = numpy.concatenate([g.points for g in grids])
        _, first = numpy.unique(numpy.concatenate([g.keys for g in grids]), return_index=True)
        return points[first]

    def reach(self, level, extension):
        """Extension voxels lie within `extend` steps of a cell that the mesh touches: within that many voxels of the mesh."""
        if not len(extension):
            return
        if not self.file.extend:
            self.findings.problem("extension", f"level {level} has extension voxels without --extend: {some(extension)}")
            return
        distance, _ = self.samples.level(level).nearest(extension)
        states = self.samples.states(level, extension)
        bound = 3**0.5 * max(self.file.extend, 1) * (1 + 1e-6)
        if self.file.layout == "levels":
            bound *= 2  # coarse corners of a border cell, and corners in finer grids
        far = (distance > bound) & (states == OUT)
        if far.any() and self.file.layout == "flat":
            self.findings.problem("extension", f"level {level} is extended {distance[far].max():g} voxels from the mesh: {some(extension[far])}")

    def compare(self, grid, component, points, got, low, high, covered):
        out = self.findings
        largest = numpy.maximum(numpy.abs(low), numpy.abs(high))
        allowed = float_ulp(largest) * 0.501
        if grid.half:
            allowed = allowed + numpy.maximum(largest * 2.0**-11, 2.0**-25) * 1.001
        middle, width = (low + high) / 2, (high - low) / 2
        with numpy.errstate(invalid="ignore"):
            ratio = numpy.abs(got - middle) / (width + allowed)
        if not len(ratio):
            return
        for name, rows in (("sample", covered), ("extension value", ~covered)):
            if rows.any():
                out.ratio(name + (" (half)" if grid.half else ""), numpy.nan_to_num(ratio[rows], nan=numpy.inf).max())
            bad = rows & ~(ratio <= 1 + 1e-9)
            if bad.any():
                i = numpy.flatnonzero(bad)[numpy.argmax(numpy.abs(got - middle)[bad])]
                out.problem("values", f"{grid.name} component {component}: {bad.sum()} {name}s of {rows.sum()} are wrong, worst at {some(points[i:i + 1])}, "
                            f"place {(self.file.tree.origin + self.file.tree.level_spacing(grid.level) * points[i]).tolist()}: "
                            f"expected {low[i]!r} to {high[i]!r}, got {got[i]!r}")  # fmt: skip
