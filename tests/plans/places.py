"""Checks at places in the mesh, as a trilinear reader of the file sees them: voxels that are needed are there, the error report holds."""

import numpy

from plans.findings import some
from plans.geometry import Values, float_ulp
from plans.oracle import ON_PLANE, Reconstruction, keys_of
from plans.vdb_reader import FileSamples


class OneGrid(Reconstruction):
    """A trilinear reader of the grids of one level, whatever the bricks are."""

    def __init__(self, reader, level, oracle):
        super().__init__(None, reader)
        self.level, self.oracle = level, oracle

    def at_unique(self, level, points):
        return self.samples.read(level, points, lambda rows: self.oracle.at(level, points[rows]))


def snap(fraction):
    return numpy.where(fraction < ON_PLANE, 0.0, numpy.where(fraction > 1 - ON_PLANE, 1.0, fraction))


def grown(points, first, last):
    """All points within `first` to `last` steps along every axis of some points, each once."""
    for axis in range(3):
        step = numpy.arange(3) == axis
        points = numpy.concatenate([points + i * step for i in range(first, last + 1)])
        points = points[numpy.unique(keys_of(points), return_index=True)[1]]
    return points


class PlaceChecker:
    def __init__(self, mesh, mesh_samples, file, oracle, kept, findings):
        self.mesh, self.samples, self.file, self.oracle, self.kept, self.findings = mesh, mesh_samples, file, oracle, kept, findings
        # Nodes come first, then centroids.
        self.nodes = numpy.unique(mesh.tets)
        self.places = numpy.concatenate([mesh.points[self.nodes], mesh.points[mesh.tets].mean(axis=1)])

    def run(self, rng):
        inside, sure = self.within_bounds(self.places)
        reader = FileSamples(self.file, self.samples)
        got = self.read(reader, self.places[inside], sure[inside])
        more = self.random_places(rng)
        more_inside, _ = self.within_bounds(more)
        self.read(reader, more[more_inside], numpy.ones(more_inside.sum(), bool))
        self.missing(reader)
        if self.file.extend and self.file.layout == "flat":
            self.flat_layers(numpy.concatenate([self.places[inside], more[more_inside]]))
        elif self.file.extend:
            self.level_layers()
        self.figures(self.file.report, got, inside, sure, "file")
        self.sample_report(inside, sure)

    def within_bounds(self, places):
        """Whether each place is in the bounds, and whether that is sure."""
        if not self.file.bounds:
            return numpy.ones(len(places), bool), numpy.ones(len(places), bool)
        low, high = numpy.array(self.file.bounds).reshape(2, 3)
        slack = numpy.minimum(places - low, high - places).min(axis=1) / self.file.tree.spacing
        return slack >= -1e-9, slack > 1e-9

    def random_places(self, rng):
        """Places in every element, and on the faces of the boundary, where a reader needs what lies outside."""
        mesh, faces = self.mesh, self.samples.level(0).faces
        weights = rng.dirichlet((0.6,) * 4, (len(mesh.tets), 2))
        parts = [numpy.einsum("enk,ekc->enc", weights, mesh.points[mesh.tets]).reshape(-1, 3)]
        weights = rng.dirichlet((0.6,) * 3, (len(faces), 2))
        parts.append(numpy.einsum("enk,ekc->enc", weights, mesh.points[faces]).reshape(-1, 3))
        return numpy.concatenate(parts)

    def read(self, reader, places, sure):
        self.findings.count("places read", len(places))
        if not len(places):
            return Values.none(0, reader.channels, reader.grids)
        if self.file.layout == "levels":
            return self.read_levels(Reconstruction(self.file.tree, reader), places, sure)
        level = self.file.flat_level
        index = (places - self.file.tree.origin) / self.file.tree.level_spacing(level)
        cell = numpy.floor(index).astype(numpy.int64)
        return OneGrid(reader, level, self.oracle).interpolate(level, cell, snap(index - cell))

    def read_levels(self, reconstruction, places, sure):
        """By the rules of the levels layout, in any leaf that holds the place."""
        tree = self.file.tree
        level, first = tree.leaf_of_places(places)
        lost = (level < 0) & sure
        if lost.any():
            self.findings.problem("bricks", f"{lost.sum()} places in the mesh are in no brick, the first {places[lost][0].tolist()}")
        result = Values.none(len(places), self.samples.channels, self.samples.grids)
        result.broken[level < 0] = True
        for m in numpy.unique(level[level >= 0]):
            rows = numpy.flatnonzero(level == m)
            index = (places[rows] - tree.origin) / tree.level_spacing(int(m)) - first[rows]
            cell = numpy.clip(numpy.floor(index), 0, tree.cells - 1).astype(numpy.int64)
            fraction = numpy.clip(snap(index - cell), 0, 1)
            result.put(rows, reconstruction.interpolate(int(m), cell + first[rows], fraction))
        return result

    def missing(self, reader):
        """Every voxel in the mesh that a place in the mesh needs is active, and with an extension those outside too."""
        absent = {}
        for name, points in reader.missing:
            absent.setdefault(name, []).append(points)
        for name, points in absent.items():
            points = numpy.unique(numpy.concatenate(points), axis=0)
            self.findings.problem("missing voxels", f"{name}: places in the mesh need {len(points)} voxels that aren't active: {some(points)}")

    def flat_layers(self, places):
        """Flat: n - 1 layers more around the corners of the cells that the mesh touches (here: those with one of these places well inside)."""
        file, level = self.file, self.file.flat_level
        index = (places - file.tree.origin) / file.tree.level_spacing(level)
        cell = numpy.floor(index)
        inside = ((index - cell > 1e-6) & (index - cell < 1 - 1e-6)).all(axis=1)
        self.active_within(level, grown(cell[inside].astype(numpy.int64), -(file.extend - 1), file.extend), self.oracle)

    def level_layers(self):
        """Levels: n layers around the covered points of a level, but for what bricks of other levels own."""
        file = self.file
        for level in file.levels():
            coverage = file.grid("coverage", level)
            if coverage is not None:
                points = grown(coverage.points, -file.extend, file.extend)
                owner = file.tree.owner(level, points)
                self.active_within(level, points[(owner < 0) | (owner == level)], None)

    def active_within(self, level, points, reconstruction):
        """The grids of a level are active at all points that are kept and have a value."""
        file = self.file
        if file.bounds:
            points = points[self.kept.inside(level, points)]
        seen = set()
        for grid, _, _, position in file.channel_grids(level):
            if grid is None or grid.name in seen:
                continue
            seen.add(grid.name)
            absent = points[grid.find(points) < 0]
            expected = reconstruction.at(level, absent) if reconstruction else self.samples.sample(level, absent)
            wanted = absent[expected.finite[:, position] & ~expected.broken[:, position]]
            self.findings.count("voxels of layers", len(points))
            if len(wanted):
                self.findings.problem("layers", f"{grid.name}: {len(wanted)} voxels within {file.extend} layers aren't active: {some(wanted)}")

    # The error report ---------------------------------------------------------------------------------------------------------------

    def exact(self, field, inside):
        """Exact values at the places, whether they are finite as floats and as doubles."""
        table, tets = self.samples.table, self.mesh.tets
        position = next(i for i, f in enumerate(self.mesh.fields) if f is field)
        if field.location == "point":
            exact = numpy.concatenate([field.values[self.nodes], field.values[tets].mean(axis=1)])
        else:
            exact = numpy.concatenate([numpy.full((len(self.nodes), field.components), numpy.nan), field.values])
        exact = exact[inside]
        with numpy.errstate(over="ignore"):
            valid = numpy.isfinite(exact.astype(numpy.float32)).all(axis=1)
        broken = table.broken[:, table.field_grids[position]].any(axis=1)
        valid &= ~numpy.concatenate([numpy.zeros(len(self.nodes), bool), broken])[inside]
        return exact, valid, numpy.isfinite(exact).all(axis=1)

    def figures(self, report, got, inside, sure, whose):
        """The largest deviation is the figure: not above it, and not below."""
        out, table = self.findings, self.samples.table
        places, sure = self.places[inside], sure[inside]
        if not len(places):
            return
        for position, (field, claim) in enumerate(zip(self.mesh.fields, report["fields"])):
            channels, grids = slice(table.first[position], table.first[position + 1]), table.field_grids[position]
            exact, valid, finite = self.exact(field, inside)
            # A value that is finite in double but not as a float may be measured or left out.
            usable = finite & got.finite[:, grids].all(axis=1)
            certain = valid & usable & sure & ~got.broken[:, grids].any(axis=1)
            low, high = got.low[:, channels], got.high[:, channels]
            most = 0.0
            if usable.any():
                with numpy.errstate(over="ignore"):
                    most = numpy.linalg.norm(numpy.maximum(numpy.abs(low - exact), numpy.abs(high - exact))[usable], axis=1).max()
            scale = numpy.abs(exact[certain]).max() if certain.any() else 0.0
            allowed = 4 * float_ulp(scale) + 1e-6 * abs(claim["max"] or 0)
            if certain.any():
                error = numpy.linalg.norm(numpy.maximum(0, numpy.maximum(low - exact, exact - high))[certain], axis=1)
                worst = numpy.argmax(error)
                out.ratio(f"error above the {whose}'s figure", max(0, error[worst] - claim["max"]) / allowed)
                if error[worst] > claim["max"] + allowed:
                    out.problem("figure", f"{field.name}: the {whose}'s report says {claim['max']!r}, a trilinear reader is off by {error[worst]!r} at "
                                f"{places[certain][worst].tolist()} (exact {exact[certain][worst].tolist()}, "
                                f"read {low[certain][worst].tolist()})")  # fmt: skip
            # Where a value overflows float alone, what an error is worth can't be told.
            if claim["max"] > most + allowed and not (finite & ~valid).any():
                out.problem("inflated figure", f"{field.name}: the {whose}'s report says {claim['max']!r} at {claim.get('worst_place')}, "
                            f"but the largest error found is {most!r}")  # fmt: skip

    def sample_report(self, inside, sure):
        """`tessera_samples_report` speaks of the exact samples, and is there only when the file's voxels aren't those or miss some."""
        file = self.file
        half = any(grid.half for grid in file.grids.values())
        if file.samples_report is None:
            return
        self.findings.count("samples reports")
        if not half and file.flat_level == 0 and (file.layout == "levels" or file.extend):
            self.findings.problem("metadata", "tessera_samples_report is there, but the voxels are the samples")
        if inside.any():
            got = self.read_levels(self.oracle, self.places[inside], sure[inside])
            self.figures(file.samples_report, got, inside, sure, "samples")
