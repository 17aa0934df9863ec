"""The reconstruction of docs/vdb_layout.md, over samples that are computed from the mesh or read from a file."""

import numpy

from plans.geometry import FieldTable, LatticeMesh, Values

ON_PLANE = 2.0**-30  # a place that near to a lattice plane lies on it
CORNERS = numpy.array([(c & 1, c >> 1 & 1, c >> 2) for c in range(8)])
SIDES = CORNERS


def keys_of(points):
    """One integer for each integer point."""
    p = numpy.asarray(points, numpy.int64) + (1 << 20)
    return (p[..., 0] << 42) | (p[..., 1] << 21) | p[..., 2]


def weights_of(fraction):
    """Trilinear weights (points, 8) at fractions (points, 3)."""
    return numpy.where(CORNERS[None], fraction[:, None, :], 1 - fraction[:, None, :]).prod(axis=2)


class Tree:
    """The leaf bricks, from the file's brick table."""

    def __init__(self, table):
        self.origin = numpy.array(table["origin"])
        self.spacing = table["spacing"]
        self.cells = table["brick_cells"]
        self.bricks = [numpy.array(level, numpy.int64).reshape(-1, 3) for level in table["levels"]]
        self.keys = [numpy.sort(keys_of(b)) for b in self.bricks]
        self.levels = len(self.bricks)

    def level_spacing(self, level):
        return self.spacing * 2.0**level

    def has(self, level, bricks):
        keys, wanted = self.keys[level], keys_of(bricks)
        if not len(keys):
            return numpy.zeros(wanted.shape, bool)
        found = numpy.minimum(numpy.searchsorted(keys, wanted), len(keys) - 1)
        return keys[found] == wanted

    def coarsest(self, level, points):
        """Level of the coarsest leaf whose closed box holds each lattice point of `level`; -1 for none."""
        result = numpy.full(len(points), -1)
        at0 = points << level
        for m in range(self.levels - 1, -1, -1):
            edge = self.cells << m
            owner, rest = at0 // edge, at0 % edge
            for side in SIDES:
                fits = ((rest == 0) | (side == 0)).all(axis=1) & (result < 0)
                rows = numpy.flatnonzero(fits)
                result[rows[self.has(m, owner[rows] - side)]] = m
        return result

    def owner(self, level, points):
        """Level of the leaf whose half-open box holds each lattice point of `level`; -1 for none."""
        result = numpy.full(len(points), -1)
        at0 = points << level
        for m in range(self.levels):
            result[self.has(m, at0 // (self.cells << m))] = m
        return result

    def leaf_of_places(self, places):
        """A leaf whose closed box holds each place (units of the mesh): level (-1: none) and first lattice point."""
        level = numpy.full(len(places), -1)
        first = numpy.zeros((len(places), 3), numpy.int64)
        for m in range(self.levels - 1, -1, -1):
            x = (places - self.origin) / self.level_spacing(m) / self.cells
            for side in SIDES:
                brick = numpy.floor(x + numpy.where(side, -1e-9, 1e-9)).astype(numpy.int64)
                hit = self.has(m, brick) & (level < 0)
                level[hit] = m
                first[hit] = brick[hit] * self.cells
        return level, first


class MeshSamples:
    """Exact samples of every level, computed when asked for."""

    def __init__(self, mesh, tree, place_bound):
        self.mesh, self.tree, self.place_bound = mesh, tree, place_bound
        self.table = FieldTable(mesh)
        self.channels, self.grids = self.table.channels, self.table.grids
        self.levels = {}

    def level(self, level):
        if level not in self.levels:
            self.levels[level] = LatticeMesh(self.mesh, self.table, self.tree.origin, self.tree.level_spacing(level), self.place_bound)
        return self.levels[level]

    def states(self, level, points):
        return self.level(level).states(points)

    def sample(self, level, points):
        return self.level(level).samples(points)[1]


class Reconstruction:
    """R(p): `samples.sample(level, points)` gives the values at points on the lattice of their coarsest leaf."""

    def __init__(self, tree, samples):
        self.tree, self.samples = tree, samples

    def at(self, level, points):
        """Values at lattice points of `level`; a point in no leaf takes the sample of its own level."""
        points = numpy.asarray(points, numpy.int64)
        keys, first, back = numpy.unique(keys_of(points), return_index=True, return_inverse=True)
        return self.at_unique(level, points[first]).take(back)

    def at_unique(self, level, points):
        result = Values.none(len(points), self.samples.channels, self.samples.grids)
        coarsest = self.tree.coarsest(level, points)
        coarsest[coarsest < 0] = level
        for m in numpy.unique(coarsest):
            rows = numpy.flatnonzero(coarsest == m)
            at, step = points[rows], 1 << max(0, int(m) - level)
            if m <= level:
                # On the lattice of that leaf too: the sample at the same place.
                result.put(rows, self.samples.sample(int(m), at << (level - int(m))))
                continue
            on = (at % step == 0).all(axis=1)
            result.put(rows[on], self.at(int(m), at[on] // step))
            off = at[~on]
            if len(off):
                result.put(rows[~on], self.interpolate(int(m), off // step, (off % step) / step))
        return result

    def interpolate(self, level, cells, fraction):
        """Trilinear values in cells of one level, at fractions of them."""
        weights = weights_of(fraction)
        corner, at = numpy.nonzero(weights.T)
        points = cells[at] + CORNERS[corner]
        values = self.at(level, points)
        return blend(values, at, weights[at, corner], len(cells), self.samples.table.channel_grid)


def blend(values, at, weights, count, channel_grid):
    """Weighted sums of intervals; finite when all parts are."""
    order = numpy.argsort(at, kind="stable")
    starts = numpy.flatnonzero(numpy.r_[True, numpy.diff(at[order]) > 0])
    w = weights[order, None]
    ok = values.finite[order]
    low = numpy.where(ok[:, channel_grid], values.low[order], 0.0)
    high = numpy.where(ok[:, channel_grid], values.high[order], 0.0)
    result = Values.none(count, values.low.shape[1], values.finite.shape[1])
    rows = at[order][starts]
    result.low[rows] = numpy.add.reduceat(low * w, starts)
    result.high[rows] = numpy.add.reduceat(high * w, starts)
    result.finite[rows] = numpy.logical_and.reduceat(ok, starts)
    result.broken[rows] = numpy.logical_or.reduceat(values.broken[order], starts)
    return result
