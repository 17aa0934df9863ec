#!/usr/bin/env python3
"""Drives tessera-tetrahedralize as a user does: surfaces it must refuse, meshes of surfaces and of points, sizes, and resampling points.

usage: tetrahedralize_test.py --program PROGRAM [--tessera PROGRAM] [unittest arguments]

Without --tessera the suite Resample is skipped.
"""

import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

import numpy as np

import surfaces
from mesh_statistics import Mesh, of_mesh

PROGRAM = ""
TESSERA = ""
TIMEOUT_S = 300
FLOAT_ULP_AT_2 = 2.0**-22  # distance of floats between 2 and 4


def rows(points):
    """Each point as something to look up by: its bits, with 0 for -0."""
    return [p.tobytes() for p in np.asarray(points, dtype=float) + 0.0]


def hull_volume(points):
    """Of points in general position: a hull that grows point by point."""
    first = np.array([0, 1, 2, 3] if np.linalg.det(points[1:4] - points[0]) > 0 else [1, 0, 2, 3])
    faces = first[np.array([(1, 2, 3), (0, 3, 2), (0, 1, 3), (0, 2, 1)])]
    for new in range(len(points)):
        corners = points[faces]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        sees = np.einsum("ij,ij->i", normals, points[new] - corners[:, 0]) > 0
        sees[(faces == new).any(axis=1)] = False
        if sees.any():
            edges = {(f[k], f[(k + 1) % 3]) for f in faces[sees].tolist() for k in range(3)}
            rim = [(u, v, new) for u, v in edges if (v, u) not in edges]
            faces = np.concatenate([faces[~sees], rim])
    return surfaces.volume(surfaces.Surface(points, faces))


class TetrahedralizeTest(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="tessera-tetrahedralize-test-"))
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)

    def write(self, name, surface, **options):
        surfaces.write(self.folder / name, surface, **options)
        return name

    def run_program(self, *arguments, program=None):
        words = [program or PROGRAM, *map(str, arguments)]
        return subprocess.run(words, capture_output=True, text=True, errors="backslashreplace", timeout=TIMEOUT_S, cwd=self.folder)

    def succeed(self, *arguments, program=None):
        result = self.run_program(*arguments, program=program)
        self.assertEqual(result.returncode, 0, f"{arguments}: {result.stderr}")
        self.assertEqual(result.stderr, "")
        return result.stdout

    def reject(self, *arguments, codes=(2,)):
        """One line on stderr, nothing on stdout, and no file more than before."""
        before = sorted(os.listdir(self.folder))
        result = self.run_program(*arguments)
        self.assertIn(result.returncode, codes, f"{arguments}: {result.stdout}{result.stderr}")
        lines = result.stderr.splitlines()
        self.assertEqual(len(lines), 1, result.stderr)
        self.assertTrue(result.stderr.endswith("\n"), result.stderr)
        self.assertTrue(lines[0].startswith("tessera-tetrahedralize: "), lines[0])
        self.assertLessEqual(len(lines[0].encode()), 1000)
        self.assertFalse([c for c in lines[0] if ord(c) < 32 or ord(c) == 127], lines[0])
        self.assertEqual(result.stdout, "")
        self.assertEqual(sorted(os.listdir(self.folder)), before)
        return lines[0]

    def mesh(self, name, *options, may_touch=False):
        """The mesh of a file, whose elements fit together, and its statistics. may_touch: its boundary may touch itself along edges."""
        self.succeed(name, "-o", "out.vtu", "-q", *options)
        mesh = Mesh(self.folder / "out.vtu")
        found = of_mesh(mesh)
        self.assertEqual([f for f in found["faults"] if not (may_touch and "boundary edges" in f)], [], name)
        return mesh, found

    def volume(self, name, *options):
        return self.mesh(name, *options)[1]["volume"]

    def assert_close(self, value, expected, relative=1e-9):
        self.assertLessEqual(abs(value - expected), relative * abs(expected), f"{value!r}, expected {expected!r}")

    def check_values_at(self, mesh, surface):
        """Every point of the input is a node, and has all values of its fields bit by bit."""
        node = {place: n for n, place in enumerate(rows(mesh.points))}
        places = rows(surface.points)
        self.assertEqual([p for p, place in enumerate(places) if place not in node], [])
        nodes = [node[place] for place in places]
        for name, values in surface.fields.items():
            self.assertIn(name, mesh.point_fields)
            self.assertEqual(mesh.point_fields[name].dtype, np.float64)
            np.testing.assert_array_equal(mesh.point_fields[name][nodes], values, name)


