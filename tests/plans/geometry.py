"""A mesh over a lattice: which lattice points lie in it, with which values, and what the nearest mesh point has.

Plain numpy in double. Lengths are in voxels of the lattice at hand. What double can't tell is said, not guessed: a point's state is
"maybe" within kSure of the boundary, and every value is an interval that holds the values of all elements that may own the point.
"""

import dataclasses

import numpy

from plans.meshes import FACES, boundary_faces

SURE = 1e-9  # voxels: nearer to the boundary than that, either answer is right
TIE = 1e-9  # voxels: mesh points that near to the nearest one are as near
MOST_PAIRS = 400_000
OUT, MAYBE, IN = -1, 0, 1


def float_ulp(values):
    """Step of float at the size of these values."""
    with numpy.errstate(over="ignore"):
        return numpy.spacing(numpy.abs(values).astype(numpy.float32)).astype(float)


@dataclasses.dataclass
class Values:
    """Intervals of the channels at some points; for each value grid, whether the value may be finite and may not be."""

    low: numpy.ndarray  # (points, channels)
    high: numpy.ndarray
    finite: numpy.ndarray  # (points, grids) bool
    broken: numpy.ndarray

    @staticmethod
    def none(count, channels, grids):
        return Values(
            numpy.full((count, channels), numpy.inf), numpy.full((count, channels), -numpy.inf),
            numpy.zeros((count, grids), bool), numpy.zeros((count, grids), bool),
        )  # fmt: skip

    def add(self, at, low, high, broken, channel_grid):
        """Joins candidates (several for a point) into the points' intervals."""
        if len(at) == 0:
            return
        order = numpy.argsort(at, kind="stable")
        at = at[order]
        starts = numpy.flatnonzero(numpy.r_[True, at[1:] != at[:-1]])
        points = at[starts]
        broken = broken[order]
        out = broken[:, channel_grid]
        low = numpy.minimum.reduceat(numpy.where(out, numpy.inf, low[order]), starts)
        high = numpy.maximum.reduceat(numpy.where(out, -numpy.inf, high[order]), starts)
        self.low[points] = numpy.minimum(self.low[points], low)
        self.high[points] = numpy.maximum(self.high[points], high)
        self.finite[points] |= numpy.logical_or.reduceat(~broken, starts)
        self.broken[points] |= numpy.logical_or.reduceat(broken, starts)

    def take(self, rows):
        return Values(self.low[rows], self.high[rows], self.finite[rows], self.broken[rows])

    def put(self, rows, other):
        self.low[rows], self.high[rows], self.finite[rows], self.broken[rows] = other.low, other.high, other.finite, other.broken


class FieldTable:
    """All fields of a mesh as channels of elements. A value grid holds three channels of a vector, or one."""

    def __init__(self, mesh):
        self.fields = mesh.fields
        self.channels = sum(f.components for f in mesh.fields)
        grids = [1 if f.components == 3 else f.components for f in mesh.fields]
        self.grids = sum(grids)
        self.field_grids = [slice(sum(grids[:i]), sum(grids[: i + 1])) for i in range(len(grids))]
        self.channel_grid = numpy.concatenate(
            [numpy.arange(f.components) * (f.components != 3) + g.start for f, g in zip(mesh.fields, self.field_grids)]
        )
        self.first = numpy.cumsum([0] + [f.components for f in mesh.fields])
        corner = [
            f.values[mesh.tets] if f.location == "point" else numpy.repeat(f.values[:, None, :], 4, axis=1) for f in mesh.fields
        ]
        corner = numpy.concatenate(corner, axis=2)  # (elements, 4, channels)
        with numpy.errstate(over="ignore"):
            finite = numpy.isfinite(corner.astype(numpy.float32))
        self.broken_corner = numpy.stack(
            [~finite[:, :, self.channel_grid == g].all(axis=2) for g in range(self.grids)], axis=2
        )  # (elements, 4, grids)
        self.broken = self.broken_corner.any(axis=1)
        self.corner = numpy.where(finite, corner, 0.0)
        f32 = self.corner.astype(numpy.float32).astype(float)
        self.lowest, self.highest = f32.min(axis=1), f32.max(axis=1)
        self.rounding = 4 * float_ulp(numpy.abs(self.corner).max(axis=1))


