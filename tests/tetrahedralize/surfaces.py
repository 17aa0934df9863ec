#!/usr/bin/env python3
"""Closed surfaces and scattered points, writers for every format that tessera-tetrahedralize reads, and BAD_SURFACES: what it must refuse.

usage: surfaces.py [--write FOLDER]

As a program it checks itself: good surfaces are closed, look outwards and don't cross themselves; bad ones have the fault that their name
tells, so far as triangles alone show it. --write leaves all files in a folder, for trying them by hand.
"""

import argparse
import collections
import itertools
import math
import pathlib
import struct
import tempfile
from typing import NamedTuple

import numpy as np
from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray
from vtkmodules.vtkCommonCore import vtkPoints
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter


class Surface(NamedTuple):
    points: np.ndarray  # N x 3, float64
    triangles: np.ndarray  # M x 3, counterclockwise from outside
    fields: dict = {}  # name -> N values, or N x components


def geodesic(frequency):
    """An icosahedron with each edge in `frequency` parts, on the unit sphere: 20 frequency^2 triangles."""
    golden = (1 + math.sqrt(5)) / 2
    corners = [(-1, golden, 0), (1, golden, 0), (-1, -golden, 0), (1, -golden, 0)]
    corners = np.array(corners + [(z, x, y) for x, y, z in corners] + [(y, z, x) for x, y, z in corners], dtype=float)
    near = np.linalg.norm(corners[:, None] - corners[None], axis=2) < 2.1
    faces = [f for f in itertools.combinations(range(12), 3) if near[f[0], f[1]] and near[f[1], f[2]] and near[f[0], f[2]]]
    faces = [f if np.linalg.det(corners[list(f)]) > 0 else (f[0], f[2], f[1]) for f in faces]
    places = [(i, j) for i in range(frequency + 1) for j in range(frequency + 1 - i)]
    number = {place: n for n, place in enumerate(places)}
    cells = [(number[i, j], number[i + 1, j], number[i, j + 1]) for i, j in places if i + j < frequency]
    cells += [(number[i + 1, j], number[i + 1, j + 1], number[i, j + 1]) for i, j in places if i + j < frequency - 1]
    weights = np.array([(frequency - i - j, i, j) for i, j in places])
    # Points that faces share are found by their whole-number weights at the corners.
    keys = np.zeros((20 * len(places), 12), dtype=np.int32)
    for f, face in enumerate(faces):
        keys[f * len(places) : (f + 1) * len(places), list(face)] = weights
    keys, index = np.unique(keys, axis=0, return_inverse=True)
    points = keys @ corners
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    cells = np.array(cells)
    triangles = np.concatenate([index.reshape(-1)[cells + f * len(places)] for f in range(20)])
    return points, triangles


def sphere(level=3, radius=1.0, centre=(0, 0, 0)):
    points, triangles = geodesic(2**level)
    return Surface(points * radius + np.array(centre, dtype=float), triangles)


def torus(around=48, across=16, ring=1.0, tube=0.35):
    """@param tube the tube's radius, or a function that gives it at an angle around the ring"""
    i, j = (a.reshape(-1) for a in np.meshgrid(np.arange(around), np.arange(across), indexing="ij"))
    u, v = 2 * np.pi * i / around, 2 * np.pi * j / across
    radius = tube(u) if callable(tube) else tube
    points = np.stack([(ring + radius * np.cos(v)) * np.cos(u), (ring + radius * np.cos(v)) * np.sin(u), radius * np.sin(v)], axis=1)
    at = lambda di, dj: (i + di) % around * across + (j + dj) % across  # noqa: E731
    quads = np.stack([at(0, 0), at(1, 0), at(1, 1), at(0, 1)], axis=1)
    return Surface(points, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]))


def box_quads(low=(0, 0, 0), high=(1, 1, 1), divisions=1):
    """Points and squares of a box, counterclockwise from outside."""
    quads = []
    for axis, side, i, j in itertools.product(range(3), (0, 1), range(divisions), range(divisions)):
        square = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)]
        for along, across in square if side else reversed(square):
            place = [0, 0, 0]
            place[axis], place[(axis + 1) % 3], place[(axis + 2) % 3] = side * divisions, along, across
            quads.append(place)
    places, index = np.unique(quads, axis=0, return_inverse=True)
    low, high = np.array(low, dtype=float), np.array(high, dtype=float)
    return low + places * ((high - low) / divisions), index.reshape(-1, 4)


