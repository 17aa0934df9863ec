#!/usr/bin/env python3
"""Measures a .vtu file of tetrahedra with VTK and numpy, by none of Tessera's code: sizes, shapes, and whether the elements fit together.

usage: mesh_statistics.py MESH.vtu... [--json FILE]

Aspect ratio: longest edge over least height, scaled so that a regular tetrahedron has 1. Exit code 1 where elements don't fit together.
"""

import argparse
import json
import pathlib
import sys

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader

ASPECT_BINS = [1, 1.5, 2, 3, 4, 6, 10, 15, 100, np.inf]
ANGLE_BINS = list(range(0, 181, 10))
FACES = [(1, 2, 3), (0, 3, 2), (0, 1, 3), (0, 2, 1)]  # opposite each corner, facing out of an element of positive volume
EDGES = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)]
CHUNK = 500_000


def fields_of(data):
    arrays = (data.GetArray(i) for i in range(data.GetNumberOfArrays()))
    return {array.GetName(): vtk_to_numpy(array) for array in arrays if array}  # none for one of texts


class Mesh:
    """Points (n, 3), tetrahedra (m, 4) and the fields at points and of cells (name -> array), as the file has them; ValueError where it can't be
    read or has other cells."""

    def __init__(self, path):
        reader = vtkXMLUnstructuredGridReader()
        reader.GlobalWarningDisplayOff()  # the error below is enough
        reader.SetFileName(str(path))
        reader.Update()
        self.grid = grid = reader.GetOutput()
        if reader.GetErrorCode() or not grid.GetNumberOfCells():
            raise ValueError(f"{path}: no cells could be read")
        types = np.unique(vtk_to_numpy(grid.GetCellTypesArray()))
        if types.tolist() != [10]:
            raise ValueError(f"{path}: not tetrahedra alone (types {types.tolist()})")
        self.points = vtk_to_numpy(grid.GetPoints().GetData())
        self.tets = vtk_to_numpy(grid.GetCells().GetConnectivityArray()).reshape(-1, 4)
        self.point_fields, self.cell_fields = fields_of(grid.GetPointData()), fields_of(grid.GetCellData())

    def volumes(self):
        """Signed."""
        return np.concatenate([signed_volumes(self.points[part].astype(float)) for part in in_chunks(self.tets)])

    def edges(self):
        """Every edge once: (edges, 2)."""
        count = np.uint64(len(self.points))
        keys = np.empty((len(EDGES), len(self.tets)), np.uint64)
        for row, (a, b) in zip(keys, EDGES):
            low, high = np.minimum(self.tets[:, a], self.tets[:, b]), np.maximum(self.tets[:, a], self.tets[:, b])
            row[:] = low.astype(np.uint64) * count + high.astype(np.uint64)
        keys = keys.reshape(-1)
        keys.sort()
        keys = keys[np.concatenate([[True], keys[1:] != keys[:-1]])]
        return np.stack([keys // count, keys % count], axis=1).astype(np.int64)

    def edge_lengths(self, edges):
        return np.concatenate([np.linalg.norm(np.subtract(*self.points[part].astype(float).transpose(1, 0, 2)), axis=1) for part in in_chunks(edges)])

    def faces(self):
        """(boundary faces, outwards so far as elements have positive volume; faces of more than two elements; inner faces whose elements
        lie on the same side)"""
        corners = np.empty((len(FACES), len(self.tets), 3), np.int32)
        for part, face in zip(corners, FACES):
            part[:] = self.tets[:, face]
        corners = corners.reshape(-1, 3)
        # Sorted by a network of three exchanges; each turns the face over.
        is_odd = np.zeros(len(corners), bool)
        a, b, c = (corners[:, k].copy() for k in range(3))
        for low, high in ((a, b), (b, c), (a, b)):
            swap = low > high
            low[swap], high[swap] = high[swap], low[swap]
            is_odd ^= swap
        if len(self.points) < 2**21:  # a face fits one word, which sorts fast
            high, middle, low, odd = (part.astype(np.uint64) for part in (a, b, c, is_odd))
            order = np.argsort(high << np.uint64(43) | middle << np.uint64(22) | low << np.uint64(1) | odd)
            del high, middle, low, odd
        else:
            order = np.lexsort((is_odd, c, b, a))
        a, b, c, is_odd = a[order], b[order], c[order], is_odd[order]
        starts = np.flatnonzero(np.concatenate([[True], (a[1:] != a[:-1]) | (b[1:] != b[:-1]) | (c[1:] != c[:-1])]))
        counts = np.diff(np.append(starts, len(a)))
        pairs = starts[counts == 2]
        return corners[order[starts[counts == 1]]], int((counts > 2).sum()), int((is_odd[pairs] == is_odd[pairs + 1]).sum())


def in_chunks(array):
    return (array[i : i + CHUNK] for i in range(0, len(array), CHUNK))


def signed_volumes(corners):
    a, b, c = (corners[:, k] - corners[:, 0] for k in (1, 2, 3))
    return np.einsum("ij,ij->i", np.cross(a, b), c) / 6


def shapes(corners):
    """(aspect ratios, the six dihedral angles of each in degrees)"""
    with np.errstate(divide="ignore", invalid="ignore"):
        normals = [np.cross(corners[:, b] - corners[:, a], corners[:, c] - corners[:, a]) for a, b, c in FACES]
        sizes = [np.linalg.norm(n, axis=1) for n in normals]
        longest = np.max([np.linalg.norm(corners[:, a] - corners[:, b], axis=1) for a, b in EDGES], axis=0)
        # 6 volume = 2 area of the largest side * least height
        height = 6 * abs(signed_volumes(corners)) / np.max(sizes, axis=0)
        aspects = np.sqrt(2 / 3) * longest / height
        units = [n / size[:, None] for n, size in zip(normals, sizes)]
        cosines = [-np.einsum("ij,ij->i", units[a], units[b]) for a, b in EDGES]
        return np.nan_to_num(aspects, nan=np.inf, posinf=np.inf), np.degrees(np.arccos(np.clip(cosines, -1, 1)))


def boundary_faults(faces):
    """(edges that haven't two faces running either way, points whose faces form more than one fan)"""
    if not len(faces):
        return 0, 0
    count = int(faces.max()) + 1
    starts, ends = faces.astype(np.int64), np.roll(faces, -1, axis=1).astype(np.int64)
    low, high = np.minimum(starts, ends).reshape(-1), np.maximum(starts, ends).reshape(-1)
    _, same, counts = np.unique(low * count + high, return_inverse=True, return_counts=True)
    is_up = np.bincount(same.reshape(-1), (starts < ends).reshape(-1))
    bad_edges = int(((counts != 2) | (is_up != 1)).sum())
    # A corner is 3 face + k. Corners at the same point of faces that share an edge there belong to one fan: the least number spreads.
    order = np.argsort(same.reshape(-1), kind="stable")
    first = np.concatenate([[0], np.cumsum(counts)[:-1]])[counts >= 2]
    one, other = order[first], order[first + 1]  # halves of edges: half 3 f + k runs from corner k to corner k + 1

    def ends_of(half):
        return half, half // 3 * 3 + (half + 1) % 3

    links = []
    points = faces.reshape(-1)
    for a in ends_of(one):
        for b in ends_of(other):
            alike = points[a] == points[b]
            links.append((a[alike], b[alike]))
    a, b = (np.concatenate(part) for part in zip(*links))
    label = np.arange(faces.size)
    while True:
        least = label.copy()
        np.minimum.at(least, a, label[b])
        np.minimum.at(least, b, label[a])
        least = least[least]
        if (least == label).all():
            break
        label = least
    fans = np.bincount(points[label == np.arange(faces.size)], minlength=count)
    return bad_edges, int((fans > 1).sum())


def of_mesh(mesh):
    """The statistics of a Mesh, as statistics() gives them."""
    volumes = mesh.volumes()
    lengths = mesh.edge_lengths(mesh.edges())
    faces, crowded, same_side = mesh.faces()
    bad_edges, pinched = boundary_faults(faces)
    aspect_counts, angle_counts = np.zeros(len(ASPECT_BINS) - 1, int), np.zeros(len(ANGLE_BINS) - 1, int)
    least_angle, largest_angle, worst_aspect, sum_aspect = 180.0, 0.0, 0.0, 0.0
    for part in in_chunks(mesh.tets):
        aspects, angles = shapes(mesh.points[part].astype(float))
        aspects = np.maximum(aspects, 1)  # what is regular may fall short of it by rounding
        aspect_counts += np.bincount(np.searchsorted(ASPECT_BINS[1:-1], aspects, side="right"), minlength=len(aspect_counts))
        angle_counts += np.histogram(angles, ANGLE_BINS)[0]
        least_angle, largest_angle = min(least_angle, np.nanmin(angles)), max(largest_angle, np.nanmax(angles))
        worst_aspect, sum_aspect = max(worst_aspect, aspects.max()), sum_aspect + aspects.sum()
    corners = mesh.points[faces].astype(float)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum() / 2
    used = np.zeros(len(mesh.points), bool)
    used[mesh.tets] = True
    regions = {}
    if "region" in mesh.cell_fields:
        numbers, which = np.unique(mesh.cell_fields["region"], return_inverse=True)
        regions = dict(zip(numbers.tolist(), np.bincount(which.reshape(-1), abs(volumes)).tolist()))
    found = {
        "points": len(mesh.points),
        "tetrahedra": len(mesh.tets),
        "volume": float(abs(volumes).sum()),
        "smallest_volume": float(abs(volumes).min()),
        "edges": len(lengths),
        "shortest_edge": float(lengths.min()),
        "longest_edge": float(lengths.max()),
        "mean_edge": float(lengths.mean()),
        "aspect_bins": ASPECT_BINS,
        "aspect_counts": aspect_counts.tolist(),
        "mean_aspect": float(sum_aspect / len(mesh.tets)),
        "worst_aspect": float(worst_aspect),
        "angle_bins": ANGLE_BINS,
        "angle_counts": angle_counts.tolist(),
        "least_angle": float(least_angle),
        "largest_angle": float(largest_angle),
        "boundary_faces": len(faces),
        "boundary_area": float(area),
        "region_volumes": regions,
        "positive_volumes": int((volumes > 0).sum()),
        "negative_volumes": int((volumes < 0).sum()),
        "zero_volumes": int((volumes == 0).sum()),
        "crowded_faces": crowded,
        "same_side_faces": same_side,
        "bad_boundary_edges": bad_edges,
        "pinched_points": pinched,
        "unused_points": int((~used).sum()),
        "duplicate_points": len(used) - len(np.unique(mesh.points, axis=0)),
    }
    found["faults"] = faults(found)
    return found


def faults(found):
    """What doesn't fit together, in words. Points where the boundary touches itself don't count: parts may touch at a point."""
    texts = {
        "zero_volumes": "elements of no volume",
        "crowded_faces": "faces of more than two elements",
        "same_side_faces": "inner faces with both elements on one side",
        "bad_boundary_edges": "boundary edges that haven't two faces",
        "unused_points": "points that no element uses",
        "duplicate_points": "points where another is",
    }
    texts_found = [f"{found[key]} {text}" for key, text in texts.items() if found[key]]
    if found["positive_volumes"] and found["negative_volumes"]:
        texts_found.append(f"{found['positive_volumes']} elements of positive and {found['negative_volumes']} of negative volume")
    return texts_found


def statistics(path):
    """name -> number, or list, of a file; "faults" lists what doesn't fit together and is empty for a sound mesh."""
    return of_mesh(Mesh(path))


def histogram(bins, counts):
    total = max(1, sum(counts))
    rows = zip(bins, bins[1:], counts)
    return "".join(f"  {low:>4g} - {high:<4g} {count:>9} {100 * count / total:6.2f} %\n" for low, high, count in rows if count)


def text(path, s):
    return (
        f"{path}: {s['points']} points, {s['tetrahedra']} tetrahedra, {s['edges']} edges\n"
        f"volume {s['volume']:.12g}, smallest element {s['smallest_volume']:.3g}\n"
        f"boundary {s['boundary_faces']} faces, area {s['boundary_area']:.12g}\n"
        + "".join(f"region {number:g}: volume {volume:.12g}\n" for number, volume in s["region_volumes"].items())
        + f"edges {s['shortest_edge']:.4g} to {s['longest_edge']:.4g}, mean {s['mean_edge']:.4g}\n"
        f"aspect ratio, mean {s['mean_aspect']:.3f}, worst {s['worst_aspect']:.4g}\n{histogram(s['aspect_bins'], s['aspect_counts'])}"
        f"dihedral angles, {s['least_angle']:.3f} to {s['largest_angle']:.3f} degrees\n{histogram(s['angle_bins'], s['angle_counts'])}"
        + (f"the boundary touches itself at {s['pinched_points']} points\n" if s["pinched_points"] else "")
        + ("".join(f"FAULT: {fault}\n" for fault in s["faults"]) or "the elements fit together\n")
    )


def for_json(value):
    """JSON has no infinity."""
    if isinstance(value, dict):
        return {key: for_json(v) for key, v in value.items()}
    if isinstance(value, list):
        return [for_json(v) for v in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("meshes", nargs="+", type=pathlib.Path)
    parser.add_argument("--json", type=pathlib.Path, help="where the numbers go, by file")
    arguments = parser.parse_args()
    found = {}
    for path in arguments.meshes:
        try:
            found[str(path)] = statistics(path)
        except ValueError as error:
            print(f"mesh_statistics: {error}", file=sys.stderr)
            return 2
        print(text(path, found[str(path)]), end="")
    if arguments.json:
        arguments.json.write_text(json.dumps({path: for_json(s) for path, s in found.items()}, indent=1) + "\n")
    return 1 if any(s["faults"] for s in found.values()) else 0


if __name__ == "__main__":
    sys.exit(main())