def chunks(counts, most=MOST_PAIRS):
    """Slices of items whose counts add up to about `most`."""
    begin, total = 0, numpy.cumsum(counts)
    while begin < len(counts):
        base = total[begin - 1] if begin else 0
        end = max(begin + 1, int(numpy.searchsorted(total, base + most, "right")))
        yield slice(begin, end)
        begin = end


def repeated(items, counts):
    """Each item as often as its count says, and the numbers 0, 1, ... within each."""
    counts = counts[items]
    starts = numpy.cumsum(counts) - counts
    item = numpy.repeat(items, counts)
    return item, numpy.arange(len(item)) - numpy.repeat(starts, counts)


class PointIndex:
    """Finds which of some integer points lie in boxes."""

    def __init__(self, points):
        self.count = len(points)
        if not self.count:
            return
        self.low, self.high = points.min(axis=0), points.max(axis=0)
        self.shape = self.high - self.low + 1
        self.dense = None
        self.points = points
        self.by_x = numpy.argsort(points[:, 0], kind="stable")
        self.sorted_x = points[self.by_x, 0]
        if self.shape.astype(float).prod() <= 3e7:
            self.dense = numpy.full(self.shape.prod(), -1, numpy.int32)
            self.dense[self.flat(points)] = numpy.arange(self.count)
        else:
            keys = self.flat(points)
            self.order = numpy.argsort(keys)
            self.keys = keys[self.order]

    def flat(self, points):
        local = points - self.low
        return (local[:, 0] * self.shape[1] + local[:, 1]) * self.shape[2] + local[:, 2]

    def pairs(self, low, high):
        """Yields (box, point) positions for inclusive boxes given as doubles."""
        if not self.count or not len(low):
            return
        first = numpy.maximum(numpy.ceil(low), self.low).astype(numpy.int64)
        last = numpy.minimum(numpy.floor(high), self.high).astype(numpy.int64)
        counts = numpy.maximum(last - first + 1, 0).prod(axis=1)
        # Either all lattice points of a box are looked up, or the points that are asked for with an x in its range, whichever are fewer.
        begin = numpy.searchsorted(self.sorted_x, first[:, 0])
        in_range = numpy.searchsorted(self.sorted_x, last[:, 0], "right") - begin
        few = in_range < counts
        yield from self.look_up(numpy.flatnonzero((counts > 0) & ~few), counts, first, last)
        boxes = numpy.flatnonzero((counts > 0) & few & (in_range > 0))
        for part in chunks(in_range[boxes]):
            box, k = repeated(boxes[part], in_range)
            point = self.by_x[begin[box] + k]
            place = self.points[point]
            hit = ((place[:, 1:] >= first[box, 1:]) & (place[:, 1:] <= last[box, 1:])).all(axis=1)
            yield box[hit], point[hit]

    def look_up(self, boxes, counts, first, last):
        for part in chunks(counts[boxes]):
            box, k = repeated(boxes[part], counts)
            size = last[box, 1:] - first[box, 1:] + 1
            place = first[box]
            place[:, 2] += k % size[:, 1]
            k //= size[:, 1]
            place[:, 1] += k % size[:, 0]
            place[:, 0] += k // size[:, 0]
            keys = self.flat(place)
            if self.dense is not None:
                point = self.dense[keys]
            else:
                found = numpy.minimum(numpy.searchsorted(self.keys, keys), self.count - 1)
                point = numpy.where(self.keys[found] == keys, self.order[found], -1)
            hit = point >= 0
            yield box[hit], point[hit]


def nearest_on_segment(p, a, b):
    ab = b - a
    length = numpy.einsum("ij,ij->i", ab, ab)
    t = numpy.clip(numpy.einsum("ij,ij->i", p - a, ab) / numpy.where(length > 0, length, 1), 0, 1)
    return t