class Bad(TetrahedralizeTest):
    """A test for each of BAD_SURFACES."""

    def check(self, name):
        made = surfaces.BAD_SURFACES[name](self.folder)
        path, options = made if isinstance(made, tuple) else (made, [])
        line = self.reject(path.name, "-o", "out.vtu", *options)
        self.assertIn(path.name, line)
        rest = line.replace(path.name, "")
        for words in surfaces.EXPECTED.get(name, []):
            self.assertTrue(any(word in rest for word in words.split("|")), f"{words}: {line}")


for bad_name in surfaces.BAD_SURFACES:
    setattr(Bad, "test_" + re.sub(r"\W", "_", bad_name), lambda self, name=bad_name: self.check(name))


class Options(TetrahedralizeTest):
    def test_options_out_of_range(self):
        ball = self.write("ball.ply", surfaces.sphere(1))
        for options in (
            ["--size", "0"], ["--size", "-1"], ["--size", "nan"], ["--size", "abc"], ["--size-surface", "0"], ["--size-surface", "-1"],
            ["--size-surface", "0.2", "--growth", "-1"], ["--growth", "nan"], ["--edges-per-circle", "0"], ["--edges-per-circle", "-3"],
            ["--min-size", "-1"], ["--quality", "-1"], ["--quality", "x"], ["--min-dihedral", "-1"], ["--min-dihedral", "100"],
            ["--boundary", "perhaps"],
            ["--hole", "1,2"], ["--hole", "a,b,c"], ["--hole", "nan,0,0"], ["--region", "1,2"], ["--region", "0,0,0:0"], ["--region", "0,0,0:x"],
            ["--hull-limit", "0"], ["--hull-limit", "-1"], ["--threads", "-1"], ["--threads", "x"], ["--max-memory", "1X"], ["--max-time", "-1"],
            ["--no-such-option"], ["second.ply"],
        ):  # fmt: skip
            with self.subTest(options=options):
                self.reject(ball, "-o", "out.vtu", *options)

    def test_an_output_is_needed(self):
        ball = self.write("ball.ply", surfaces.sphere(1))
        self.reject(ball)
        self.reject(ball, "-o", "out.xyz")
        self.reject(ball, "-o", "nowhere/out.vtu", codes=(1, 2))
        self.reject("-o", "out.vtu")

    def test_quiet_is_quiet(self):
        ball = self.write("ball.ply", surfaces.sphere(1))
        self.assertEqual(self.succeed(ball, "-o", "out.vtu", "-q"), "")
        self.assertEqual(self.succeed(ball, "-o", "out.vtu", "--quiet"), "")
        self.assertNotEqual(self.succeed(ball, "-o", "out.vtu"), "")

    def test_a_report(self):
        self.succeed(self.write("ball.ply", surfaces.sphere(2)), "-o", "out.vtu", "-q", "--json", "report.json")
        report = json.loads((self.folder / "report.json").read_text())
        self.assertIn("mesh", report)
        self.assertIn("quality", report)
        self.assertEqual(sorted(os.listdir(self.folder)), ["ball.ply", "out.vtu", "report.json"])

    def test_the_same_bytes_with_every_number_of_threads(self):
        ball = self.write("ball.ply", surfaces.with_fields(surfaces.sphere(2)))
        for threads in (1, 2, 3):
            self.succeed(ball, "-o", f"{threads}.vtu", "-q", "--size", "0.3", "--threads", threads)
        written = {(self.folder / f"{threads}.vtu").read_bytes() for threads in (1, 2, 3)}
        self.assertEqual(len(written), 1)


