"""Small random tetrahedral meshes with fields, and the .vtu file of one.

Everything is drawn from the generator that is passed in, so a seed makes the same mesh everywhere.
"""

import base64
import dataclasses

import numpy

# The six tetrahedra of a cube along its main diagonal; corner c is at (c & 1, c >> 1 & 1, c >> 2).
CUBE_TETS = numpy.array([(0, 1, 3, 7), (0, 3, 2, 7), (0, 2, 6, 7), (0, 6, 4, 7), (0, 4, 5, 7), (0, 5, 1, 7)])
FACES = numpy.array([(1, 2, 3), (0, 2, 3), (0, 1, 3), (0, 1, 2)])


@dataclasses.dataclass
class Field:
    name: str
    location: str  # point or cell
    values: numpy.ndarray  # (nodes or elements, components), doubles

    @property
    def components(self):
        return self.values.shape[1]


@dataclasses.dataclass
class Mesh:
    points: numpy.ndarray  # (nodes, 3)
    tets: numpy.ndarray  # (elements, 4)
    fields: list
    features: set  # words for the summary

    def bounds(self):
        used = self.points[numpy.unique(self.tets)]
        return used.min(axis=0), used.max(axis=0)


def signed_volumes(points, tets):
    a, b, c, d = (points[tets[:, i]] for i in range(4))
    return numpy.einsum("ij,ij->i", numpy.cross(b - a, c - a), d - a) / 6