def box(low=(0, 0, 0), high=(1, 1, 1), divisions=1):
    points, quads = box_quads(low, high, divisions)
    return Surface(points, quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3))


def turned_over(surface):
    return surface._replace(triangles=surface.triangles[:, ::-1])


def joined(*surfaces):
    """Surfaces side by side; without fields."""
    begins = np.cumsum([0] + [len(s.points) for s in surfaces])
    return Surface(np.concatenate([s.points for s in surfaces]), np.concatenate([s.triangles + b for s, b in zip(surfaces, begins)]))


def two_boxes():
    return joined(box(), box((2, 0.25, 0), (3, 0.75, 2)))


def nested_spheres(inner="inwards", level=3, inner_radius=0.5):
    """@param inner where the triangles of the inner one look: "inwards" (a cavity) or "outwards" """
    within = sphere(level, inner_radius)
    return joined(sphere(level), turned_over(within) if inner == "inwards" else within)


def noisy_scan(triangles=100_000, noise=0.3, seed=1):
    """A bumpy body as a scanner sees it: points off by a share of their distance along the rays, and a little across them. Each ray from the
    middle meets the surface once, so it doesn't cross itself."""
    frequency = max(1, round(math.sqrt(triangles / 20)))
    points, cells = geodesic(frequency)
    rng = np.random.default_rng(seed)
    distance = 1.1 / frequency
    rays = points + rng.uniform(-0.1, 0.1, points.shape) * distance
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    x, y, z = rays.T
    bumps = 1 + 0.2 * np.sin(3 * x + 1) * np.cos(4 * y) + 0.08 * np.sin(9 * z + 2 * x) + 0.03 * np.cos(25 * x * y)
    radius = bumps + rng.normal(0, noise * distance * 0.3, len(rays))
    return Surface(rays * radius[:, None], cells)


def linear(points, gradient=(0.5, -0.25, 0.125), offset=3.0):
    return offset + points @ np.array(gradient)


def with_fields(surface):
    """With a linear field and a vector field that isn't."""
    x, y, z = surface.points.T
    return surface._replace(fields={"heat": linear(surface.points), "flow": np.stack([np.sin(3 * x), y * z, np.cos(x + y)], axis=1)})


def single_precision(surface):
    """At places that every format holds exactly."""
    return surface._replace(points=surface.points.astype(np.float32).astype(float))


def volume(surface):
    """What a closed surface bounds, by the divergence theorem."""
    corners = (surface.points - surface.points.mean(axis=0))[surface.triangles]
    return math.fsum(np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))) / 6


def shells(triangles, count):
    """The connected part that each triangle belongs to."""
    part = np.arange(count)
    while True:
        least = part.copy()
        np.minimum.at(least, triangles, part[triangles].min(axis=1)[:, None])
        least = least[least]
        if (least == part).all():
            return part[triangles[:, 0]]
        part = least


def edge_faults(triangles):
    uses, runs = collections.Counter(), collections.Counter()
    for t in triangles.tolist():
        for a, b in zip(t, t[1:] + t[:1]):
            uses[min(a, b), max(a, b)] += 1
            runs[a, b] += 1
    found = {"open"} if 1 in uses.values() else set()
    if max(uses.values()) > 2:
        found.add("more than two triangles")
    if any(n > 1 and uses[min(e), max(e)] == 2 for e, n in runs.items()):
        found.add("turned")
    return found