class Good(TetrahedralizeTest):
    def test_the_volume_is_that_of_the_polyhedron(self):
        for name, surface in (("sphere", surfaces.sphere(2)), ("torus", surfaces.torus(24, 10)), ("boxes", surfaces.two_boxes()),
                              ("fine", surfaces.box((-3, 0, 5), (1, 2, 6), 4)), ("scan", surfaces.noisy_scan(2000))):  # fmt: skip
            with self.subTest(name):
                self.assert_close(self.volume(self.write(f"{name}.ply", surface)), surfaces.volume(surface))

    def test_far_away_and_in_other_units(self):
        for scale, offset in ((1e-6, 0), (1e6, 0), (1, 1000)):
            with self.subTest(scale=scale, offset=offset):
                surface = surfaces.sphere(2)
                surface = surface._replace(points=surface.points * scale + offset)
                self.assert_close(self.volume(self.write("sphere.ply", surface)), surfaces.volume(surface))

    def test_a_boundary_that_is_kept_is_the_surface(self):
        surface = surfaces.torus(24, 10)
        mesh, found = self.mesh(self.write("torus.ply", surface), "--boundary", "keep", "--size", "0.15")
        faces = mesh.faces()[0]
        self.assertEqual({frozenset(rows(c)) for c in mesh.points[faces]}, {frozenset(rows(c)) for c in surface.points[surface.triangles]})

    def test_a_cavity_by_orientation(self):
        surface = surfaces.nested_spheres("inwards", 2)
        self.assert_close(self.volume(self.write("cavity.ply", surface)), surfaces.volume(surface))

    def test_places_stand_before_the_file_too(self):
        self.write("nested.ply", surfaces.nested_spheres("outwards", 2))
        self.succeed("--hole", "0,0,0", "--region", "-0.75,0,0", "nested.ply", "-o", "out.vtu")

    def test_a_cavity_by_a_place(self):
        expected = surfaces.volume(surfaces.nested_spheres("inwards", 2))
        self.assert_close(self.volume(self.write("nested.ply", surfaces.nested_spheres("outwards", 2)), "--hole", "0,0,0"), expected)

    def test_holes_and_regions_of_a_poly_file(self):
        surface = surfaces.nested_spheres("outwards", 2)
        self.assert_close(self.volume(self.write("hole.poly", surface, holes=[(0, 0, 0)])), surfaces.volume(surface) * 7 / 9)
        regions = [(0, 0, 0, 5, -1), (0.75, 0, 0, 9, -1)]
        _, found = self.mesh(self.write("regions.poly", surface, regions=regions))
        self.check_regions(found, surfaces.volume(surfaces.sphere(2)))

    def test_regions(self):
        nested = self.write("nested.ply", surfaces.nested_spheres("outwards", 2))
        _, found = self.mesh(nested, "--region", "0,0,0", "--region", "0.75,0,0")
        self.check_regions(found, surfaces.volume(surfaces.sphere(2)))

    def check_regions(self, found, whole):
        inner, outer = sorted(found["region_volumes"].values())
        self.assert_close(inner, whole / 8)
        self.assert_close(outer, whole * 7 / 8)

    def test_a_region_of_smaller_elements(self):
        nested = self.write("nested.ply", surfaces.nested_spheres("outwards", 2))
        mesh, found = self.mesh(nested, "--region", "0,0,0:0.08", "--region", "0.75,0,0")
        of_inner = min(found["region_volumes"], key=found["region_volumes"].get)
        counts = [np.count_nonzero((mesh.cell_fields["region"] == of_inner) == inner) for inner in (True, False)]
        self.assertGreater(counts[0] / (1 / 8), 5 * counts[1] / (7 / 8))

    def test_every_format_gives_the_same_volume(self):
        surface = surfaces.single_precision(surfaces.with_fields(surfaces.torus(24, 10)))
        expected = surfaces.volume(surface)
        variants = {".stl": [{}, {"head": b"solid"}, {"binary": False}], ".ply": [{}, {"order": ">"}, {"binary": False}],
                    ".obj": [{}, {"corner": "{0}//1"}, {"corner": "{0}/1/1"}, {"corner": "{1}"}],
                    ".off": [{}], ".poly": [{"first": 0}, {"first": 1}], ".vtp": [{}]}  # fmt: skip
        for suffix, styles in variants.items():
            for style in styles:
                with self.subTest(suffix=suffix, style=style):
                    mesh, found = self.mesh(self.write("torus" + suffix, surface, **style))
                    self.assert_close(found["volume"], expected)
                    if suffix in (".ply", ".vtp"):
                        self.assertIn("heat", mesh.point_fields)

    def test_faces_of_four_corners(self):
        points, quads = surfaces.box_quads((0, 0, 0), (1, 2, 3), 3)
        for suffix in (".ply", ".obj", ".off", ".poly", ".vtp"):
            with self.subTest(suffix=suffix):
                self.assert_close(self.volume(self.write("box" + suffix, surfaces.Surface(points, quads))), 6)