def nearest_on_triangle(p, a, b, c):
    """Distance of each point to its triangle, and the barycentric coordinates of the nearest place."""
    ab, ac, ap = b - a, c - a, p - a
    normal = numpy.cross(ab, ac)
    area = numpy.einsum("ij,ij->i", normal, normal)
    safe = numpy.where(area > 0, area, 1)
    wb = numpy.einsum("ij,ij->i", numpy.cross(ap, ac), normal) / safe
    wc = numpy.einsum("ij,ij->i", numpy.cross(ab, ap), normal) / safe
    best = numpy.stack([1 - wb - wc, wb, wc], axis=1)
    distance = numpy.where(
        (best.min(axis=1) >= 0) & (area > 0), numpy.linalg.norm(p - (best[:, :1] * a + best[:, 1:2] * b + best[:, 2:] * c), axis=1), numpy.inf
    )
    corners = (a, b, c)
    for i, j in ((0, 1), (1, 2), (2, 0)):
        t = nearest_on_segment(p, corners[i], corners[j])
        d = numpy.linalg.norm(p - (corners[i] + t[:, None] * (corners[j] - corners[i])), axis=1)
        weights = numpy.zeros_like(best)
        weights[:, i], weights[:, j] = 1 - t, t
        closer = d < distance
        best[closer] = weights[closer]
        distance = numpy.minimum(distance, d)
    return distance, best