def boundary_faces(tets):
    """Faces of one element only: (faces, 3) nodes and the element of each."""
    faces = tets[:, FACES].reshape(-1, 3)
    _, first, counts = numpy.unique(numpy.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
    single = first[counts == 1]
    return faces[single], single // 4


def box_of_cubes(shape):
    """Unit cubes, each split into six tetrahedra that match across cubes; also the cube of each."""
    shape = numpy.asarray(shape)
    grid = numpy.stack(numpy.meshgrid(*(numpy.arange(n + 1) for n in shape), indexing="ij"), axis=-1)
    cubes = numpy.stack(numpy.meshgrid(*(numpy.arange(n) for n in shape), indexing="ij"), axis=-1).reshape(-1, 3)
    corner = numpy.array([(c & 1, c >> 1 & 1, c >> 2) for c in range(8)])
    strides = numpy.array([(shape[1] + 1) * (shape[2] + 1), shape[2] + 1, 1])
    nodes = ((cubes[:, None, :] + corner) * strides).sum(axis=-1)
    return grid.reshape(-1, 3).astype(float), nodes[:, CUBE_TETS].reshape(-1, 4), numpy.repeat(cubes, 6, axis=0)


def main_part(rng, features):
    """A box of cubes, jittered, graded and with cells removed."""
    shape = rng.integers(2, 8, 3)
    if shape.prod() > 480:
        shape = numpy.minimum(shape, 6)
    points, tets, cubes = box_of_cubes(shape)
    if rng.random() < 0.35:
        hole = rng.uniform(0, shape, 3)
        far = numpy.linalg.norm(cubes + 0.5 - hole, axis=1) > rng.uniform(0.8, 0.45 * shape.max() + 0.6)
        if far.sum() >= 24:
            tets = tets[far]
            features.add("cells removed")
    if rng.random() < 0.15:
        keep = rng.random(len(tets)) > 0.3
        if keep.sum() >= 12:
            tets = tets[keep]
            features.add("ragged")
    if rng.random() < 0.6:
        points = points + rng.uniform(-0.17, 0.17, points.shape)
        features.add("jittered")
    if rng.random() < 0.45:
        for axis in range(3):
            if rng.random() < 0.6:
                points[:, axis] = shape[axis] * (numpy.clip(points[:, axis] / shape[axis] + 0.1, 0, None) / 1.1) ** rng.uniform(1.5, 4)
        features.add("graded")
    return points, tets


def append(points, tets, new_points, new_tets):
    return numpy.concatenate([points, new_points]), numpy.concatenate([tets, new_tets + len(points)])


def add_spikes(rng, points, tets):
    """Needles on boundary faces: on the whole face, or on a small triangle of it (which leaves hanging nodes)."""
    faces, owners = boundary_faces(tets)
    for index in rng.choice(len(faces), min(len(faces), int(rng.integers(1, 4))), replace=False):
        corners = points[faces[index]]
        inside = points[tets[owners[index]]].mean(axis=0)
        middle = corners.mean(axis=0)
        normal = numpy.cross(corners[1] - corners[0], corners[2] - corners[0])
        area = numpy.linalg.norm(normal)
        if not area > 0:
            continue
        normal = normal / area * (1 if normal @ (middle - inside) > 0 else -1)
        tip = middle + normal * numpy.sqrt(area) * rng.uniform(0.2, 3)
        if rng.random() < 0.5:
            new = numpy.array([list(faces[index]) + [len(points)]])
            points, tets = numpy.concatenate([points, tip[None]]), numpy.concatenate([tets, new])
        else:
            base = middle + (corners - middle) * 10.0 ** rng.uniform(-3, -0.5)
            points, tets = append(points, tets, numpy.concatenate([base, tip[None]]), numpy.array([[0, 1, 2, 3]]))
    return points, tets


def add_box(rng, points, tets, thickness):
    """A second part beside the first: a box, or a plate thinner than a cell."""
    part, part_tets, _ = box_of_cubes(rng.integers(1, 4, 3))
    axis = int(rng.integers(3))
    if thickness is not None:
        part[:, axis] *= thickness
    low, high = points.min(axis=0), points.max(axis=0)
    side = int(rng.integers(3))
    gap = rng.choice([0.0, 0.05, 1.5])
    part = part - part.min(axis=0) + low + rng.uniform(0, 0.5) * (high - low)
    part[:, side] += high[side] + gap - part[:, side].min()
    return append(points, tets, part, part_tets)


def rotation(rng):
    q, _ = numpy.linalg.qr(rng.normal(size=(3, 3)))
    return q if numpy.linalg.det(q) > 0 else -q


def field_values(rng, kind, unit):
    """Values at places in [0, 1]^3-like coordinates."""
    a = rng.normal(size=3)
    if kind == "linear":
        return unit @ a
    if kind == "bump":
        # Varies in a small part of the mesh only, so that plans by error have several levels.
        middle = unit[rng.integers(len(unit))]
        return unit @ a * 0.05 + numpy.exp(-(((unit - middle) ** 2).sum(axis=1)) / rng.uniform(0.05, 0.25) ** 2)
    w, phase = rng.normal(size=(3, 3)) * rng.uniform(0.5, 4), rng.uniform(0, 6.28, 3)
    return numpy.sin(unit @ w.T + phase).sum(axis=1) + unit @ a


def make_fields(rng, unit, centroids, features):
    fields = []
    kind = str(rng.choice(["linear", "smooth", "offset", "bump"], p=[0.2, 0.2, 0.3, 0.3]))
    values = field_values(rng, "smooth" if kind == "offset" else kind, unit)[:, None]
    if kind == "offset":
        values = 300 + values * rng.choice([1.0, 0.1])
    elif rng.random() < 0.3:
        values = values * 10.0 ** rng.integers(-7, 7)
        features.add("values scaled")
    features.add(kind + " field")
    fields.append(Field("f", "point", values))
    if rng.random() < 0.35:
        fields.append(Field("v", "point", 300 * (rng.random() < 0.5) + numpy.stack([field_values(rng, "smooth", unit) for _ in range(3)], axis=1)))
        features.add("vector field")
    if rng.random() < 0.1:
        fields.append(Field("w", "point", numpy.stack([field_values(rng, "smooth", unit) for _ in range(2)], axis=1)))
        features.add("two components")
    if rng.random() < 0.25:
        fields.append(Field("c", "cell", 5 + field_values(rng, "smooth", centroids)[:, None]))
        features.add("cell field")
    if rng.random() < 0.15:
        bad = fields[int(rng.integers(len(fields)))].values
        for _ in range(int(rng.integers(1, 4))):
            bad[rng.integers(len(bad)), rng.integers(bad.shape[1])] = rng.choice([numpy.nan, 1e308, -numpy.inf])
        features.add("values not finite")
    return fields


def make_mesh(rng):
    features = set()
    points, tets = main_part(rng, features)
    if rng.random() < 0.3:
        points, tets = add_spikes(rng, points, tets)
        features.add("spikes")
    draw = rng.random()
    if draw < 0.15:
        points, tets = add_box(rng, points, tets, 10.0 ** rng.uniform(-3, -0.5))
        features.add("thin plate")
    elif draw < 0.3:
        points, tets = add_box(rng, points, tets, None)
        features.add("two parts")
    if rng.random() < 0.15:
        points = points * numpy.where(numpy.arange(3) == rng.integers(3), 0.03, 1.0)
        features.add("squeezed")
    elif rng.random() < 0.5:
        points = points * numpy.where(numpy.arange(3) == rng.integers(3), 1.0, rng.uniform(0.1, 0.6, 3))
        features.add("elongated")
    longest = (points.max(axis=0) - points.min(axis=0)).max()
    unit = (points - points.min(axis=0)) / longest
    # Elements so thin that their orientation isn't sure in double have no part in a test that computes in double.
    tets = tets[numpy.abs(signed_volumes(unit, tets)) > 1e-13]
    fields = make_fields(rng, unit, unit[tets].mean(axis=1), features)
    places = unit - 0.5
    if rng.random() < 0.5:
        places = places @ rotation(rng).T
        features.add("rotated")
    scale = 10.0 ** rng.integers(-4, 5) if rng.random() < 0.4 else float(rng.choice([1.0, 7.0]))
    if scale not in (1, 7):
        features.add("scaled")
    places = places * scale
    if rng.random() < 0.4:
        places = places + rng.normal(size=3) * scale * rng.choice([3.0, 1e3, 1e5])
        features.add("far from the origin")
    elif rng.random() < 0.3:
        places = places - places.min(axis=0)
    if rng.random() < 0.2:
        flip = rng.random(len(tets)) < 0.5
        tets[flip] = tets[flip][:, [1, 0, 2, 3]]
        features.add("inverted elements")
    return Mesh(places, tets, fields, features)


def data_array(name, values, components=1):
    kind = {"f8": "Float64", "i8": "Int64", "u1": "UInt8"}[values.dtype.str[1:]]
    raw = numpy.ascontiguousarray(values).tobytes()
    text = base64.b64encode(numpy.uint64(len(raw)).tobytes() + raw).decode()
    return f'<DataArray type="{kind}" Name="{name}" NumberOfComponents="{components}" format="binary">{text}</DataArray>\n'


def write_vtu(mesh, path):
    """Binary inline arrays: doubles come back exactly, NaN included."""

    def arrays(location):
        return "".join(data_array(f.name, f.values.astype("<f8"), f.components) for f in mesh.fields if f.location == location)

    count = len(mesh.tets)
    path.write_text(
        '<?xml version="1.0"?>\n<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian" header_type="UInt64">\n'
        f'<UnstructuredGrid><Piece NumberOfPoints="{len(mesh.points)}" NumberOfCells="{count}">\n'
        f"<PointData>{arrays('point')}</PointData>\n<CellData>{arrays('cell')}</CellData>\n"
        f"<Points>{data_array('Points', mesh.points.astype('<f8'), 3)}</Points>\n<Cells>"
        + data_array("connectivity", mesh.tets.astype("<i8"))
        + data_array("offsets", 4 * numpy.arange(1, count + 1, dtype="<i8"))
        + data_array("types", numpy.full(count, 10, "u1"))
        + "</Cells></Piece></UnstructuredGrid></VTKFile>\n"
    )