def nest(inwards):
    """Boxes of 8, 6, 4 and 2 around the origin, the inner ones turned inwards where that is said, and the volumes of the parts between."""
    boxes = [surfaces.box((-h,) * 3, (h,) * 3, 2) for h in (4, 3, 2, 1)]
    volumes = [512 - 216, 216 - 64, 64 - 8, 8]
    return surfaces.joined(*(surfaces.turned_over(b) if i in inwards else b for i, b in enumerate(boxes))), volumes


class Parts(TetrahedralizeTest):
    """Shells within shells, with holes and regions by places."""

    PLACES = ["3.5,0.1,0.2", "0.3,-2.4,0.1", "0.2,0.3,1.4", "0.1,0.2,-0.3"]  # one in each part

    def test_any_parts_may_be_holes(self):
        random = np.random.default_rng(3)
        for trial in range(12):
            inwards = {int(random.integers(1, 4))} if trial % 3 else set()
            holes = {int(i) for i in random.permutation(4)[: random.integers(0, 3)]}
            surface, volumes = nest(inwards)
            self.write("nest.off", surface)
            options = [word for i in sorted(holes) for word in ("--hole", self.PLACES[i])]
            kept = [v for i, v in enumerate(volumes) if i not in holes | inwards]
            named = [i for i in range(4) if i not in holes | inwards][:2]
            options += [word for i in named for word in ("--region", self.PLACES[i])]
            if not kept:
                continue
            mesh, found = self.mesh("nest.off", *options, may_touch=True)
            self.assert_close(found["volume"], sum(kept))
            if len(kept) > 1:
                by_region = [np.abs(mesh.volumes()[mesh.cell_fields["region"] == r + 1]).sum() for r in range(len(named))]
                for value, i in zip(by_region, named):
                    self.assert_close(value, volumes[i])

    def test_places_that_contradict_are_refused(self):
        self.write("nest.off", nest({2})[0])
        for words, options in (
            ("same part", ["--region", self.PLACES[0], "--region", "3.4,1,1"]),
            ("on the surface", ["--region", "4,0.2,0.1"]),
            ("on the surface", ["--hole", "4,4,4"]),
            ("lies in a hole", ["--region", self.PLACES[2]]),
            ("lies in a hole", ["--hole", self.PLACES[0], "--region", self.PLACES[0]]),
            ("outside", ["--hole", "9,0,0"]),
        ):
            self.assertIn(words, self.reject("nest.off", "-o", "out.vtu", *options))
        self.write("twice.off", nest({1, 2})[0])
        self.assertIn("a hole in a hole", self.reject("twice.off", "-o", "out.vtu"))

    def test_options_for_the_other_kind_are_refused(self):
        self.write("nest.off", nest(set())[0])
        (self.folder / "points.csv").write_text("x,y,z\n0,0,0\n1,0,0\n0,1,0\n0,0,1\n")
        self.assertIn("--hull-limit", self.reject("nest.off", "-o", "out.vtu", "--hull-limit", "1"))
        for options in (["--size", "1"], ["--hole", "0,0,0"], ["--repair-surface"], ["--boundary", "refine"]):
            self.assertIn("points", self.reject("points.csv", "-o", "out.vtu", *options))

    def test_large_triangles_that_stay_are_told(self):
        self.write("box.off", surfaces.box())
        kept = self.succeed("box.off", "-o", "out.vtu", "--size", "0.1")
        self.assertIn("--boundary refine", kept)
        self.assertNotIn("warning", self.succeed("box.off", "-o", "out.vtu", "--size", "0.1", "--boundary", "refine"))


