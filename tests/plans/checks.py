"""Checks of one file against its mesh. Each appends sentences to a list of problems and ratios of error to allowance to a summary."""

import numpy

from plans.geometry import IN, OUT, Values, float_ulp
from plans.oracle import CORNERS, ON_PLANE, Reconstruction, keys_of, weights_of
from plans.vdb_reader import FileSamples, turn

SPILL = {"software": 2.0**-12, "slicing": 2.0**-8, "hybrid": 2.0**-8}
PLACE = {"software": 2.0**-24, "slicing": 2.0**-8, "hybrid": 2.0**-8}


class Findings:
    def __init__(self):
        self.problems = []
        self.ratios = {}
        self.counts = {}

    def problem(self, check, text):
        self.problems.append(f"{check}: {text}")

    def ratio(self, check, value):
        self.ratios[check] = max(self.ratios.get(check, 0.0), float(value))

    def count(self, what, number):
        self.counts[what] = self.counts.get(what, 0) + int(number)


def some(points, most=3):
    text = ", ".join(str(tuple(int(x) for x in p)) for p in points[:most])
    return text + (f" and {len(points) - most} more" if len(points) > most else "")


class Kept:
    """The lattice points that --bounds keeps."""

    def __init__(self, file, layout_level):
        self.file, self.layout_level = file, layout_level
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