@np.errstate(all="ignore")
def crosses(points, triangles):
    """Whether an edge meets a triangle that has none of its two corners; lengths are about 1."""
    edges = np.unique(np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1), axis=0)
    a, b, c = (points[triangles[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    for p, q in edges:
        apart = ~((triangles == p) | (triangles == q)).any(axis=1)
        side = [np.einsum("ij,ij->i", points[e] - a, normal) for e in (p, q)]
        flat = (np.abs(side[0]) < 1e-12) & (np.abs(side[1]) < 1e-12)
        at = side[0] / (side[0] - side[1])  # nan or infinite beside the plane
        # Of an edge within the triangle's plane its middle is looked at, and places close to its ends.
        for share in (np.where(flat, s, at) for s in (1e-6, 0.5, 1 - 1e-6)):
            place = points[p] + share[:, None] * (points[q] - points[p])
            weights = [np.einsum("ij,ij->i", np.cross(v - u, place - u), normal) for u, v in ((a, b), (b, c), (c, a))]
            if (apart & (share >= 0) & (share <= 1) & (np.min(weights, axis=0) > 1e-12)).any():
                return True
    return False


def faults(surface):
    """What is wrong with a surface of a few hundred triangles, in the words of EXPECTED."""
    points, index = np.unique(surface.points, axis=0, return_inverse=True)
    triangles = index.reshape(-1)[surface.triangles]
    corners = points[triangles]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    found = edge_faults(triangles)
    if (areas < 1e-14).any():
        found.add("degenerate")
    if len(np.unique(np.sort(triangles, axis=1), axis=0)) < len(triangles):
        found.add("twice")
    if crosses(points, triangles):
        found.add("cross")
    if not found:
        part = shells(triangles, len(points))
        volumes = [volume(Surface(points, triangles[part == p])) for p in np.unique(part)]
        if max(volumes, key=abs) < 0:
            found.add("inwards")
    return found


def columns(fields, separator="_"):
    """Fields as (name, one value a point)."""
    for name, values in fields.items():
        values = np.asarray(values)
        if values.ndim == 1:
            yield name, values
        else:
            yield from ((f"{name}{separator}{c}", values[:, c]) for c in range(values.shape[1]))


def text_rows(*arrays, first=None):
    """A row of text for each point; numbers in full."""
    table = np.column_stack(arrays).tolist()
    return "".join(("" if first is None else f"{i + first} ") + " ".join(map(repr, row)) + "\n" for i, row in enumerate(table))


def face_rows(faces, first=0, head=""):
    return "".join(head + f"{len(f)} {' '.join(str(n + first) for n in f)}\n" for f in np.asarray(faces).tolist())


def write_stl(path, surface, binary=True, head=b"binary"):
    """Of the corners what single precision holds."""
    corners = surface.points[surface.triangles].astype(np.float32)
    if binary:
        records = np.zeros(len(corners), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
        records["corners"] = corners
        path.write_bytes(head.ljust(80) + struct.pack("<I", len(corners)) + records.tobytes())
        return
    text = "solid surface\n"
    for triangle in corners.tolist():
        lines = "".join("vertex " + " ".join(map(repr, corner)) + "\n" for corner in triangle)
        text += f"facet normal 0 0 0\nouter loop\n{lines}endloop\nendfacet\n"
    path.write_text(text + "endsolid surface\n")


def write_ply(path, surface, binary=True, order="<"):
    """@param order "<" or ">", the order of bytes"""
    names, values = zip(*[*zip("xyz", surface.points.T), *columns(surface.fields)])
    properties = "".join(f"property double {name}\n" for name in names)
    faces = np.asarray(surface.triangles)
    kind = {"<": "binary_little_endian", ">": "binary_big_endian"}[order] if binary else "ascii"
    head = f"ply\nformat {kind} 1.0\nelement vertex {len(surface.points)}\n{properties}"
    head += f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    if not binary:
        path.write_text(head + text_rows(*values) + face_rows(faces))
        return
    records = np.zeros(len(faces), dtype=[("count", "u1"), ("corners", order + "i4", faces.shape[1])])
    records["count"], records["corners"] = faces.shape[1], faces
    path.write_bytes(head.encode() + np.column_stack(values).astype(order + "f8").tobytes() + records.tobytes())


def write_obj(path, surface, corner="{0}"):
    """@param corner how a face names its corner: {0} counts from the first point, {1} back from the last, and there's one normal and texture"""
    count = len(surface.points)
    text = "".join("v " + " ".join(map(repr, p)) + "\n" for p in surface.points.tolist()) + "vt 0 0\nvn 0 0 1\n"
    faces = np.asarray(surface.triangles).tolist()
    path.write_text(text + "".join("f " + " ".join(corner.format(n + 1, n - count) for n in f) + "\n" for f in faces))


def write_off(path, surface):
    path.write_text(f"OFF\n{len(surface.points)} {len(surface.triangles)} 0\n" + text_rows(surface.points) + face_rows(surface.triangles))


def node_text(surface, first):
    values = [v for _, v in columns(surface.fields)]
    return f"{len(surface.points)} 3 {len(values)} 0\n" + text_rows(surface.points, *values, first=first)


def write_node(path, surface, first=1):
    """TetGen's points; the fields become attributes without names."""
    path.write_text(node_text(surface, first))


def write_poly(path, surface, holes=(), regions=(), first=1):
    """@param regions (x, y, z, number, largest volume)"""
    text = "# points\n" + node_text(surface, first) + f"# facets\n{len(surface.triangles)} 0\n" + face_rows(surface.triangles, first, "1\n")
    for rows in (holes, regions):
        text += f"{len(rows)}\n" + (text_rows(np.array(rows, dtype=float), first=1) if len(rows) else "")
    path.write_text(text)


def write_vtp(path, surface, cells="polys"):
    """@param cells "polys", or "lines" """
    data, points, array = vtkPolyData(), vtkPoints(), vtkCellArray()
    points.SetDataTypeToDouble()
    points.SetData(numpy_to_vtk(np.ascontiguousarray(surface.points), deep=True))
    faces = np.asarray(surface.triangles)
    offsets = np.arange(0, faces.size + 1, faces.shape[1])
    array.SetData(*(numpy_to_vtkIdTypeArray(np.ascontiguousarray(a, dtype=np.int64), deep=True) for a in (offsets, faces.reshape(-1))))
    data.SetPoints(points)
    (data.SetPolys if cells == "polys" else data.SetLines)(array)
    for name, values in surface.fields.items():
        values = numpy_to_vtk(np.ascontiguousarray(values), deep=True)
        values.SetName(name)
        data.GetPointData().AddArray(values)
    writer = vtkXMLPolyDataWriter()
    writer.SetFileName(str(path))
    writer.SetInputData(data)
    writer.Write()


def write_csv(path, surface, style="comma"):
    """Points without triangles. @param style "comma", "semicolon", "tab", "bare" (without a line of names), "paraview" """
    separator = {"semicolon": ";", "tab": "\t"}.get(style, ",")
    fields = list(columns(surface.fields, ":" if style == "paraview" else "_"))
    values = [surface.points, *(v for _, v in fields)]
    names = ["x", "y", "z", *(n for n, _ in fields)]
    if style == "paraview":  # the fields come first, and names are quoted
        values = [*values[1:], surface.points]
        names = [f'"{name}"' for name in [*(n for n, _ in fields), "Points:0", "Points:1", "Points:2"]]
    rows = "".join(separator.join(map(repr, row)) + "\n" for row in np.column_stack(values).tolist())
    path.write_text(("" if style == "bare" else separator.join(names) + "\n") + rows)


WRITERS = {".stl": write_stl, ".ply": write_ply, ".obj": write_obj, ".off": write_off,
           ".poly": write_poly, ".vtp": write_vtp, ".node": write_node, ".csv": write_csv}  # fmt: skip


def write(path, surface, **options):
    """In the format that the file's ending tells."""
    path = pathlib.Path(path)
    WRITERS[path.suffix](path, surface, **options)
    return path


def without(surface, *triangles):
    return surface._replace(triangles=np.delete(surface.triangles, triangles, axis=0))


def plus(surface, triangles, points=()):
    """With further triangles, and points behind those that are there."""
    points = np.concatenate([surface.points, np.array(points, dtype=float).reshape(-1, 3)])
    return surface._replace(points=points, triangles=np.concatenate([surface.triangles, np.array(triangles)]))


def turned_some(surface, triangles):
    turned = surface.triangles.copy()
    turned[triangles] = turned[triangles, ::-1]
    return surface._replace(triangles=turned)


def moved(surface, place, to):
    """With the point at a place elsewhere."""
    points = surface.points.copy()
    points[np.linalg.norm(points - place, axis=1).argmin()] = to
    return surface._replace(points=points)


def moebius_strip(length=24):
    points = []
    for i in range(length):
        angle = 2 * math.pi * i / length
        for side in (-0.3, 0.3):
            radius = 1 + side * math.cos(angle / 2)
            points.append((radius * math.cos(angle), radius * math.sin(angle), side * math.sin(angle / 2)))
    at = lambda i, side: 2 * i + side if i < length else 1 - side  # noqa: E731
    triangles = [t for i in range(length) for t in ((at(i, 0), at(i + 1, 0), at(i + 1, 1)), (at(i, 0), at(i + 1, 1), at(i, 1)))]
    return Surface(np.array(points), np.array(triangles))


def klein_bottle(around=24, across=12):
    """Without an edge of one or three triangles; it has one side, and passes through itself."""
    points = []
    for i, j in itertools.product(range(around), range(across)):
        u, v = 2 * math.pi * i / around, 2 * math.pi * (j + 0.5) / across
        radius = 2 + math.cos(u / 2) * math.sin(v) - math.sin(u / 2) * math.sin(2 * v)
        points.append((radius * math.cos(u), radius * math.sin(u), math.sin(u / 2) * math.sin(v) + math.cos(u / 2) * math.sin(2 * v)))
    at = lambda i, j: i * across + j % across if i < around else across - 1 - j % across  # noqa: E731
    places = list(itertools.product(range(around), range(across)))
    triangles = [t for i, j in places for t in ((at(i, j), at(i + 1, j), at(i + 1, j + 1)), (at(i, j), at(i + 1, j + 1), at(i, j + 1)))]
    return Surface(np.array(points), np.array(triangles))


def fin():
    return plus(box(), [(*box().triangles[0][:2], 8)], [(-0.7, -0.6, 0.5)])


def doubled_wall():
    """A cavity that reaches the top of a box, so that a wall of no thickness is left there."""
    return joined(box((0, 0, 0), (2, 1, 1), 2), turned_over(box((0.5, 0.25, 0.5), (1.5, 0.75, 1))))


def cubes_at_an_edge():
    """Two cubes that have two points, and the edge between them, in common."""
    both = joined(box(), box((1, 1, 0), (2, 2, 1)))
    points, index = np.unique(both.points, axis=0, return_inverse=True)
    return Surface(points, index.reshape(-1)[both.triangles])


def split_edge(surface, fill):
    """A point in the middle of an edge, for one of its two triangles only. @param fill close the slit by a triangle without area"""
    a, b, c = surface.triangles[0].tolist()
    new = len(surface.points)
    triangles = [(a, new, c), (new, b, c)] + ([(a, b, new)] if fill else [])
    return plus(without(surface, 0), triangles, [(surface.points[a] + surface.points[b]) / 2])


def needle():
    """A sphere with the corners of one triangle drawn to one place, which leaves three others without area."""
    surface = sphere(1)
    points = surface.points.copy()
    points[surface.triangles[0]] = points[surface.triangles[0]].mean(axis=0)
    return surface._replace(points=points)


def unmerged(surface):
    return Surface(surface.points[surface.triangles].reshape(-1, 3), np.arange(surface.triangles.size).reshape(-1, 3))


SHAPES = {  # name of the file -> what it holds, and how it is written
    "open_box.stl": (lambda: without(box(), 3), {"binary": False}),
    "two_holes.ply": (lambda: without(sphere(2), 0, 150), {}),
    "single_triangle.off": (lambda: Surface(np.eye(3), np.array([[0, 1, 2]])), {}),
    "moebius_strip.obj": (moebius_strip, {}),
    "unmerged.obj": (lambda: unmerged(box()), {}),
    "hanging_vertex.off": (lambda: split_edge(box(), False), {}),
    "fin.off": (fin, {}),
    "cubes_at_an_edge.ply": (cubes_at_an_edge, {"binary": False}),
    "crossing_spheres.stl": (lambda: joined(sphere(2), sphere(2, 0.8, (0.9, 0.13, 0.21))), {}),
    "crossing_boxes.poly": (lambda: joined(box(), box((0.5, 0.25, 0.25), (1.5, 0.75, 0.75))), {}),
    "self_crossing_torus.obj": (lambda: torus(24, 13, 1, lambda u: 0.75 + 0.45 * np.cos(u) + 0.1 * np.sin(u)), {"corner": "{0}//1"}),
    "spike_through_a_wall.vtp": (lambda: moved(box(divisions=4), (0.5, 0.5, 1), (0.55, 0.57, -0.4)), {}),
    "folded_flap.ply": (lambda: moved(box(divisions=4), (0.25, 0.5, 1), (0.7, 0.6, 1)), {"binary": False}),
    "doubled_wall.off": (doubled_wall, {}),
    "flush_boxes.stl": (lambda: joined(box(), box((0.25, 0.25, 1), (1.5, 1.5, 2))), {"binary": False}),
    "klein_bottle.off": (klein_bottle, {}),
    "duplicate.obj": (lambda: plus(box(), box().triangles[5:6]), {}),
    "duplicate_turned_over.off": (lambda: plus(box(), box().triangles[5:6, ::-1]), {}),
    "collinear.ply": (lambda: split_edge(box(), True), {}),
    "corner_twice.off": (lambda: plus(box(), [(0, 0, 1)]), {}),
    "needle.poly": (needle, {}),
    "all_at_one_place.stl": (lambda: Surface(np.ones((8, 3)), box().triangles), {}),
    "one_turned.stl": (lambda: turned_some(sphere(1), [7]), {}),
    "half_turned.obj": (lambda: turned_some(sphere(1), np.arange(0, 80, 2)), {}),
    "inside_out.ply": (lambda: turned_over(sphere(2)), {}),
    "hole_outside.stl": (box, {}),
    "region_outside.stl": (box, {}),
    "no_size_field.ply": (box, {}),
    "no_field.ply": (box, {}),
    "size_field_zero.ply": (lambda: box()._replace(fields={"h": np.zeros(8)}), {}),
    "size_field_negative.vtp": (lambda: box()._replace(fields={"h": box().points[:, 0] - 0.5}), {}),
    "size_field_nan.ply": (lambda: box()._replace(fields={"h": np.where(box().points[:, 0] > 0, np.nan, 0.1)}), {}),
    "lines_only.vtp": (box, {"cells": "lines"}),
    "three_points.csv": (lambda: Surface(np.eye(3), None), {}),
    "plane.csv": (lambda: Surface(np.random.default_rng(1).random((50, 2)) @ np.array([[1, 0, 0.5], [0, 1, 0.25]]), None), {}),
    "flat.node": (lambda: Surface(np.random.default_rng(2).random((50, 3)) * (1, 1, 0), None), {}),
    "line.csv": (lambda: Surface(np.outer(np.arange(20), (1, 2, 3)), None), {}),
    "one_place.csv": (lambda: Surface(np.full((30, 3), 0.5), None), {}),
    "nan_place.csv": (lambda: moved(Surface(np.random.default_rng(3).random((30, 3)), None), (0.5, 0.5, 0.5), (0.5, math.nan, 0.5)), {}),
    "nan_place.off": (lambda: moved(box(), (0, 0, 0), (0, math.nan, 0)), {}),
    "nan_place.stl": (lambda: moved(box(), (0, 0, 0), (0, math.nan, 0)), {}),
    "infinite_place.ply": (lambda: moved(box(), (1, 1, 1), (math.inf, 1, 1)), {}),
    "huge_places.off": (lambda: box()._replace(points=(box().points - 0.5) * 1.7e308), {}),
    "huge_places.csv": (lambda: Surface((np.random.default_rng(4).random((30, 3)) - 0.5) * 3.4e308, None), {}),
    "index_99.off": (lambda: plus(without(box(), 4), [(0, 1, 99)]), {}),
    "index_99.obj": (lambda: plus(without(box(), 4), [(0, 1, 98)]), {}),
    "index_99.ply": (lambda: plus(without(box(), 4), [(0, 1, 99)]), {}),
    "index_99.poly": (lambda: plus(without(box(), 4), [(0, 1, 98)]), {}),
    "index_0.obj": (lambda: plus(without(box(), 4), [(0, 1, -1)]), {}),
    "negative_index.off": (lambda: plus(without(box(), 4), [(0, 1, -7)]), {}),
}  # fmt: skip

POINTS = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n"
CSV_ROWS = "0,0,0,1\n1,0,0,2\n0,1,0,3\n0,0,1,4\n1,1,1,5\n"
CONTENTS = {  # name of the file -> bytes, or text
    "empty.stl": "",
    "empty.ply": "",
    "empty.off": "",
    "empty.obj": "",
    "empty.csv": "",
    "empty.poly": "",
    "empty.vtp": "",
    "header_only.off": "OFF\n",
    "header_only.ply": "ply\nformat ascii 1.0\nelement vertex 8\nproperty float x\nproperty float y\nproperty float z\nend_header\n",
    "header_only.csv": "x,y,z,heat\n",
    "no_end_of_header.ply": "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\n",
    "unknown_type.ply": f"ply\nformat ascii 1.0\nelement vertex 4\nproperty quad x\nproperty quad y\nproperty quad z\nend_header\n{POINTS}",
    "huge_count.ply": "ply\nformat binary_little_endian 1.0\nelement vertex 4000000000000000000\n"
    "property double x\nproperty double y\nproperty double z\nelement face 4\nproperty list uchar int vertex_indices\nend_header\n" + "\0" * 500,
    "huge_count.off": f"OFF\n2000000000 2000000000 0\n{POINTS}",
    "negative_count.off": f"OFF\n-4 4 0\n{POINTS}",
    "lying_count.stl": b"binary".ljust(80) + struct.pack("<I", 1_000_000) + bytes(12 * 50),
    "garbage.stl": bytes((i * 2654435761 >> 7) & 255 for i in range(5000)),
    "other_xml.vtp": "<?xml version='1.0'?><html><body/></html>",
    "words.csv": "x,y,z,heat\n" + "here,there,yonder,warm\n" * 6,
    "short_row.csv": "x,y,z,heat\n" + CSV_ROWS + "0.5,0.5\n" + CSV_ROWS,
    "word_among_numbers.csv": "x,y,z,heat\n" + CSV_ROWS + "0.5,0.5,warm,3\n",
    "wrong_count.node": "10 3 0 0\n" + "".join(f"{i + 1} {line}\n" for i, line in enumerate(POINTS.splitlines())),
    "two_corner_facet.poly": "4 3 0 0\n" + "".join(f"{i + 1} {line}\n" for i, line in enumerate(POINTS.splitlines()))
    + "4 0\n1\n3 1 3 2\n1\n3 1 2 4\n1\n3 1 4 3\n1\n2 2 3\n0\n0\n",
    "garbage.xyz": "1 2 3\n4 5 6\n7 8 10\n1 0 0\n",
    "no_ending": "1 2 3\n",
}  # fmt: skip

CUT = {"cut_off_binary.stl": ({}, 0.7), "cut_off_ascii.stl": ({"binary": False}, 0.63), "cut_off.ply": ({}, 0.8),
       "cut_off_text.ply": ({"binary": False}, 0.5), "cut_off.off": ({}, 0.6), "cut_off.poly": ({}, 0.6), "cut_off.vtp": ({}, 0.5)}  # fmt: skip

ARGUMENTS = {
    "hole_outside.stl": ["--hole", "5,5,5"],
    "region_outside.stl": ["--region", "5,5,5"],
    "no_size_field.ply": ["--size-field", "nope"],
    "no_field.ply": ["--field", "nope"],
    "size_field_zero.ply": ["--size-field", "h"],
    "size_field_negative.vtp": ["--size-field", "h"],
    "size_field_nan.ply": ["--size-field", "h"],
}

# What the line of error must hold beside the file's name: every word, of words with a bar between them one. Blanks belong to a word.
EXPECTED = {
    "open_box.stl": ["open"],
    "two_holes.ply": ["open"],
    "single_triangle.off": ["open"],
    "moebius_strip.obj": ["open"],
    "unmerged.obj": ["open"],
    "hanging_vertex.off": ["open"],
    "fin.off": ["more than two triangles|open"],
    "cubes_at_an_edge.ply": ["more than two triangles"],
    "crossing_spheres.stl": ["cross"],
    "crossing_boxes.poly": ["cross"],
    "self_crossing_torus.obj": ["cross"],
    "spike_through_a_wall.vtp": ["cross"],
    "folded_flap.ply": ["cross"],
    "doubled_wall.off": ["cross"],
    "flush_boxes.stl": ["cross"],
    "klein_bottle.off": ["turned|cross|one side|orient"],
    "duplicate.obj": ["twice|more than two triangles"],
    "duplicate_turned_over.off": ["twice|more than two triangles"],
    "collinear.ply": ["degenerate|zero area"],
    "corner_twice.off": ["degenerate|zero area"],
    "needle.poly": ["degenerate|zero area"],
    "all_at_one_place.stl": ["degenerate|zero area"],
    "one_turned.stl": ["turned"],
    "half_turned.obj": ["turned"],
    "inside_out.ply": ["inwards"],
    "hole_outside.stl": ["hole"],
    "region_outside.stl": ["region"],
    "no_size_field.ply": ["nope"],
    "no_field.ply": ["nope"],
    "size_field_zero.ply": ["zero|above 0|positive| 0"],
    "size_field_negative.vtp": ["-0.5|above 0|positive|negative"],
    "size_field_nan.ply": ["nan|finite|above 0|positive"],
    "three_points.csv": ["4|four"],
    "plane.csv": ["plane"],
    "flat.node": ["plane"],
    "line.csv": ["line|plane"],
    "one_place.csv": ["same|place|line|plane|coincide"],
    "nan_place.csv": ["finite|nan|number"],
    "nan_place.off": ["finite|nan|number"],
    "nan_place.stl": ["finite|nan|number"],
    "infinite_place.ply": ["finite|inf"],
    "index_99.off": ["99"],
    "index_99.obj": ["99"],
    "index_99.ply": ["99"],
    "index_99.poly": ["99"],
    "index_0.obj": [" 0"],
    "negative_index.off": ["-7"],
    "unknown_type.ply": ["quad"],
    "two_corner_facet.poly": ["2|two|corners"],
}


def write_bad(name, folder):
    """A file, or a file and further arguments."""
    path = pathlib.Path(folder) / name
    if name in SHAPES:
        make, options = SHAPES[name]
        write(path, make(), **options)
    elif name in CONTENTS:
        content = CONTENTS[name]
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
    elif name in CUT:
        options, share = CUT[name]
        write(path, with_fields(box(divisions=2)), **options)
        path.write_bytes(path.read_bytes()[: int(path.stat().st_size * share)])
    elif name == "folder.stl":
        path.mkdir(exist_ok=True)
    return (path, ARGUMENTS[name]) if name in ARGUMENTS else path


# name -> function(folder) -> the file's path, or (path, further arguments)
BAD_SURFACES = collections.OrderedDict(
    (name, lambda folder, name=name: write_bad(name, folder)) for name in [*SHAPES, *CONTENTS, *CUT, "folder.stl", "missing.stl"]
)


GOOD = {  # name -> surface and volume, where that is a whole number
    "sphere": (lambda: sphere(2), None), "torus": (lambda: torus(16, 8), None), "box": (box, 1),
    "fine box": (lambda: box((0, 0, 0), (2, 1, 3), 3), 6), "two boxes": (two_boxes, 2),
    "cavity": (lambda: nested_spheres("inwards", 2), None), "nested": (lambda: nested_spheres("outwards", 2), None),
    "small scan": (lambda: noisy_scan(500), None),
}  # fmt: skip


def check():
    problems = []
    for name, (make, expected) in GOOD.items():
        surface = make()
        found = faults(surface)
        if found or (expected and abs(volume(surface) - expected) > 1e-12):
            problems.append(f"{name}: {sorted(found)}, volume {volume(surface)}")
    scan = noisy_scan()
    solid = np.linalg.det(scan.points[scan.triangles])
    if edge_faults(scan.triangles) or solid.min() <= 0:
        problems.append(f"scan: {edge_faults(scan.triangles)}, {np.count_nonzero(solid <= 0)} triangles seen from behind")
    if abs(volume(sphere(5)) - 4 / 3 * math.pi) > 0.01 or abs(volume(torus(200, 100)) - 2 * math.pi**2 * 0.35**2) > 0.01:
        problems.append("volumes of sphere and torus")
    if abs(volume(nested_spheres("inwards")) - volume(sphere()) * 7 / 8) > 1e-12:
        problems.append("volume of the cavity")
    known = {"open", "more than two triangles", "turned", "degenerate", "twice", "cross", "inwards"}
    for name, words in EXPECTED.items():
        if name in SHAPES and set(words[0].split("|")) & known:
            found = edge_faults(SHAPES[name][0]().triangles) if name == "unmerged.obj" else faults(SHAPES[name][0]())
            print(f"{name:<28} {', '.join(sorted(found))}")
            if not found & set(words[0].split("|")):
                problems.append(f"{name}: {sorted(found)}, expected {words[0]}")
    for problem in problems:
        print(f"FAILED {problem}")
    print(f"{len(GOOD) + 1} good surfaces, {len(BAD_SURFACES)} bad ones, {len(problems)} problems; the scan has {len(scan.triangles)} triangles")
    return 1 if problems else 0


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", type=pathlib.Path, metavar="FOLDER")
    folder = parser.parse_args().write
    with tempfile.TemporaryDirectory() as own:
        place = folder or pathlib.Path(own)
        place.mkdir(parents=True, exist_ok=True)
        for make in BAD_SURFACES.values():
            make(place)
        for name, (make, _) in GOOD.items():
            for suffix in WRITERS:
                write(place / f"{name.replace(' ', '_')}{suffix}", with_fields(make()))
    return check()


if __name__ == "__main__":
    raise SystemExit(main())