class Fields(TetrahedralizeTest):
    def test_a_linear_field_stays_linear(self):
        surface = surfaces.with_fields(surfaces.torus(24, 10))
        for suffix, boundary in ((".ply", "keep"), (".vtp", "refine")):
            with self.subTest(suffix=suffix, boundary=boundary):
                mesh, _ = self.mesh(self.write("torus" + suffix, surface), "--size", "0.15", "--boundary", boundary)
                self.assertGreater(len(mesh.points), len(surface.points))
                difference = mesh.point_fields["heat"] - surfaces.linear(mesh.points)
                self.assertLessEqual(abs(difference).max(), 1e-6 * np.ptp(surface.fields["heat"]))

    def test_values_at_points_of_the_surface_are_kept(self):
        surface = surfaces.with_fields(surfaces.torus(24, 10))
        for suffix in (".ply", ".vtp"):
            with self.subTest(suffix=suffix):
                fields = surface.fields if suffix == ".vtp" else dict(surfaces.columns({"heat": surface.fields["heat"]}))
                mesh, _ = self.mesh(self.write("torus" + suffix, surface), "--size", "0.15")
                self.check_values_at(mesh, surface._replace(fields=fields))

    def test_values_within_lie_between_those_of_the_surface(self):
        surface = surfaces.with_fields(surfaces.sphere(2))
        mesh, _ = self.mesh(self.write("sphere.vtp", surface), "--size", "0.25")
        for name, values in surface.fields.items():
            slack = 1e-6 * np.ptp(values, axis=0)
            self.assertTrue((mesh.point_fields[name] >= values.min(axis=0) - slack).all(), name)
            self.assertTrue((mesh.point_fields[name] <= values.max(axis=0) + slack).all(), name)

    def test_fields_can_get_other_names(self):
        self.write("ball.vtp", surfaces.with_fields(surfaces.sphere(1)))
        mesh, _ = self.mesh("ball.vtp", "--field", "heat=T")
        self.assertEqual(list(mesh.point_fields), ["T"])

    def test_fields_can_be_chosen(self):
        ball = self.write("sphere.vtp", surfaces.with_fields(surfaces.sphere(1)))
        mesh, _ = self.mesh(ball, "--field", "heat")
        self.assertEqual({"heat", "flow"} & set(mesh.point_fields), {"heat"})
        mesh, _ = self.mesh(ball, "--field", "flow,heat")
        self.assertEqual({"heat", "flow"} & set(mesh.point_fields), {"heat", "flow"})


class Repair(TetrahedralizeTest):
    def test_what_can_be_mended(self):
        sphere, box = surfaces.volume(surfaces.sphere(1)), 1
        for name, expected in (("one_turned.stl", sphere), ("half_turned.obj", sphere), ("inside_out.ply", surfaces.volume(surfaces.sphere(2))),
                               ("duplicate.obj", box), ("corner_twice.off", box), ("unmerged.obj", box)):  # fmt: skip
            with self.subTest(name):
                surfaces.BAD_SURFACES[name](self.folder)
                self.assert_close(self.volume(name, "--repair-surface"), expected, 1e-6 if name.endswith(".stl") else 1e-9)

    def test_holes_and_crossings_stay(self):
        for name in ("open_box.stl", "crossing_spheres.stl", "moebius_strip.obj"):
            with self.subTest(name):
                surfaces.BAD_SURFACES[name](self.folder)
                self.assertIn(name, self.reject(name, "-o", "out.vtu", "--repair-surface"))