class LatticeMesh:
    """The mesh in index space of one level."""

    def __init__(self, mesh, table, origin, spacing, place_bound):
        self.table = table
        self.place_bound = place_bound
        self.nodes = (mesh.points - origin) / spacing
        self.corners = self.nodes[mesh.tets]  # (elements, 4, 3)
        x0 = self.corners[:, 0]
        edges = self.corners[:, 1:] - x0[:, None]
        det = numpy.linalg.det(edges)
        gradients = numpy.linalg.inv(edges).transpose(0, 2, 1)  # rows: gradients of b1, b2, b3
        self.bary = numpy.concatenate([-gradients.sum(axis=1, keepdims=True), gradients], axis=1)
        self.steepness = numpy.linalg.norm(self.bary, axis=2)  # (elements, 4): 1 / height
        extent = self.corners.max(axis=1) - self.corners.min(axis=1)
        rounding = 2.0**-53 * (256 * extent.prod(axis=1) / numpy.abs(det) + 128 * self.steepness.max(axis=1) * (extent.max(axis=1) + 2))
        # Node places are rounded where the mesh lies far from the lattice's origin.
        rounding += 2.0**-51 * (numpy.abs(self.corners).max(axis=(1, 2)) + 1) * self.steepness.max(axis=1)
        self.bary_error = rounding
        gradient = numpy.einsum("eij,eic->ejc", self.bary, table.corner)
        self.gradient = numpy.linalg.norm(gradient, axis=1)  # (elements, channels), a voxel
        self.faces, self.face_owner = boundary_faces(mesh.tets)
        # Which face of its element each one is, as a row of FACES.
        self.face_row = (mesh.tets[self.face_owner][:, FACES] == self.faces[:, None, :]).all(axis=2).argmax(axis=1)
        self.triangles = self.nodes[self.faces]

    def element_candidates(self, points):
        """Yields (element, point, barycentric coordinates, slack) of all pairs within the place bound of the planes.

        Slack: the smallest distance to a face plane, in voxels, beyond what rounding may have done; negative outside.
        """
        margin = self.place_bound + SURE
        for e, p in PointIndex(points).pairs(self.corners.min(axis=1) - margin, self.corners.max(axis=1) + margin):
            d = points[p] - self.corners[e, 0]
            b = numpy.empty((len(e), 4))
            for i in (1, 2, 3):
                g = self.bary[e, i]
                b[:, i] = d[:, 0] * g[:, 0] + d[:, 1] * g[:, 1] + d[:, 2] * g[:, 2]
            b[:, 0] = 1 - b[:, 1] - b[:, 2] - b[:, 3]
            slack = (b / self.steepness[e]).min(axis=1)
            near = slack >= -(self.place_bound + SURE + self.bary_error[e] / self.steepness[e].min(axis=1))
            yield e[near], p[near], b[near], slack[near]

    def states(self, points):
        """IN, MAYBE or OUT for lattice points."""
        points = numpy.asarray(points, numpy.int64)
        state = numpy.full(len(points), OUT)
        for e, p, _, slack in self.element_candidates(points):
            self.mark(state, e, p, slack)
        self.settle(points, state)
        return state

    def mark(self, state, e, p, slack):
        error = self.bary_error[e] / self.steepness[e].min(axis=1)
        maybe = p[slack >= -(SURE + error)]
        state[maybe] = numpy.maximum(state[maybe], MAYBE)
        state[p[slack >= SURE + error]] = IN

    def settle(self, points, state):
        """On a face between elements no element alone is sure; what isn't near the boundary faces is inside."""
        unsure = numpy.flatnonzero(state == MAYBE)
        distance, _ = self.nearest(points[unsure])
        state[unsure[distance > 4 * SURE]] = IN

    def samples(self, points):
        """States and values at lattice points, which outside are those of the nearest mesh point."""
        points = numpy.asarray(points, numpy.int64)
        table, count = self.table, len(points)
        state = numpy.full(count, OUT)
        values = Values.none(count, table.channels, table.grids)
        for e, p, b, slack in self.element_candidates(points):
            self.mark(state, e, p, slack)
            error = self.bary_error[e] / self.steepness[e].min(axis=1)
            f = numpy.einsum("pi,pic->pc", b[:, 1:], table.corner[e, 1:] - table.corner[e, :1]) + table.corner[e, 0]
            allowed = table.rounding[e] + self.gradient[e] * (self.place_bound + error[:, None]) + 1e-14 * numpy.abs(table.corner[e]).max(axis=1)
            low = numpy.clip(f - allowed, table.lowest[e], table.highest[e])
            high = numpy.clip(f + allowed, table.lowest[e], table.highest[e])
            values.add(p, low, high, table.broken[e], table.channel_grid)
        self.settle(points, state)
        unsure = numpy.flatnonzero(state < IN)
        distance, nearest = self.nearest(points[unsure])
        on_edge = (state[unsure] == MAYBE) | (distance <= self.place_bound)
        keep = values.take(unsure)
        nearest.low = numpy.where(on_edge[:, None], numpy.minimum(nearest.low, keep.low), nearest.low)
        nearest.high = numpy.where(on_edge[:, None], numpy.maximum(nearest.high, keep.high), nearest.high)
        nearest.finite |= on_edge[:, None] & keep.finite
        nearest.broken |= on_edge[:, None] & keep.broken
        values.put(unsure, nearest)
        return state, values

    def face_pairs(self, points, reach):
        index = PointIndex(points)
        low, high = self.triangles.min(axis=1) - reach, self.triangles.max(axis=1) + reach
        for t, p in index.pairs(low, high):
            yield t, p

    def nearest(self, points):
        """Distance to the boundary faces and the values of all places there that are as near as the nearest."""
        points = numpy.asarray(points, numpy.int64)
        count = len(points)
        distance = numpy.full(count, numpy.inf)
        values = Values.none(count, self.table.channels, self.table.grids)
        todo = numpy.arange(count)
        reach = 1.75
        while len(todo) and reach < 1e7:
            left = points[todo]
            found = numpy.full(len(todo), numpy.inf)
            kept = []
            for t, p in self.face_pairs(left, reach):
                d, w = nearest_on_triangle(left[p].astype(float), *(self.triangles[t, i] for i in range(3)))
                numpy.minimum.at(found, p, d)
                near = d <= numpy.minimum(found[p] + TIE, reach)
                kept.append((t[near], p[near], d[near], w[near]))
            sure = found <= reach
            if kept:
                t, p, d, w = (numpy.concatenate(x) for x in zip(*kept))
                near = sure[p] & (d <= found[p] + TIE * (1 + found[p]))
                self.add_face_values(values, todo, t[near], p[near], w[near])
            distance[todo[sure]] = found[sure]
            todo = todo[~sure]
            reach *= 3
        return distance, values

    def add_face_values(self, values, rows, t, p, w):
        table = self.table
        owner = self.face_owner[t]
        local = FACES[self.face_row[t]]
        corner = table.corner[owner[:, None], local]
        f = numpy.einsum("pi,pic->pc", w, corner)
        lowest, highest = corner.min(axis=1), corner.max(axis=1)
        allowed = float_ulp(numpy.abs(corner).max(axis=1)) + self.gradient[owner] * 1e-8
        low, high = numpy.clip(f - allowed, lowest, highest), numpy.clip(f + allowed, lowest, highest)
        low, high = low - float_ulp(low), high + float_ulp(high)
        at_place = (table.broken_corner[owner[:, None], local] & (w > 0)[:, :, None]).any(axis=1)
        # An element with a value that isn't finite has none; its face without that node may be said to have one.
        values.add(rows[p], low, high, at_place, table.channel_grid)
        other = numpy.flatnonzero((table.broken[owner] & ~at_place).any(axis=1))
        if len(other):
            values.add(rows[p[other]], low[other], high[other], table.broken[owner[other]], table.channel_grid)