def stored_points(file, level, kept):
    """Lattice points that the leaves own: those of one level, or all of the flat grid's level."""
    tree = file.tree
    n = tree.cells
    cube = numpy.stack(numpy.meshgrid(*(numpy.arange(n),) * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    if file.layout == "levels":
        points = (tree.bricks[level][:, None, :] * n + cube).reshape(-1, 3)
        return points[kept.keeps(level, points)]
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
                low = -(-brick * n // step)
                low, high = -((-brick * n) // step), -((-(brick + 1) * n) // step)
                axes = [numpy.arange(a, b) for a, b in zip(low, high)]
                points = numpy.stack(numpy.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
                parts.append(points[kept.keeps(level, points)])
    return numpy.concatenate(parts) if parts else numpy.zeros((0, 3), numpy.int64)


class Checker:
    def __init__(self, mesh, mesh_samples, file, algorithm, half):
        self.mesh, self.samples, self.file, self.algorithm, self.half = mesh, mesh_samples, file, algorithm, half
        self.findings = Findings()
        self.kept = Kept(file, file.flat_level)
        self.oracle = Reconstruction(file.tree, mesh_samples)
        self.states = {}  # level -> (sorted keys, state) of the stored points

    def run(self):
        self.structure()
        for level in self.file.levels():
            self.coverage(level)
            self.values(level)
        self.places()
        return self.findings

    def structure(self):
        """Grids, backgrounds, transforms, half floats."""
        file, out = self.file, self.findings
        expected = {file.grid_name(name, level) for f in file.fields for name in f["grids"] for level in file.levels()}
        expected |= {file.grid_name("coverage", level) for level in file.levels()}
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
            wanted = file.unit_scale * turn(tree.origin + tree.level_spacing(grid.level) * index, file.up_axis)
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
        points = stored_points(self.file, level, self.kept)
        state, values = self.samples.states(level, points)
        order = numpy.argsort(keys_of(points))
        self.states[level] = (keys_of(points)[order], state[order])
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
        if len(stray) and self.file.layout == "levels":
            out.problem("bricks", f"coverage level {level} is active in no brick of the level at {some(stray)}")
        elif len(stray):
            spilt = numpy.concatenate([spilt, stray[self.samples.states(level, stray)[0] == OUT]])
        if len(spilt):
            distance, _ = self.samples.level(level).nearest(spilt)
            bound = SPILL[self.algorithm]
            out.ratio("spill", distance.max() / bound)
            if (distance > bound + 1e-9).any():
                far = distance > bound + 1e-9
                out.problem("spill", f"coverage level {level}: active {distance.max():g} voxel from the mesh: {some(spilt[far])}")

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

    def active_points(self, level):
        """Points that are active in any grid of the level."""
        grids = [g for g in self.file.grids.values() if g.level == level]
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
        states, _ = self.samples.states(level, extension)
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
                out.problem("values", f"{grid.name} component {component}: {bad.sum()} {name}s of {rows.sum()} are wrong, worst at {some(points[i:i + 1])}: "
                            f"expected {low[i]!r} to {high[i]!r}, got {got[i]!r}")  # fmt: skip

    # Places in the mesh -------------------------------------------------------------------------------------------------------------

    def places(self):
        """Nodes and centroids: a trilinear reader finds all its voxels, and the file's figures hold and aren't inflated."""
        mesh, file = self.mesh, self.file
        nodes = numpy.unique(mesh.tets)
        points = numpy.concatenate([mesh.points[nodes], mesh.points[mesh.tets].mean(axis=1)])
        is_node = numpy.arange(len(points)) < len(nodes)
        sure = numpy.ones(len(points), bool)
        if file.bounds:
            b = numpy.array(file.bounds).reshape(2, 3)
            slack = numpy.minimum(points - b[0], b[1] - points).min(axis=1) / file.tree.spacing
            points, is_node, sure, nodes_kept = points[slack >= -1e-9], is_node[slack >= -1e-9], slack[slack >= -1e-9] > 1e-9, slack >= -1e-9
        else:
            nodes_kept = sure
        if not len(points):
            return
        reader = FileSamples(file, self.samples)
        got = self.read_flat(reader, points) if file.layout == "flat" else self.read_levels(reader, points, sure)
        if file.extend:
            missing = {}
            for name, where in reader.missing:
                missing.setdefault(name, []).append(where)
            for name, where in missing.items():
                where = numpy.unique(numpy.concatenate(where), axis=0)
                self.findings.problem("missing voxels", f"{name}: places in the mesh need {len(where)} voxels that aren't active: {some(where)}")
        self.figures(got, points, is_node, sure, nodes, nodes_kept)

    def snap(self, fraction):
        return numpy.where(fraction < ON_PLANE, 0.0, numpy.where(fraction > 1 - ON_PLANE, 1.0, fraction))

    def read_flat(self, reader, places):
        file, level = self.file, self.file.flat_level
        index = (places - file.tree.origin) / file.tree.level_spacing(level)
        cell = numpy.floor(index).astype(numpy.int64)
        self.findings.count("places read", len(places))

        class OneGrid:
            table, channels, fields = reader.table, reader.channels, reader.fields

            @staticmethod
            def sample(_, points):
                return reader.read(level, points, lambda rows: self.oracle.at(level, points[rows]))

        flat = FlatReconstruction(OneGrid)
        return flat.interpolate(level, cell, self.snap(index - cell))

    def read_levels(self, reader, places, sure):
        file = self.file
        level, first = file.tree.leaf_of_places(places)
        lost = (level < 0) & sure
        if lost.any():
            self.findings.problem("bricks", f"{lost.sum()} places in the mesh are in no brick, the first {places[lost][0]}")
        recon = Reconstruction(file.tree, reader)
        result = Values.none(len(places), reader.channels, reader.fields)
        result.broken[level < 0] = True
        self.findings.count("places read", (level >= 0).sum())
        for m in numpy.unique(level[level >= 0]):
            rows = numpy.flatnonzero(level == m)
            index = (places[rows] - file.tree.origin) / file.tree.level_spacing(int(m)) - first[rows]
            cell = numpy.clip(numpy.floor(index), 0, file.tree.cells - 1).astype(numpy.int64)
            fraction = numpy.clip(self.snap(index - cell), 0, 1)
            result.put(rows, recon.interpolate(int(m), cell + first[rows], fraction))
        return result

    def figures(self, got, places, is_node, sure, nodes, kept):
        """The largest deviation is the file's figure: not above it, and not below."""
        mesh, out, table = self.mesh, self.findings, self.samples.table
        for position, (field, claim) in enumerate(zip(mesh.fields, self.file.report["fields"])):
            channels = slice(table.first[position], table.first[position + 1])
            if field.location == "point":
                exact = numpy.concatenate([field.values[nodes], field.values[mesh.tets].mean(axis=1)])[kept]
                with numpy.errstate(over="ignore"):
                    finite = numpy.isfinite(exact.astype(numpy.float32)).all(axis=1)
                finite[~is_node] &= ~table.broken[kept[len(nodes) :], position]
            else:
                exact = numpy.concatenate([numpy.zeros((len(nodes), field.components)), field.values])[kept]
                with numpy.errstate(over="ignore"):
                    finite = numpy.isfinite(exact.astype(numpy.float32)).all(axis=1) & ~is_node
            usable = finite & got.finite[:, position]
            certain = usable & sure & ~got.broken[:, position]
            if not usable.any():
                continue
            low, high = got.low[:, channels], got.high[:, channels]
            most = numpy.linalg.norm(numpy.maximum(numpy.abs(low - exact), numpy.abs(high - exact))[usable], axis=1).max()
            scale = numpy.abs(exact[usable]).max()
            allowed = 4 * float_ulp(scale) + 1e-6 * abs(claim["max"] or 0)
            if certain.any():
                error = numpy.linalg.norm(numpy.maximum(0, numpy.maximum(low - exact, exact - high))[certain], axis=1)
                worst = numpy.argmax(error)
                out.ratio("error above the figure", max(0, error[worst] - claim["max"]) / allowed)
                if error[worst] > claim["max"] + allowed:
                    out.problem("figure", f"{field.name}: the file says {claim['max']!r}, a trilinear reader is off by {error[worst]!r} at "
                                f"{places[certain][worst].tolist()} (exact {exact[certain][worst].tolist()}, "
                                f"read {low[certain][worst].tolist()})")  # fmt: skip
            out.ratio("figure above the error", max(0, claim["max"] - most) / allowed)
            if claim["max"] > most + allowed:
                out.problem("figure", f"{field.name}: the file says {claim['max']!r} at {claim.get('worst_place')}, but the largest error found is {most!r}")


class FlatReconstruction(Reconstruction):
    """A trilinear reader of one grid."""

    def __init__(self, samples):
        super().__init__(None, samples)

    def at_unique(self, level, points):
        return self.samples.sample(level, points)