class Points(TetrahedralizeTest):
    def cloud(self, count=300, seed=1):
        points = np.random.default_rng(seed).random((count, 3))
        return surfaces.with_fields(surfaces.Surface(points, None))

    def test_delaunay(self):
        cloud = self.cloud()
        mesh, found = self.mesh(self.write("cloud.csv", cloud._replace(fields={"heat": cloud.fields["heat"]})))
        self.assertEqual(len(mesh.points), len(cloud.points))
        self.check_values_at(mesh, cloud._replace(fields={"heat": cloud.fields["heat"]}))
        self.assert_close(found["volume"], hull_volume(cloud.points))
        corners = mesh.points[mesh.tets]
        edges = corners[:, 1:] - corners[:, :1]
        centres = np.linalg.solve(edges, (edges**2).sum(axis=2)[:, :, None] / 2)[:, :, 0]
        radii = np.linalg.norm(centres, axis=1)
        distances = np.linalg.norm((centres + corners[:, 0])[:, None] - cloud.points[None], axis=2)
        self.assertTrue((distances >= radii[:, None] * (1 - 1e-9)).all())

    def test_ways_of_writing_points(self):
        cloud = self.cloud()
        expected = hull_volume(cloud.points)
        for style in ("comma", "semicolon", "tab", "bare", "paraview"):
            with self.subTest(style):
                mesh, found = self.mesh(self.write(f"{style}.csv", cloud, style=style))
                self.assert_close(found["volume"], expected)
                self.assertEqual(len(mesh.points), len(cloud.points))
                if style != "bare":
                    self.check_values_at(mesh, cloud._replace(fields={"heat": cloud.fields["heat"]}))
        for first in (0, 1):
            with self.subTest(first=first):
                mesh, found = self.mesh(self.write("cloud.node", cloud, first=first))
                self.assert_close(found["volume"], expected)
                self.check_values_at(mesh, cloud._replace(fields={"attribute_1": cloud.fields["heat"]}))

    def test_points_of_a_lattice(self):
        """Where many points lie on one sphere there's more than one Delaunay mesh, and elements of no volume come easily."""
        steps = np.arange(6) / 8
        points = np.stack(np.meshgrid(steps, steps, steps), axis=-1).reshape(-1, 3)
        mesh, found = self.mesh(self.write("lattice.csv", surfaces.with_fields(surfaces.Surface(points, None))))
        self.assertEqual(len(mesh.points), len(points))
        self.assert_close(found["volume"], 0.625**3)

    def test_points_at_one_place_are_merged(self):
        cloud = self.cloud()
        again = np.concatenate([np.arange(len(cloud.points)), np.arange(20)])
        twice = surfaces.Surface(cloud.points[again], None, {"heat": cloud.fields["heat"][again]})
        text = self.succeed(self.write("twice.csv", twice), "-o", "out.vtu")
        self.assertRegex(text, "20.*(merge|same place|twice|coincide|duplicate)|(merge|same place|twice|coincide|duplicate).*20")
        mesh = Mesh(self.folder / "out.vtu")
        self.assertEqual(len(mesh.points), len(cloud.points))
        self.check_values_at(mesh, twice)

    def test_a_limit_keeps_bays_empty(self):
        """Points of an L, with some jitter: without a limit the hull fills the bay."""
        i, j, k = (a.reshape(-1) for a in np.meshgrid(np.arange(11), np.arange(11), np.arange(6), indexing="ij"))
        keep = (i <= 5) | (j <= 5)
        points = np.stack([i, j, k], axis=1)[keep] * 0.1 + np.random.default_rng(1).uniform(-0.01, 0.01, (np.count_nonzero(keep), 3))
        bent = self.write("bent.csv", surfaces.with_fields(surfaces.Surface(points, None)))
        deep = lambda mesh: (mesh.points[mesh.tets].mean(axis=1)[:, :2] > 0.62).all(axis=1).sum()  # noqa: E731
        mesh, found = self.mesh(bent)
        self.assertGreater(deep(mesh), 0)
        self.assertGreater(found["longest_edge"], 0.5)
        mesh, found = self.mesh(bent, "--hull-limit", "0.3", may_touch=True)
        self.assertEqual(deep(mesh), 0)
        self.assertLessEqual(found["longest_edge"], 0.3)
        self.assert_close(found["volume"], 0.75 * 0.5, 0.1)


class Sizes(TetrahedralizeTest):
    def edges(self, name, *options):
        """Middles and lengths of all edges, and whether both ends lie within."""
        mesh, _ = self.mesh(name, *options)
        ends = mesh.edges()
        on_boundary = np.zeros(len(mesh.points), bool)
        on_boundary[mesh.faces()[0]] = True
        return mesh.points[ends].mean(axis=1), mesh.edge_lengths(ends), ~on_boundary[ends].any(axis=1)

    def test_one_size(self):
        ball = self.write("ball.ply", surfaces.sphere(3))
        for size in (0.12, 0.2):
            with self.subTest(size=size):
                _, lengths, within = self.edges(ball, "--size", size, "--boundary", "refine")
                self.assertGreater(np.count_nonzero(within), 100)
                self.assertLess(lengths[within].mean(), 1.5 * size)
                self.assertGreater(lengths[within].mean(), size / 1.5)

    def test_a_size_field(self):
        ball = surfaces.sphere(2)
        ball = ball._replace(fields={"h": 0.15 + 0.09 * ball.points[:, 0]})
        middles, lengths, _ = self.edges(self.write("ball.ply", ball), "--size-field", "h", "--boundary", "refine")
        self.assertLess(lengths[middles[:, 0] < -0.6].mean(), 0.7 * lengths[middles[:, 0] > 0.6].mean())

    def test_sizes_grow_away_from_the_surface(self):
        ball = self.write("ball.ply", surfaces.sphere(2))
        middles, lengths, _ = self.edges(ball, "--size-surface", "0.12", "--growth", "1.5", "--boundary", "refine")
        radius = np.linalg.norm(middles, axis=1)
        self.assertLess(lengths[radius > 0.85].mean(), 0.75 * lengths[radius < 0.5].mean())
        self.assertLess(lengths[radius > 0.85].mean(), 1.5 * 0.12)

    def test_sizes_follow_the_curvature(self):
        """A ring whose tube is thick on one side and thin on the other."""
        tube = lambda u: 0.3 + 0.18 * np.cos(u)  # noqa: E731
        ring = self.write("ring.ply", surfaces.torus(48, 16, 1, tube))
        means = {}
        for count in (12, 36):
            middles, lengths, _ = self.edges(ring, "--edges-per-circle", count, "--boundary", "refine")
            side = middles[:, 0] / np.linalg.norm(middles[:, :2], axis=1)
            means[count] = lengths[side < -0.9].mean(), lengths[side > 0.9].mean()
            self.assertLess(means[count][0], 0.8 * means[count][1])
        self.assertLess(means[36][0], 2 * 2 * np.pi * tube(np.pi) / 36)
        self.assertLess(means[36][1], 0.9 * means[12][1])

    def test_a_least_size(self):
        ring = self.write("ring.ply", surfaces.torus(24, 10))
        options = ["--edges-per-circle", "60", "--boundary", "refine"]
        free, limited = (self.mesh(ring, *options, *least)[1]["tetrahedra"] for least in ([], ["--min-size", "0.1"]))
        self.assertGreater(free, 2 * limited)


class Resample(TetrahedralizeTest):
    def setUp(self):
        super().setUp()
        if not TESSERA:
            self.skipTest("no --tessera")

    def write_points(self):
        points = np.concatenate([np.random.default_rng(5).random((1000, 3)), surfaces.box().points])
        self.write("points.csv", surfaces.Surface(points, None, {"heat": surfaces.linear(points)}))

    def test_points_become_tetrahedra_by_themselves(self):
        self.write_points()
        text = self.succeed("resample", "points.csv", "-o", "out.vdb", "--refine", "uniform", "--resolution", "32", program=TESSERA)
        self.assertIn("tessera-tetrahedralize", text)
        self.succeed("verify", "points.csv", "out.vdb", program=TESSERA)
        self.assertEqual(sorted(os.listdir(self.folder)), ["out.vdb", "points.csv"])

    def test_a_linear_field_comes_back(self):
        self.write_points()
        self.succeed("resample", "points.csv", "-o", "out.vdb", "--refine", "uniform", "--resolution", "64", "--quiet", program=TESSERA)
        self.check_linear("out.vdb", 64**3)

    def check_linear(self, name, expected_count):
        """The field heat at every covered voxel is surfaces.linear() there."""
        info = json.loads(self.succeed("info", name, "--json", "-", program=TESSERA))
        places, values = covered_values(self.folder / name, "heat", info["unit_scale"])
        self.assertGreater(len(values), 0.9 * expected_count)
        self.assertLessEqual(abs(values - surfaces.linear(places)).max(), 4 * FLOAT_ULP_AT_2)


def covered_values(path, field, unit_scale):
    """World places of the covered voxels of the finest level, and a field's values there."""
    import pyopenvdb  # only where it is needed: not every machine has it

    grids = {grid.name: grid for grid in pyopenvdb.readAll(str(path))[0]}
    coverage, values = grids["coverage_level_0"], grids[f"{field}_level_0"]
    low, high = (np.array(corner) for corner in coverage.evalActiveVoxelBoundingBox())
    covered = np.zeros(high - low + 1, dtype=bool)
    coverage.copyToArray(covered, ijk=tuple(low.tolist()))
    dense = np.zeros(covered.shape, dtype=np.float32)
    values.copyToArray(dense, ijk=tuple(low.tolist()))
    index = np.argwhere(covered) + low
    base = np.array(coverage.transform.indexToWorld((0, 0, 0)))
    steps = [np.array(coverage.transform.indexToWorld(tuple(axis))) - base for axis in np.eye(3, dtype=int).tolist()]
    return (base + index @ np.array(steps)) / unit_scale, dense[covered].astype(float)


if __name__ == "__main__":
    arguments = sys.argv[1:]

    def take(name):
        """An option and its value, which unittest doesn't see."""
        at = arguments.index(name)
        value = str(pathlib.Path(arguments[at + 1]).resolve())
        del arguments[at : at + 2]
        return value

    PROGRAM = take("--program")
    if "--tessera" in arguments:
        TESSERA = take("--tessera")
    unittest.main(argv=[sys.argv[0], *arguments])
