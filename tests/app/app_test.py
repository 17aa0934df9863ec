#!/usr/bin/env python3
"""Drives the tessera program as a user does: bad input, failing outputs, interruption, series, reports.

usage: app_test.py --tessera PROGRAM --data FOLDER [--broken-drivers FOLDER] [unittest arguments]
"""

import base64
import csv
import fcntl
import html.parser
import json
import os
import pathlib
import pty
import re
import resource
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import termios
import time
import unittest
import zlib

from forked_tessera import ForkedTessera

from signal_handlers import catches

# What "auto" measures goes to a cache of the tests' own; OpenGL's shaders stay where they are.
os.environ.setdefault("MESA_SHADER_CACHE_DIR", os.environ.get("XDG_CACHE_HOME") or str(pathlib.Path.home() / ".cache"))
CACHE = tempfile.TemporaryDirectory(prefix="tessera-app-cache-")
os.environ["XDG_CACHE_HOME"] = CACHE.name

TESSERA = ""
FORKED = None
DATA = pathlib.Path()
BROKEN_DRIVERS = pathlib.Path()

CUBE_POINTS = [(x, y, z) for z in (0, 1) for y in (0, 1) for x in (0, 1)]
CUBE_TETS = [(0, 1, 3, 7), (0, 3, 2, 7), (0, 2, 6, 7), (0, 6, 4, 7), (0, 4, 5, 7), (0, 5, 1, 7)]


def numbers(rows):
    return " ".join(" ".join(str(v) for v in row) for row in rows)


def vtu_text(points=CUBE_POINTS, cells=CUBE_TETS, cell_type=10, fields=None, extra=""):
    """An ASCII .vtu file; fields: name -> one number a point."""
    fields = {"f": [p[0] for p in points]} if fields is None else fields
    size = len(cells[0])
    arrays = "".join(
        f'<DataArray type="Float64" Name="{name}" format="ascii">{" ".join(map(str, values))}</DataArray>' for name, values in fields.items()
    )
    return f"""<?xml version="1.0"?>
<VTKFile type="UnstructuredGrid" version="0.1" byte_order="LittleEndian"><UnstructuredGrid>
<Piece NumberOfPoints="{len(points)}" NumberOfCells="{len(cells)}">
<PointData>{arrays}{extra}</PointData>
<Points><DataArray type="Float64" NumberOfComponents="3" format="ascii">{numbers(points)}</DataArray></Points>
<Cells><DataArray type="Int64" Name="connectivity" format="ascii">{numbers(cells)}</DataArray>
<DataArray type="Int64" Name="offsets" format="ascii">{" ".join(str(size * (i + 1)) for i in range(len(cells)))}</DataArray>
<DataArray type="UInt8" Name="types" format="ascii">{" ".join([str(cell_type)] * len(cells))}</DataArray></Cells>
</Piece></UnstructuredGrid></VTKFile>
"""


class AppTest(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="tessera-app-test-"))
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)
        self.cube = self.write("cube.vtu", vtu_text())
        self.stokes = DATA / "freefem-stokes-sphere/stokes_p1.vtu"

    def write(self, name, text):
        path = self.folder / name
        if isinstance(text, bytes):
            path.write_bytes(text)
        else:
            path.write_text(text)
        return path

    def run_tessera(self, *arguments, **options):
        if not options:
            return FORKED.run(arguments, self.folder)
        return subprocess.run([TESSERA, *map(str, arguments)], capture_output=True, text=True, timeout=300, cwd=self.folder, **options)

    def succeed(self, *arguments, **options):
        result = self.run_tessera(*arguments, **options)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(result.stderr, "")
        return result.stdout

    def report(self, *arguments):
        return json.loads(self.succeed(*arguments, "--json", "-"))

    def reject(self, code, words, *arguments, **options):
        """Exit code, one line on stderr that holds every word, and no file more than before."""
        before = sorted(os.listdir(self.folder))
        result = self.run_tessera(*arguments, **options)
        lines = result.stderr.splitlines()
        self.assertEqual(result.returncode, code, f"{arguments}: {result.stderr}")
        self.assertEqual(len(lines), 1, result.stderr)
        self.assertTrue(lines[0].startswith("tessera: "), lines[0])
        for word in words.split():
            self.assertIn(word, lines[0])
        self.assertEqual(sorted(os.listdir(self.folder)), before)
        return lines[0]

    def resample_fails(self, words, mesh, *options, code=2):
        return self.reject(code, words, "resample", mesh, "-o", "out.vdb", *options)


class BadInput(AppTest):
    def test_missing_file(self):
        self.resample_fails("nothing.vtu", "nothing.vtu")
        self.reject(2, "nothing.vtu", "info", "nothing.vtu")
        self.reject(2, "nothing.vdb", "info", "nothing.vdb")
        self.reject(2, "nothing.vtu", "tets", "nothing.vtu", "-o", "tets.vtu")
        self.resample_fails("none_*.vtu", "none_*.vtu")

    def test_empty_file(self):
        for name in ("empty.vtu", "empty.vtk", "empty.pvtu", "empty.vts", "empty.ex2", "empty.node", "empty.pvd", "empty.case"):
            self.write(name, "")
            self.resample_fails(name, name)

    def test_truncated_file(self):
        whole = self.stokes.read_bytes()
        for share in (0.02, 0.3, 0.7, 0.999):
            self.write("cut.vtu", whole[: int(len(whole) * share)])
            self.resample_fails("cut.vtu", "cut.vtu")

    def test_garbage(self):
        garbage = bytes((i * 2654435761 >> 7) & 255 for i in range(5000))
        for name in ("garbage.vtu", "garbage.vtk", "garbage.ex2", "garbage.cgns"):
            self.write(name, garbage)
            self.resample_fails(name, name)
        self.write("other.vtu", "<?xml version='1.0'?><html><body/></html>")
        self.resample_fails("other.vtu", "other.vtu")

    def test_unknown_format(self):
        self.write("mesh.xyz", "1 2 3")
        self.resample_fails("mesh.xyz", "mesh.xyz")
        self.write("mesh", "hello")
        self.resample_fails("mesh", "mesh")

    def test_directory_as_mesh(self):
        (self.folder / "folder.vtu").mkdir()
        self.resample_fails("folder.vtu", "folder.vtu")

    def test_no_3d_cells(self):
        self.write("flat.vtu", vtu_text(cells=[(0, 1, 3), (0, 3, 2)], cell_type=5))
        self.resample_fails("flat.vtu tessera-tetrahedralize", "flat.vtu")

    def test_a_surface_where_nothing_makes_tetrahedra(self):
        """A program that stands alone: what it would start isn't beside it."""
        self.write("box.off", "OFF\n4 4 6\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n")
        alone = self.folder / "tessera"
        shutil.copy2(TESSERA, alone)
        before = sorted(os.listdir(self.folder))
        for command in (["resample", "box.off", "-o", "out.vdb"], ["info", "box.off"], ["verify", "box.off", "nothing.vdb"]):
            result = subprocess.run([alone, *command], cwd=self.folder, capture_output=True, text=True)
            self.assertEqual(result.returncode, 2, result.stderr)
            self.assertRegex(result.stderr, "^tessera: (box.off: a surface or points, no cells; tessera-tetrahedralize, .*isn't installed|nothing.vdb).*\n$")
        self.assertEqual(sorted(os.listdir(self.folder)), before)

    def test_no_such_field_lists_those_there(self):
        self.write("two.vtu", vtu_text(fields={"pressure": range(8), "heat": range(8)}))
        self.resample_fails("speed pressure heat", "two.vtu", "--field", "speed")
        self.resample_fails("heat pressure", "two.vtu", "--field", "pressure", "--refine", "error", "--max-error", "1%", "--error-field", "heat")

    def test_non_numeric_array(self):
        codes = " ".join(["65 0"] * 8)
        extra = f'<DataArray type="String" Name="label" format="ascii">{codes}</DataArray>'
        self.write("text.vtu", vtu_text(extra=extra))
        self.resample_fails("label", "text.vtu", "--field", "label")

    def test_node_index_out_of_range(self):
        for bad in (8, 1000000, -1):
            self.write("index.vtu", vtu_text(cells=[(0, 1, 3, bad)]))
            self.resample_fails("index.vtu", "index.vtu")

    def test_names_in_a_file_do_not_reach_the_terminal_as_controls(self):
        values = " ".join(map(str, range(8)))
        names = ["new&#10;line", "&#127;delete"]
        extra = "".join(f'<DataArray type="Float64" Name="{name}" format="ascii">{values}</DataArray>' for name in names)
        self.write("names.vtu", vtu_text(extra=extra))
        line = self.resample_fails("speed", "names.vtu", "--field", "speed")
        self.assertIn("delete", line)
        self.assertNotIn("\x7f", line)
        self.assertNotIn("\x7f", self.succeed("info", "names.vtu"))

    def test_coordinates_that_are_not_finite_name_the_node(self):
        for text in ("nan", "inf", "-inf"):
            points = [list(p) for p in CUBE_POINTS]
            points[5][1] = text
            self.write("bad.vtu", vtu_text(points=points, fields={"f": range(8)}))
            self.resample_fails("bad.vtu 5", "bad.vtu")

    def test_options_out_of_range(self):
        for options in (
            ["--spacing", "0"], ["--spacing", "-1"], ["--spacing", "nan"], ["--spacing", "inf"], ["--spacing", "abc"],
            ["--resolution", "0"], ["--resolution", "1"], ["--resolution", "-5"], ["--resolution", "1e3x"],
            ["--spacing", "0.1", "--resolution", "10"],
            ["--refine", "sometimes"], ["--refine", "uniform"], ["--refine", "error"],
            ["--refine", "error", "--max-error", "0"], ["--refine", "error", "--max-error", "-1%"],
            ["--refine", "error", "--max-error", "%"], ["--refine", "error", "--max-error", "nan"], ["--max-error", "1%"],
            ["--samples-per-element", "0"], ["--samples-per-element", "-2"], ["--max-levels", "0"], ["--max-levels", "99"],
            ["--brick-size", "7"], ["--brick-size", "128"], ["--max-voxels", "0"], ["--max-voxels", "x"], ["--max-memory", "-1G"],
            ["--max-memory", "1X"], ["--bounds", "0,0,0,1,1"], ["--bounds", "0,0,0,0,1,1"], ["--bounds", "0,0,0,a,1,1"],
            ["--layout", "round"], ["--extend", "-1"], ["--extend", "1000"], ["--background", "nan"], ["--unit-scale", "-1"], ["--unit-scale", "0"], ["--unit-scale", "1e31"],
            ["--unit-scale", "1e-31"], ["--background", "1e39"], ["--time-step", "-1"],
            ["--up-axis", "x"], ["--threads", "-1"], ["--threads", "many"], ["--field", ""], ["--field", "f,f"], ["--field", "=x"],
            ["--algorithm", "magic"], ["--sample-format", "r8"], ["--sample-format", "r64"], ["--gl", "osmesa"], ["--gl", "glx"], ["--algorithm", "hybrid-1999"],
            ["--time-step", "-3"], ["--error-field", "f"], ["--nonsense"],
        ):  # fmt: skip
            with self.subTest(options=options):
                # An option whose text begins with a dash must not be taken for another option, so it is joined with '='.
                self.resample_fails("", self.cube, *(options[:-2] + [f"{options[-2]}={options[-1]}"] if len(options) > 1 else options))

    def test_usage(self):
        self.reject(2, "subcommand")
        self.reject(2, "", "explode")
        self.reject(2, "", "resample")
        self.reject(2, "output", "resample", self.cube)
        self.reject(2, "", "verify", self.cube)
        self.reject(2, "", "tets", self.cube)
        self.reject(2, "", "resample", self.cube, "another.vtu", "-o", "out.vdb")

    def test_budget_exceeded_says_what_fits(self):
        line = self.resample_fails("", self.cube, "--refine", "uniform", "--spacing", "0.001", "--max-voxels", "1M")
        self.assertRegex(line, r"\d")
        self.resample_fails("", self.cube, "--refine", "uniform", "--spacing", "0.001", "--max-memory", "1M")

    def test_bounds_beside_the_mesh(self):
        self.resample_fails("", self.cube, "--bounds", "5,5,5,6,6,6")

    def test_lengths_beyond_what_can_be_computed_with_are_refused(self):
        for scale, words in ((3e-323, "spacing small"), (1e-310, "spacing small"), (1e-200, "spacing small"), (1e200, "spacing large"), (1.7e308, "spacing large")):
            mesh = self.write("scaled.vtu", vtu_text([[scale * x for x in p] for p in CUBE_POINTS], fields={"f": range(8)}))
            path = self.write("path.txt", f"{scale / 2} {scale / 2} {scale / 2}\n")
            for options in ([], ["--refine", "uniform", "--resolution", "20"], ["--refine", "error", "--max-error", "1%"]):
                self.resample_fails(words, mesh, *options)
            self.reject(2, words, "slice", mesh, "-o", "cut.exr")
            self.reject(2, words, "compare", mesh, "--resolution", "16", "--algorithms", "software", "--runs", "1")
            self.reject(2, words, "focus-trace", mesh, "--path", path, "--radius", "1")
            self.reject(2, words, "render", mesh, "-o", "picture.png")
            self.succeed("info", mesh)

    def test_lengths_that_devices_do_not_know_are_told(self):
        mesh = self.write("scaled.vtu", vtu_text([[1e-60 * x for x in p] for p in CUBE_POINTS], fields={"f": range(8)}))
        self.reject(2, "scaled.vtu 1e-60 long", "render", mesh, "-o", "picture.png")

    def test_names_of_any_kind_are_one_line(self):
        self.succeed("resample", self.cube, "-o", "cube.vdb", "--refine", "uniform", "--resolution", "9")
        outputs = {".vdb": ["resample", self.cube, "--quiet", "-o"], ".png": ["picture", "cube.vdb", "-o"], ".json": ["info", self.cube, "--json"],
                   ".log": ["resample", self.cube, "-o", "out.vdb", "--quiet", "--resume"]}  # fmt: skip
        for stem in ("n" * 300, "d/" * 2500 + "n", "no\nsuch\x1b[31m\x7f"):
            for arguments in (
                ["info", stem + ".vtu"], ["info", stem + ".pvd"], ["resample", stem + ".pvd", "-o", "out.vdb"], ["tets", stem + ".foam", "-o", "out.vtu"],
                ["resample", self.cube, stem + ".vtu", "-o", "out_#.vdb"], ["resample", self.cube, "-o", "out.vdb", "--like", stem + ".vdb"],
                ["verify", stem + ".pvd", "cube.vdb"], ["verify", self.cube, stem + ".vdb"], ["picture", "cube.vdb", "-o", "out.png", "--mesh", stem + ".case"],
                ["render", "cube.vdb", "-o", "out.png", "--scene", stem + ".json"], ["focus-trace", self.cube, "--radius", "1", "--path", stem + ".txt"],
                ["resample", self.cube, "-o", "out.vdb", "--refine", "focus,visibility", "--focus", "0,0,0", "--radius", "1",
                 "--transfer-function", stem + ".json"],
            ):  # fmt: skip
                line = self.reject(2, "", *arguments)
                self.assertLessEqual(len(line), 1000)
                self.assertFalse(re.search("[\x00-\x1f\x7f]", line), line)
            for ending, arguments in outputs.items() if len(stem) > 255 else ():
                self.assertLessEqual(len(self.reject(1, "", *arguments, stem + ending)), 1000)

    def test_a_long_name_of_a_field_is_written_and_verified(self):
        name = "f" * 200_000
        mesh = self.write("long.vtu", vtu_text(fields={name: range(8)}))
        self.succeed("resample", mesh, "-o", "long.vdb", "--refine", "uniform", "--resolution", "9", "--quiet")
        self.succeed("verify", mesh, "long.vdb")
        self.succeed("picture", "long.vdb", "-o", "slice.png", "--mesh", mesh)
        self.succeed("slice", mesh, "-o", "cut.png", "--resolution", "20")

    def test_a_vdb_file_of_another_program_is_one_line(self):
        self.succeed("resample", self.cube, "-o", "cube.vdb", "--refine", "uniform", "--resolution", "9")
        try:
            import pyopenvdb
        except ImportError:
            self.skipTest("Python has no pyopenvdb")
        grid = pyopenvdb.FloatGrid()
        grid.fill((0, 0, 0), (5, 5, 5), 1.0)
        pyopenvdb.write(str(self.folder / "other.vdb"), grids=[grid])
        for arguments in (["info", "other.vdb"], ["verify", self.cube, "other.vdb"], ["picture", "other.vdb", "-o", "out.png"],
                          ["render", "other.vdb", "-o", "out.png"], ["render", "other.vdb", "cube.vdb", "-o", "out_#.png"]):  # fmt: skip
            self.reject(2, "other.vdb not written by Tessera", *arguments)

    def test_like_needs_a_vdb_file(self):
        self.resample_fails("nothing.vdb", self.cube, "--like", "nothing.vdb")
        self.resample_fails("cube.vtu", self.cube, "--like", self.cube)

    def test_series_needs_a_numbered_output(self):
        self.write("run_0.vtu", vtu_text())
        self.write("run_1.vtu", vtu_text())
        self.resample_fails("####", "run_*.vtu")

    def test_output_may_not_replace_the_input(self):
        self.reject(2, "cube.vtu", "resample", self.cube, "-o", self.cube)
        self.assertIn("VTKFile", self.cube.read_text())

    def test_no_output_may_replace_an_input_or_another_output(self):
        self.succeed("resample", self.cube, "-o", "good.vdb", "--refine", "uniform", "--resolution", "20", "--quiet")
        os.symlink("good.vdb", self.folder / "link.vdb")
        os.symlink("new.vdb", self.folder / "dangling.vdb")
        files = {name: (self.folder / name).read_bytes() for name in ("cube.vtu", "good.vdb")}
        for arguments in (
            ["resample", self.cube, "-o", "out.vdb", "--json", "cube.vtu"],
            ["resample", self.cube, "-o", "out.vdb", "--json", "./out.vdb"],
            ["resample", self.cube, "-o", "new.vdb", "--json", "dangling.vdb"],
            ["resample", self.cube, "--dry-run", "--json", "cube.vtu"],
            ["resample", self.cube, "-o", "out.vdb", "--like", "good.vdb", "--json", "good.vdb"],
            ["resample", self.cube, "-o", "link.vdb", "--like", "good.vdb"],
            ["info", "cube.vtu", "--json", self.cube],
            ["info", "good.vdb", "--json", "link.vdb"],
            ["verify", self.cube, "good.vdb", "--json", "good.vdb"],
            ["verify", self.cube, "good.vdb", "--json", "cube.vtu"],
            ["tets", self.cube, "-o", "cube.vtu"],
            ["tets", self.cube, "-o", "tets.vtu", "--json", "tets.vtu"],
            ["picture", "good.vdb", "-o", "good.vdb"],
            ["picture", "good.vdb", "-o", "cube.vtu", "--mesh", "cube.vtu"],
            ["picture", "good.vdb", "-o", "slice.png", "--json", "slice.png"],
        ):  # fmt: skip
            with self.subTest(arguments=arguments):
                self.reject(2, "would replace", *arguments)
                for name, content in files.items():
                    self.assertEqual((self.folder / name).read_bytes(), content)

    def test_picture_beside_the_mesh(self):
        self.succeed("resample", self.cube, "-o", "good.vdb", "--refine", "uniform", "--resolution", "20", "--quiet")
        self.reject(2, "good.vdb plane nothing", "picture", "good.vdb", "-o", "slice.png", "--at", "5")

    def test_damaged_vdb(self):
        self.succeed("resample", self.cube, "-o", "good.vdb", "--refine", "uniform", "--resolution", "20", "--quiet")
        whole = (self.folder / "good.vdb").read_bytes()
        self.write("cut.vdb", whole[: len(whole) // 2])
        self.reject(2, "cut.vdb", "info", "cut.vdb")
        self.reject(2, "cut.vdb", "verify", self.cube, "cut.vdb")
        self.write("noise.vdb", b"noise" * 100)
        self.reject(2, "noise.vdb", "info", "noise.vdb")


class Repair(AppTest):
    """The unit cube in two halves whose diagonals cross at z = 1/2, a flat sliver between them, and a lone needle."""

    def setUp(self):
        super().setUp()
        points = [(x, y, z) for z in (0, 0.5, 1) for y in (0, 1) for x in (0, 1)]
        lower = [(0, 1, 3, 7), (0, 3, 2, 7), (0, 2, 6, 7), (0, 6, 4, 7), (0, 4, 5, 7), (0, 5, 1, 7)]  # diagonal 4-7 on top
        upper = [(5, 6, 8, 11), (4, 5, 6, 8), (7, 6, 5, 11), (9, 5, 8, 11), (10, 6, 8, 11)]  # diagonal 5-6 below
        points += [(3, 0, 0), (3 + 1e-9, 0, 0), (3, 1e-9, 0), (3, 0, 1)]
        self.cells = lower + upper + [(4, 5, 7, 6), (12, 13, 14, 15)]
        self.thin = self.write("thin.vtu", vtu_text(points, self.cells, fields={"f": [p[0] + p[2] for p in points]}))

    def test_counts_classes_without_a_repair(self):
        report = self.report("info", self.thin)
        self.assertEqual(report["classes"]["counts"]["flat"], 1)
        self.assertEqual(report["classes"]["counts"]["needle"], 1)
        self.assertNotIn("repair", report)
        self.assertIn("1 needle, 1 flat", self.succeed("info", self.thin))

    def test_removes_them_and_says_so(self):
        repair = self.report("tets", self.thin, "-o", "tets.vtu", "--repair")["repair"]
        self.assertEqual(repair["before"]["flat"], 1)
        self.assertEqual(sum(n for name, n in repair["after"].items() if name != "good"), 0)
        self.assertEqual(repair["operations"]["edge_pair_splits"], 1)
        self.assertEqual(repair["operations"]["dropped"], 1)
        self.assertAlmostEqual(repair["volume"][1], 1, 12)
        again = self.report("info", "tets.vtu", "--repair")
        self.assertFalse(again["repair"]["changed"])
        self.assertEqual(again["mesh"]["non_conforming_faces"], 0)
        self.assertEqual(again["mesh"]["inverted_elements"], 0)
        self.assertIn("class", self.succeed("info", self.thin, "--repair"))

    def test_verify_repairs_as_the_file_was(self):
        self.succeed("resample", self.thin, "-o", "out.vdb", "--repair", "--refine", "uniform", "--resolution", "20")
        self.assertIn("repaired", self.succeed("info", "out.vdb"))
        self.assertEqual(self.report("info", "out.vdb")["repair"]["min_aspect"], 1e-6)
        verified = self.report("verify", self.thin, "out.vdb")
        self.assertTrue(verified["holds"])
        self.assertEqual(verified["repair"]["before"]["flat"], 1)
        self.succeed("resample", self.thin, "-o", "plain.vdb", "--refine", "uniform", "--resolution", "20")
        self.assertNotIn("repair", self.report("info", "plain.vdb"))
        self.assertNotIn("repair", self.report("verify", self.thin, "plain.vdb"))

    def test_slice_and_compare_repair_too(self):
        report = self.report("slice", self.thin, "-o", "cut.exr", "--resolution", "16", "--repair")
        self.assertEqual(report["repair"]["before"]["flat"], 1)
        report = self.report("compare", self.thin, "--algorithms", "software", "--resolution", "16", "--runs", "1", "--repair")
        self.assertEqual(report["meshes"][0]["repair"]["before"]["flat"], 1)

    def test_bound_on_volume_keeps_elements_and_warns(self):
        result = self.run_tessera("info", self.thin, "--repair", "--repair-aspect", "0.5", "--json", "-")
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("warning", result.stderr)
        self.assertIn("--repair-max-volume-loss", result.stderr)
        repair = json.loads(result.stdout)["repair"]
        self.assertGreater(sum(repair["kept"].values()), 0)
        self.assertLess(abs(repair["volume"][1] / repair["volume"][0] - 1), 1.001e-6)

    def test_every_command_that_repairs_warns(self):
        options = ["--repair", "--repair-aspect", "0.5"]
        self.run_tessera("resample", self.thin, "-o", "out.vdb", "--refine", "uniform", "--resolution", "20", *options)
        for command in (
            ["info", self.thin, *options], ["tets", self.thin, "-o", "tets.vtu", *options], ["verify", self.thin, "out.vdb"],
            ["picture", "out.vdb", "-o", "slice.png", "--mesh", self.thin],
        ):  # fmt: skip
            with self.subTest(command=command[0]):
                result = self.run_tessera(*command)
                self.assertEqual(result.returncode, 0, result.stderr)
                self.assertRegex(result.stderr, r"warning: .*thin.vtu: \d+ degenerate elements stay")

    def test_a_repair_that_leaves_nothing_is_an_error(self):
        self.write("needle.vtu", vtu_text([(0, 0, 0), (1e-9, 0, 0), (0, 1e-9, 0), (0, 0, 1)], [(0, 1, 2, 3)]))
        self.reject(2, "needle.vtu --repair-aspect", "info", "needle.vtu", "--repair", "--repair-max-volume-loss", "100%")

    def test_options_out_of_range(self):
        self.reject(2, "--repair-aspect", "info", self.thin, "--repair-aspect", "1e-3")
        line = self.reject(2, "--repair-aspect", "info", self.thin, "--repair", "--repair-aspect", "0")
        self.assertIn("expected 1e-12 to 0.5, got '0'", line)
        self.reject(2, "--repair-aspect", "info", self.thin, "--repair", "--repair-aspect", "thin")
        self.reject(2, "--repair-max-volume-loss", "info", self.thin, "--repair", "--repair-max-volume-loss", "2")


class Outputs(AppTest):
    """What an output's name says."""

    COARSE = ("--refine", "uniform", "--resolution", "9", "--quiet")

    def test_other_endings_are_refused_before_any_work(self):
        for name in ("x", "x.h5", "x.jpg", "x.vdb.gz", "x.", ".vdb", "vdb", "x.vt", "x_####", "/dev/stdout"):
            self.reject(2, ".vdb .nvdb .vti", "resample", "nothing.vtu", "-o", name)
        self.reject(2, ".vdb .nvdb .vti", "resample", "nothing.vtu", "-o", "x.h5", "--dry-run")
        self.reject(2, ".exr .png .jpg", "slice", "nothing.vtu", "-o", "x.jpg")
        self.reject(2, ".vtu .vtk", "tets", "nothing.vtu", "-o", "x.vtk")
        self.reject(2, ".png .jpg", "picture", "nothing.vdb", "-o", "x.jpg")

    def test_each_ending_is_that_format_in_upper_case_too(self):
        for name, head in (("a.vdb", b" BDV"), ("a.nvdb", b"NanoVDB0"), ("a.vti", b"<?xml"), ("b.VDB", b" BDV"), ("b.Nvdb", b"NanoVDB0"), ("b.VTI", b"<?xml")):
            self.succeed("resample", self.cube, "-o", name, *self.COARSE)
            self.assertTrue((self.folder / name).read_bytes().startswith(head), name)
        self.succeed("tets", self.cube, "-o", "tets.VTU", "--quiet")
        self.succeed("picture", "a.vdb", "-o", "slice.PNG", "--quiet")

    def test_formats_without_levels_are_flat(self):
        for ending in ("nvdb", "vti"):
            report = self.report("resample", self.cube, "-o", f"a.{ending}", *self.COARSE)
            self.assertEqual((report["layout"], report["output"]), ("flat", f"a.{ending}"))
            self.assertGreater(report["write"]["active_voxels"], 9**3)  # with the extension
            self.assertEqual(report["write"]["file_bytes"], (self.folder / f"a.{ending}").stat().st_size)
            self.succeed("resample", self.cube, "-o", f"b.{ending}", "--layout", "flat", *self.COARSE)
            self.assertEqual((self.folder / f"a.{ending}").read_bytes(), (self.folder / f"b.{ending}").read_bytes())
            self.reject(2, f"--layout levels .{ending} .vdb", "resample", self.cube, "-o", f"c.{ending}", "--layout", "levels")
            self.reject(2, f"--half .{ending}", "resample", self.cube, "-o", f"c.{ending}", "--half")
        self.reject(2, "--up-axis .vti", "resample", self.cube, "-o", "c.vti", "--up-axis", "y")
        self.assertEqual(self.report("resample", self.cube, "-o", "a.vdb", *self.COARSE)["layout"], "levels")

    def test_an_image_lies_over_its_mesh(self):
        self.succeed("resample", self.stokes, "-o", "a.vti", "--refine", "uniform", "--resolution", "30", "--extend", "0", "--quiet")
        mesh, image = self.report("info", self.stokes)["mesh"], self.report("info", "a.vti")["mesh"]
        (low, high), (first, last) = mesh["bounds"], image["bounds"]
        spacing = max(b - a for a, b in zip(low, high)) / 29
        for a, b, c, d in zip(low, first, high, last):
            # Every lattice point in the mesh is in the image, and no other.
            self.assertTrue(0 <= b - a < spacing and 0 <= c - d < spacing, (a, b, c, d))

    def test_a_series_of_images(self):
        for i in range(2):
            self.write(f"run_{i}.vtu", vtu_text())
        self.succeed("resample", "run_0.vtu", "run_1.vtu", "-o", "out_####.vti", *self.COARSE)
        self.assertTrue((self.folder / "out_0000.vti").exists() and (self.folder / "out_0001.vti").exists())

    def test_standard_output_gets_the_file_and_nothing_else(self):
        self.succeed("resample", self.cube, "-o", "a.vdb", *self.COARSE)
        for command, names in (
            (["resample", self.cube, *self.COARSE[:-1]], ("a.vdb", "a.nvdb", "a.vti")),
            (["slice", self.cube, "--resolution", "20"], ("a.exr", "a.png")),
            (["tets", self.cube], ("a.vtu",)),
            (["picture", "a.vdb"], ("b.png",)),
        ):
            for i, name in enumerate(names):
                with self.subTest(command=command, name=name):
                    self.succeed(*command, "-o", name, "--quiet")
                    whole = (self.folder / name).read_bytes()
                    kind = name.partition(".")[2]
                    for extra in ([["--format", kind]] if len(names) > 1 else []) + ([[]] if i == 0 else []):
                        result = subprocess.run([TESSERA, *map(str, command), "-o", "-", *extra], capture_output=True, timeout=300, cwd=self.folder)
                        self.assertEqual((result.returncode, result.stderr), (0, b""))
                        self.assertEqual(result.stdout, whole)
        self.assertNotIn("-", os.listdir(self.folder))

    def test_standard_output_is_for_one_thing(self):
        for command in (["resample", self.cube], ["slice", self.cube], ["tets", self.cube], ["picture", "a.vdb"]):
            self.reject(2, "--output --json standard", *command, "-o", "-", "--json", "-")
        self.reject(2, "--format a.vdb", "resample", self.cube, "-o", "a.vdb", "--format", "vti")
        self.reject(2, "--format", "resample", self.cube, "-o", "-", "--format", "h5")
        self.succeed("resample", self.cube, "-o", "-", "--dry-run")
        self.write("run_0.vtu", vtu_text())
        self.reject(2, "%04d", "resample", self.cube, "run_0.vtu", "-o", "-")

    def test_standard_output_that_takes_no_file(self):
        command = [TESSERA, "resample", str(self.cube), "-o", "-", *self.COARSE]
        terminal, other = os.openpty()
        result = subprocess.run(command, stdout=other, stderr=subprocess.PIPE, text=True, cwd=self.folder, timeout=300)
        os.close(terminal)
        os.close(other)
        self.assertEqual(result.returncode, 2)
        self.assertIn("terminal", result.stderr)
        ended, other = os.pipe()
        os.close(ended)  # whoever reads has gone
        result = subprocess.run(command, stdout=other, stderr=subprocess.PIPE, text=True, cwd=self.folder, timeout=300)
        os.close(other)
        self.assertEqual((result.returncode, result.stderr), (1, ""))
        with open("/dev/full", "w") as full:
            result = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, cwd=self.folder, timeout=300)
        self.assertEqual(result.returncode, 1)
        self.assertRegex(result.stderr, r"^tessera: can't write standard output: No space left.*\n$")
        result = subprocess.run(command, stderr=subprocess.PIPE, text=True, cwd=self.folder, timeout=300, preexec_fn=lambda: os.close(1))
        self.assertEqual(result.returncode, 1)
        self.assertIn("standard output: Bad file", result.stderr)

    def test_an_interrupt_ends_a_run_whose_reader_is_stuck(self):
        command = [TESSERA, "resample", str(self.stokes), "-o", "-", "--quiet"]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, cwd=self.folder)
        self.addCleanup(process.kill)
        self.assertEqual(process.stdout.read(4), b" BDV")  # and then nothing more of the megabytes that follow
        process.send_signal(signal.SIGTERM)
        self.assertEqual(process.wait(timeout=60), 143)
        process.stdout.close()
        process.stderr.close()

    def test_nanovdb_files_are_not_read(self):
        self.succeed("resample", self.cube, "-o", "a.nvdb", *self.COARSE)
        for command in (["info", "a.nvdb"], ["resample", "a.nvdb", "-o", "b.vdb"], ["verify", self.cube, "a.nvdb"], ["picture", "a.nvdb", "-o", "a.png"]):
            self.reject(2, "a.nvdb NanoVDB .vdb", *command)

    def test_disk_full_leaves_nothing(self):
        def limit():
            resource.setrlimit(resource.RLIMIT_FSIZE, (20000, 20000))

        for name in ("out.vti", "out.nvdb"):
            self.reject(1, name, "resample", self.stokes, "-o", name, "--quiet", "--refine", "uniform", "--resolution", "60", preexec_fn=limit)


class FailingOutputs(AppTest):
    def test_not_writable(self):
        (self.folder / "folder.vdb").mkdir()
        self.reject(1, "nowhere/out.vdb", "resample", self.cube, "-o", "nowhere/out.vdb")
        self.reject(1, "folder.vdb", "resample", self.cube, "-o", "folder.vdb")
        self.reject(1, "nowhere/tets.vtu", "tets", self.cube, "-o", "nowhere/tets.vtu")
        self.reject(1, "nowhere/report.json", "resample", self.cube, "-o", "out.vdb", "--json", "nowhere/report.json")

    def test_disk_full(self):
        def limit():
            resource.setrlimit(resource.RLIMIT_FSIZE, (20000, 20000))

        self.reject(1, "out.vdb", "resample", self.stokes, "-o", "out.vdb", "--quiet", preexec_fn=limit)
        self.reject(1, "tets.vtu", "tets", self.stokes, "-o", "tets.vtu", "--quiet", preexec_fn=limit)

    def test_disk_full_on_a_small_file_system(self):
        small = self.folder / "small"
        small.mkdir()
        if os.geteuid() != 0 or subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64k", "none", small], capture_output=True).returncode:
            self.skipTest("mounting a small file system needs root")
        try:
            self.reject(1, "out.vdb", "resample", self.stokes, "-o", "small/out.vdb", "--quiet")
            self.assertEqual(os.listdir(small), [])
        finally:
            subprocess.run(["umount", small], check=True)

    def test_failure_leaves_the_old_file(self):
        self.write("out.vdb", "old")
        self.reject(2, "", "resample", "nothing.vtu", "-o", "out.vdb")
        self.assertEqual((self.folder / "out.vdb").read_text(), "old")

    def test_links_are_followed(self):
        self.succeed("resample", self.cube, "-o", "cube.vdb", "--refine", "uniform", "--resolution", "9")
        (self.folder / "below").mkdir()
        for ending, arguments in {".vdb": ["resample", self.cube, "--quiet", "-o"], ".vtu": ["tets", self.cube, "--quiet", "-o"],
                                  ".png": ["picture", "cube.vdb", "--quiet", "-o"], ".json": ["info", self.cube, "--json"]}.items():  # fmt: skip
            link, second, file = self.folder / ("link" + ending), self.folder / "below/link", self.folder / "below" / ("file" + ending)
            for target in (second, pathlib.Path("below/link")):
                link.symlink_to(target)
                second.symlink_to(file.name)
                self.succeed(*arguments, link.name)
                self.assertTrue(link.is_symlink() and second.is_symlink() and file.is_file() and not file.is_symlink())
                self.assertEqual(sorted(os.listdir(self.folder / "below")), sorted([file.name, "link"]))
                link.unlink(), second.unlink(), file.unlink()
            link.symlink_to(second)
            second.symlink_to(link)
            self.reject(1, f"{link.name} links", *arguments, link.name)
            link.unlink(), second.unlink()

    def test_standard_output_that_takes_nothing(self):
        self.succeed("resample", self.cube, "-o", "cube.vdb", "--refine", "uniform", "--resolution", "9")
        for command in (
            ["info", self.cube], ["info", "cube.vdb"], ["info", self.cube, "--json", "-"], ["verify", self.cube, "cube.vdb"],
            ["slice", self.cube, "-o", "cut.exr", "--resolution", "8"], ["tets", self.cube, "-o", "tets.vtu"],
            ["resample", self.cube, "-o", "out.vdb"], ["picture", "cube.vdb", "-o", "slice.png"],
            ["compare", self.cube, "--algorithms", "software", "--resolution", "8", "--runs", "1"], ["--help"], ["info", "--help"], ["--version"],
        ):  # fmt: skip
            for words, options in (("No space left", {"stdout": "/dev/full"}), ("Bad file", {"stdout": None})):
                with self.subTest(command=command, **options):
                    result = self.run_with_output(options["stdout"], *command)
                    self.assertEqual(result.returncode, 1, result.stderr)
                    self.assertEqual(len(result.stderr.splitlines()), 1, result.stderr)
                    self.assertIn("tessera: standard output", result.stderr)
                    self.assertIn(words, result.stderr)
        self.assertEqual(self.run_with_output("/dev/full", "info", self.cube, "--quiet").returncode, 0)

    def run_with_output(self, path, *arguments):
        """A run whose standard output is this file, or closed for None."""
        with open(path or os.devnull, "w") as output:
            prepare = None if path else (lambda: os.close(1))
            return subprocess.run([TESSERA, *map(str, arguments)], stdout=output, stderr=subprocess.PIPE, text=True, timeout=300, cwd=self.folder,
                                  preexec_fn=prepare)  # fmt: skip

    def test_closed_streams_leave_files_whole(self):
        arguments = [TESSERA, "resample", self.stokes, "-o", "out.vdb"]
        subprocess.run([*map(str, arguments), "--quiet"], check=True, cwd=self.folder)
        whole = (self.folder / "out.vdb").read_bytes()
        result = subprocess.run([*map(str, arguments)], cwd=self.folder, preexec_fn=lambda: os.closerange(0, 3))
        self.assertEqual(result.returncode, 1)
        self.assertEqual((self.folder / "out.vdb").read_bytes(), whole)

    def test_out_of_memory(self):
        def limit():
            resource.setrlimit(resource.RLIMIT_AS, (1500 << 20, 1500 << 20))

        self.reject(1, "memory", "resample", self.stokes, "-o", "out.vdb", "--quiet", "--refine", "uniform", "--resolution", "900",
                  "--max-voxels", "4G", "--max-memory", "64G", "--threads", "1", preexec_fn=limit)  # fmt: skip


class Interruption(AppTest):
    def start_long_run(self):
        arguments = ["resample", self.stokes, "-o", "out.vdb", "--quiet", "--refine", "uniform", "--resolution", "500", "--threads", "1"]
        process = subprocess.Popen([TESSERA, *map(str, arguments)], cwd=self.folder, stderr=subprocess.PIPE, text=True)
        self.addCleanup(process.kill)
        # On a busy machine loading the libraries takes a while; before main runs, a signal simply kills.
        end = time.time() + 60
        while time.time() < end and process.poll() is None and not catches(process.pid, signal.SIGTERM):
            time.sleep(0.01)
        return process

    def finish(self, process, code):
        _, errors = process.communicate(timeout=60)
        self.assertEqual(process.returncode, code, errors)
        self.assertEqual(len(errors.splitlines()), 1, errors)
        self.assertEqual(os.listdir(self.folder), ["cube.vtu"])

    def test_a_signal_before_main_is_one_line(self):
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            for _ in range(3):
                process = subprocess.Popen([TESSERA, "info", self.stokes], cwd=self.folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
                self.addCleanup(process.kill)
                while process.poll() is None and not catches(process.pid, number):
                    pass  # until the libraries are loaded it has no handler
                process.send_signal(number)
                self.finish(process, 128 + number)

    def test_a_program_that_outlives_its_terminal(self):
        process = subprocess.Popen([TESSERA, "info", self.stokes], cwd=self.folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                                   preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_IGN))  # fmt: skip
        while process.poll() is None:
            process.send_signal(signal.SIGHUP)
            time.sleep(0.005)
        _, errors = process.communicate(timeout=60)
        self.assertEqual((process.returncode, errors), (0, b""))

    def test_interrupt_while_sampling(self):
        for number, code in ((signal.SIGINT, 130), (signal.SIGTERM, 143)):
            process = self.start_long_run()
            time.sleep(0.4)
            self.assertIsNone(process.poll(), "the run ended before it could be interrupted")
            process.send_signal(number)
            self.finish(process, code)

    def test_interrupt_while_writing(self):
        process = self.start_long_run()
        # The unfinished file is a hidden one; the check for a writable output makes one too, but that is gone at once.
        end = time.time() + 120
        while time.time() < end and process.poll() is None:
            if any(f.startswith(".out") and (self.folder / f).stat().st_size > 0 for f in list_quietly(self.folder)):
                break
            time.sleep(0.005)
        self.assertIsNone(process.poll(), "the run ended before it could be interrupted")
        process.send_signal(signal.SIGINT)
        self.finish(process, 130)


def list_quietly(folder):
    return [f for f in os.listdir(folder) if (folder / f).exists()]


class Reports(AppTest):
    def test_defaults_give_a_report(self):
        text = self.succeed("resample", self.stokes, "-o", "out.vdb", "--json", "report.json")
        self.assertIn("pressure", text)
        report = json.loads((self.folder / "report.json").read_text())
        self.check_schema(report)
        self.assertEqual(report["mesh"]["elements"], 18598)
        self.assertEqual(report["mesh"]["skipped_cells"], 1156)
        self.assertEqual(sum(report["bricks"]["per_level"]), report["bricks"]["total"])
        cells = report["lattice"]["brick_cells"]
        self.assertEqual(report["voxels"]["per_level"], [n * cells**3 for n in report["bricks"]["per_level"]])
        self.assertEqual(report["voxels"]["covered_total"], report["coverage"]["covered_points"])
        for error in report["error"].values():
            self.assertLessEqual(error["rms"], error["max"])
            self.assertLessEqual(error["p999"], error["max"])
            if error["range"] > 0:
                self.assertAlmostEqual(error["relative_max"] * error["range"], error["max"], delta=1e-12 * error["range"])

    def check_schema(self, report):
        for key in ("schema", "program", "version", "command", "input", "output", "algorithm", "criterion", "layout", "threads", "stages",
                    "mesh", "lattice", "bricks", "voxels", "coverage", "error", "statistics", "write", "peak_memory_bytes"):  # fmt: skip
            self.assertIn(key, report)
        for stage in ("read", "plan", "resample", "verify", "write"):
            self.assertGreaterEqual(report["stages"][stage], 0)
        self.assertEqual(set(report["error"]), {"pressure", "velocity", "Label"})
        for error in report["error"].values():
            for key in ("max", "p999", "rms", "relative_max", "relative_p999", "relative_rms", "range", "samples", "worst_place"):
                self.assertIn(key, error)
        self.assertGreater(report["peak_memory_bytes"], 1 << 20)

    def test_json_on_standard_output_is_all_there_is(self):
        report = self.report("resample", self.cube, "-o", "out.vdb", "--refine", "uniform", "--resolution", "17")
        self.assertEqual(report["lattice"]["spacing"], 1 / 16)
        self.assertLess(report["error"]["f"]["max"], 1e-6)
        self.assertAlmostEqual(report["error"]["f"]["integral_mesh"][0], 0.5, places=12)
        self.assertEqual(report["coverage"]["covered_points"], 17**3)

    def test_quiet_prints_nothing(self):
        self.assertEqual(self.succeed("resample", self.cube, "-o", "out.vdb", "--quiet"), "")

    def test_an_unmet_bound_is_a_warning(self):
        arguments = ("resample", self.stokes, "-o", "out.vdb", "--refine", "error", "--max-error", "0.0001%", "--max-voxels", "200K")
        for extra in ([], ["--dry-run"]):
            result = self.run_tessera(*arguments, "--quiet", *extra)
            self.assertEqual((result.returncode, result.stdout), (0, ""), result.stderr)
            self.assertEqual(len(result.stderr.splitlines()), 1, result.stderr)
            self.assertRegex(result.stderr, r"^tessera: warning: .*not within the bound: .")
            (self.folder / "out.vdb").unlink(missing_ok=True)
            loud = self.run_tessera(*arguments, "--strict", *extra)
            self.assertEqual(loud.returncode, 3)
            self.assertEqual(loud.stderr, result.stderr)
            self.assertNotIn("within the bound", loud.stdout)
            self.assertEqual((self.folder / "out.vdb").exists(), not extra)
        self.succeed("resample", self.cube, "-o", "out.vdb", "--refine", "error", "--max-error", "5%", "--strict")

    def test_a_coarser_grid_is_a_warning(self):
        for extra in ([], ["--dry-run"]):
            # test_flat_grid_is_capped_and_says_so takes the cap that there is without --max-voxels, which is a large grid.
            result = self.run_tessera(
                "resample", self.stokes, "-o", "out.vdb", "--layout", "flat", "--max-voxels", "2M", "--quiet", "--strict", *extra)  # fmt: skip
            self.assertEqual((result.returncode, result.stdout), (3, ""), result.stderr)
            self.assertEqual(len(result.stderr.splitlines()), 1, result.stderr)
            self.assertRegex(result.stderr, r"^tessera: warning: .*stokes_p1.vtu: .*the flat grid has spacing")

    def test_warnings_on_the_input_are_gathered_and_no_matter_for_quiet(self):
        wide = "".join(f'<DataArray type="Float64" Name="w{i}" NumberOfComponents="10" format="ascii">{"0 " * 80}</DataArray>' for i in range(12))
        self.write("wide.vtu", vtu_text(extra=wide))
        text = self.succeed("resample", "wide.vtu", "-o", "out.vdb")
        lines = [line for line in text.splitlines() if "warning" in line]
        self.assertEqual(len(lines), 1, text)
        self.assertRegex(lines[0], "12 fields are left out: .*: w0, w1, w10, .* and 4 more")
        self.assertEqual(self.succeed("resample", "wide.vtu", "-o", "out.vdb", "--quiet"), "")
        for step in range(3):
            self.write(f"wide_{step}.vtu", vtu_text(extra=wide))
        self.assertEqual(self.succeed("resample", "wide_?.vtu", "-o", "out_#.vdb").count("warning"), 1)
        result = self.run_tessera("info", self.cube, "--repair", "--repair-aspect", "0.5", "--quiet")
        self.assertEqual((result.returncode, result.stderr), (0, ""))

    def test_cell_types_and_what_became_of_them(self):
        self.write("hex.vtu", vtu_text(cells=[(0, 1, 3, 2, 4, 5, 7, 6)], cell_type=12))
        self.assertIn("1 hexahedra, split into 6 tetrahedra (linear between corners", self.succeed("info", "hex.vtu").replace("\n", " "))
        types = self.report("info", "hex.vtu")["mesh"]["cell_types"]
        self.assertEqual(types, {"tetrahedra": 0, "pyramids": 0, "wedges": 0, "hexahedra": 1, "voxels": 0, "polyhedra": 0})
        text = self.succeed("info", DATA / "ccx-cavity/cavity.vtu")
        self.assertIn("25,535 tetrahedra, of higher order and read by their corners", text)
        self.assertNotIn("warning", text)
        self.write("turned.vtu", vtu_text(cells=[(1, 0, 3, 7), *CUBE_TETS[1:]]))
        self.assertIn("1 elements have the other orientation, which changes nothing", self.succeed("info", "turned.vtu"))

    def test_fields_of_one_name_get_names_of_their_own(self):
        array = '<DataArray type="Float64" Name="{}" format="ascii">{}</DataArray>'
        extra = "".join(array.format(name, " ".join([value] * 8)) for name, value in (("f", "7"), ("g", "3"), ("f", "9")))
        self.write("twice.vtu", vtu_text(extra=extra))
        mesh = self.report("info", "twice.vtu")["mesh"]
        self.assertEqual({f["name"]: f["ranges"] for f in mesh["fields"]}, {"f": [[0, 1]], "f_2": [[7, 7]], "g": [[3, 3]], "f_3": [[9, 9]]})
        self.assertEqual(len(mesh["warnings"]), 1)
        self.assertRegex(mesh["warnings"][0], "called f; those behind the first are called f_2, f_3")
        self.assertEqual([f["name"] for f in self.report("resample", "twice.vtu", "-o", "out.vdb", "--field", "f_3")["mesh"]["fields"]], ["f_3"])
        self.write("all.vtm", '<?xml version="1.0"?><VTKFile type="vtkMultiBlockDataSet" version="1.0"><vtkMultiBlockDataSet>'
                   '<DataSet index="0" file="twice.vtu"/></vtkMultiBlockDataSet></VTKFile>')  # fmt: skip
        self.reject(2, "twice.vtu second 'f'", "info", "all.vtm")

    def test_peak_memory_counts_the_reader(self):
        n = 40
        head = f"# vtk DataFile Version 3.0\ngrid\nBINARY\nDATASET STRUCTURED_POINTS\nDIMENSIONS {n} {n} {n}\nORIGIN 0 0 0\nSPACING 1 1 1\n"
        self.write("grid.vtk", (head + f"POINT_DATA {n**3}\nSCALARS f unsigned_char 1\nLOOKUP_TABLE default\n").encode() + bytes(n**3))
        arguments = [TESSERA, "resample", "grid.vtk", "-o", "out.vdb", "--refine", "uniform", "--resolution", "5", "--json", "report.json", "--quiet"]
        process = subprocess.Popen(arguments, cwd=self.folder)
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        self.assertEqual(process.returncode, 0)
        peak = json.loads((self.folder / "report.json").read_text())["peak_memory_bytes"]
        # The system tells the larger of the two processes; while one reads the other is there too.
        self.assertGreater(peak, usage.ru_maxrss * 1024)
        self.assertLess(peak, 3 * usage.ru_maxrss * 1024)

    def test_dry_run_writes_nothing(self):
        before = sorted(os.listdir(self.folder))
        for options in ([], ["--refine", "uniform", "--resolution", "40"], ["--refine", "error", "--max-error", "5%"]):
            text = self.succeed("resample", self.stokes, "-o", "out.vdb", "--dry-run", *options)
            self.assertIn("levels", text)
            self.assertIn("flat", text)
            self.assertEqual(sorted(os.listdir(self.folder)), before)
        estimate = self.report("resample", self.stokes, "--dry-run", "--refine", "uniform", "--resolution", "40")["estimate"]
        real = self.report("resample", self.stokes, "-o", "out.vdb", "--refine", "uniform", "--resolution", "40")
        self.assertEqual(estimate["levels"]["voxels"], real["voxels"]["total"])

    def test_info_tells_what_opengl_there_is_or_why_not(self):
        # Mesa takes the version from the environment, and then gives no context of 4.5; other drivers don't listen.
        for environment in (None, dict(os.environ, MESA_GL_VERSION_OVERRIDE="3.3")):
            text = self.succeed("info", "--gl", env=environment)
            report = json.loads(self.succeed("info", "--gl", "--json", "-", env=environment))
            self.assertIsNone(report["input"])
            names = [platform["name"] for platform in report["gl"]["platforms"]]
            self.assertEqual(names, ["egl-device", "egl-surfaceless", "osmesa"])
            for platform in report["gl"]["platforms"]:
                self.assertEqual(platform["available"], platform["name"] in report["gl"]["preference"])
                if platform["available"]:
                    self.assertIn(platform["device"]["renderer"], text)
                    self.assertGreaterEqual(platform["device"]["limits"]["texture_3d_size"], 256)
                else:
                    self.assertIn(f"{platform['name']}: no, {platform['reason']}", text)
        both = self.report("info", self.stokes, "--gl")
        self.assertIn("gl", both)
        self.assertIn("mesh", both)
        self.reject(2, "file --gl", "info")

    def test_info_tells_what_was_written(self):
        written = self.report("resample", self.stokes, "-o", "out.vdb", "--field", "pressure=p")
        info = self.report("info", "out.vdb")
        self.assertEqual(info["error"], written["error"])
        self.assertEqual(info["lattice"], written["lattice"])
        self.assertEqual(info["voxels"], written["voxels"])
        self.assertTrue(any(grid["name"].startswith("p_level_") for grid in info["grids"]))
        self.assertEqual(self.report("info", self.stokes)["mesh"]["nodes"], written["mesh"]["nodes"])

    def test_auto_writes_what_it_chose_into_the_file(self):
        report = self.report("resample", self.cube, "-o", "out.vdb", "--algorithm", "auto", "--refine", "uniform", "--resolution", "20")
        self.assertIn("auto chose " + report["algorithm"], report["algorithm_reason"])
        self.assertTrue(" for 6 elements and " in report["algorithm_reason"] or "there is no OpenGL" in report["algorithm_reason"])
        self.assertEqual(report["sample_format"], "r32f")
        self.assertNotEqual(report["target"], "")
        self.assertEqual(self.report("info", "out.vdb")["algorithm"], report["algorithm"])
        self.assertTrue(self.report("verify", self.cube, "out.vdb")["holds"])

    def test_verify_confirms_the_file(self):
        for options in ([], ["--half"], ["--refine", "error", "--max-error", "10%", "--brick-size", "8"], ["--extend", "2"],
                        ["--refine", "uniform", "--resolution", "60", "--layout", "flat"]):
            self.succeed("resample", self.stokes, "-o", "out.vdb", "--quiet", *options)
            report = self.report("verify", self.stokes, "out.vdb")
            self.assertTrue(report["holds"])
            self.assertGreater(report["voxels"]["covered"], 100)
            self.assertEqual(report["voxels"]["incomplete_places"], 0)

    def test_brick_statistics_are_stored_and_verified(self):
        for options in ([], ["--half", "--extend", "1"], ["--refine", "error", "--max-error", "10%", "--brick-size", "8"]):
            self.succeed("resample", self.stokes, "-o", "out.vdb", "--quiet", "--brick-statistics", *options)
            self.assertIn("histogram and error of each brick", self.succeed("info", "out.vdb"))
            info = self.report("info", "out.vdb")
            self.assertTrue(info["brick_statistics"])
            report = self.report("verify", self.stokes, "out.vdb")
            self.assertTrue(report["holds"])
            rows = {row["figure"]: row for row in report["comparison"]}
            for figure in ("bricks with these samples", "bricks with these errors"):
                self.assertEqual(rows[figure]["measured"], info["bricks"]["total"])
            version, bricks, channels, errors = self.statistics("out.vdb")
            self.assertEqual((version, bricks), (1, info["bricks"]["total"]))
            self.assertEqual(channels, sum(error["components"] for error in info["error"].values()))
            largest = max(error["relative_max"] for error in info["error"].values())
            self.assertAlmostEqual(max(errors), largest, delta=1e-4 * largest if "--half" in options else 1e-6 * largest)
        # What was written without them is as before: the voxels are the same.
        self.succeed("resample", self.stokes, "-o", "plain.vdb", "--quiet")
        self.succeed("resample", self.stokes, "-o", "out.vdb", "--quiet", "--brick-statistics")
        plain, info = (self.report("info", name) for name in ("plain.vdb", "out.vdb"))
        self.assertNotIn("brick_statistics", plain)
        for key in ("grids", "voxels", "error"):
            self.assertEqual(plain[key], info[key])

    @staticmethod
    def statistics_entry(file):
        """Where the text of tessera_brick_statistics stands in a file's bytes: behind its length, a 32-bit number."""
        kind = b"tessera_brick_statistics" + struct.pack("<I", 6) + b"string"
        start = file.index(kind) + len(kind) + 4
        return start, start + struct.unpack("<I", file[start - 4 : start])[0]

    def statistics(self, name):
        """Version, bricks, channels and the bricks' errors, as docs/vdb_layout.md says."""
        file = (self.folder / name).read_bytes()
        start, end = self.statistics_entry(file)
        blob = base64.b64decode(file[start:end], validate=True)
        version, bricks, channels = struct.unpack("<3I", blob[:12])
        place, errors = 12, []

        def count():
            nonlocal place
            value = shift = 0
            while True:
                byte = blob[place]
                place += 1
                value |= (byte & 127) << shift
                shift += 7
                if byte < 128:
                    return value

        for _ in range(bricks):
            errors.append(struct.unpack("<f", blob[place : place + 4])[0])
            place += 4
            for _ in range(channels):
                bins = count()
                place += 8 if bins else 0
                for _ in range(bins):
                    count(), count()
        self.assertEqual(place, len(blob))
        return version, bricks, channels, errors

    def test_changed_brick_statistics_are_denied(self):
        self.succeed("resample", self.stokes, "-o", "out.vdb", "--quiet", "--brick-statistics")
        file = bytearray((self.folder / "out.vdb").read_bytes())
        file[21:57] = b"01234567-89ab-4cde-8f01-23456789abcd"  # no digest: as a program of another kind saves it
        start, end = self.statistics_entry(file)
        blob = bytearray(base64.b64decode(file[start:end]))
        last = bytes([blob[-1] - 1 if blob[-1] > 1 else 2])
        # The first brick's error, the lowest bits of its first channel's largest value, the last bin's count.
        for place, put, figure in ((12, struct.pack("<f", 0.5), "errors"), (21, bytes([blob[21] ^ 1]), "samples"), (len(blob) - 1, last, "samples")):
            changed = blob[:place] + put + blob[place + len(put) :]
            file[start:end] = base64.b64encode(changed)
            self.write("changed.vdb", bytes(file))
            self.reject(2, "claims", "verify", self.stokes, "changed.vdb", "--quiet")
            report = json.loads(self.run_tessera("verify", self.stokes, "changed.vdb", "--json", "-").stdout)
            failed = [row["figure"] for row in report["comparison"] if not row["holds"]]
            self.assertEqual(failed, [f"bricks with these {figure}"])

    def test_brick_statistics_need_levels(self):
        for options in (["-o", "out.vdb", "--layout", "flat"], ["-o", "out.vti"], ["-o", "out.vdb", "--for", "blender"]):
            self.reject(2, "--brick-statistics levels", "resample", self.cube, "--brick-statistics", *options)

    def test_verify_denies_a_file_of_another_field(self):
        self.write("other.vtu", vtu_text(fields={"f": [3 * p[0] for p in CUBE_POINTS]}))
        self.succeed("resample", "other.vtu", "-o", "out.vdb", "--quiet", "--refine", "uniform", "--resolution", "20")
        self.reject(2, "claims", "verify", self.cube, "out.vdb", "--quiet")
        self.write("named.vtu", vtu_text(fields={"g": range(8)}))
        self.reject(2, "'f'", "verify", "named.vtu", "out.vdb", "--quiet")
        self.reject(2, "out.vdb mesh first", "verify", "out.vdb", "other.vtu")

    def test_nan_values_are_counted(self):
        self.write("nan.vtu", vtu_text(fields={"f": ["nan"] + list(range(7))}))
        report = self.report("resample", "nan.vtu", "-o", "out.vdb", "--refine", "uniform", "--resolution", "9")
        self.assertEqual(report["coverage"]["covered_points"], 9**3)
        self.assertLess(report["error"]["f"]["valid_points"], 9**3)
        self.assertTrue(self.report("verify", "nan.vtu", "out.vdb")["holds"])

    def test_values_whose_range_passes_float_verify(self):
        self.write("wide.vtu", vtu_text(fields={"f": [3.4e38 * (2 * p[0] - 1) for p in CUBE_POINTS]}))
        for resolution in (3, 4, 17):
            self.succeed("resample", "wide.vtu", "-o", "out.vdb", "--quiet", "--refine", "uniform", "--resolution", resolution)
            self.assertTrue(self.report("verify", "wide.vtu", "out.vdb")["holds"])

    def test_voxels_small_beside_their_place_verify(self):
        points = [[1e8 + 1e-3 * x for x in p] for p in CUBE_POINTS]
        self.write("far.vtu", vtu_text(points=points))
        for options in (["--layout", "levels"], ["--layout", "flat"], ["--layout", "flat", "--up-axis", "y"]):
            self.succeed("resample", "far.vtu", "-o", "out.vdb", "--quiet", "--refine", "uniform", "--resolution", "40", *options)
            self.assertTrue(self.report("verify", "far.vtu", "out.vdb")["holds"])

    def test_any_number_of_threads_gives_the_same_file(self):
        files = set()
        for threads in (1, 2, 5):
            self.succeed("resample", self.stokes, "-o", "out.vdb", "--quiet", "--threads", threads)
            files.add((self.folder / "out.vdb").read_bytes())
        self.assertEqual(len(files), 1)

    def test_bounds_are_stored_and_verified(self):
        bounds = [-0.5, -0.5, -0.5, 0.25, 0.5, 0.1]
        for options in ([], ["--refine", "uniform", "--resolution", "40"], ["--half"]):
            self.succeed("resample", self.stokes, "-o", "out.vdb", "--quiet", "--bounds=" + ",".join(map(str, bounds)), *options)
            self.assertEqual(self.report("info", "out.vdb")["bounds"], [bounds[:3], bounds[3:]])
            report = self.report("verify", self.stokes, "out.vdb")
            self.assertTrue(report["holds"])
            self.assertGreater(report["coverage"]["outside_bricks"], 0)
        self.succeed("resample", self.stokes, "-o", "out.vdb", "--quiet")
        self.assertNotIn("bounds", self.report("info", "out.vdb"))

    def coarser_report(self, *arguments):
        result = self.run_tessera(*arguments, "--json", "-")
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(len(result.stderr.splitlines()), 1, result.stderr)
        return json.loads(result.stdout)

    def test_flat_grid_is_capped_and_says_so(self):
        dry = self.coarser_report("resample", self.stokes, "--layout", "flat", "--dry-run")
        flat = dry["estimate"]["flat"]
        self.assertGreater(flat["level"], 0)
        self.assertLessEqual(flat["voxels"], 2**26)
        levels = dry["estimate"]["levels"]
        self.assertAlmostEqual(flat["bytes"] / flat["voxels"], levels["bytes"] / levels["voxels"], places=3)
        report = self.coarser_report("resample", self.stokes, "-o", "out.vdb", "--layout", "flat")
        self.assertEqual(report["write"]["flat_level"], flat["level"])
        notes = [note for note in report["notes"] if "the flat grid has spacing" in note]
        self.assertEqual(len(notes), 1)
        self.assertIn("--max-voxels", notes[0])
        self.assertIn(notes[0], dry["notes"])

    def test_like_uses_the_lattice_of_the_other_file(self):
        self.succeed("resample", self.cube, "-o", "a.vdb", "--refine", "uniform", "--spacing", "0.07", "--quiet")
        self.succeed("resample", self.cube, "-o", "b.vdb", "--refine", "uniform", "--like", "a.vdb", "--quiet")
        a, b = (self.report("info", name)["lattice"] for name in ("a.vdb", "b.vdb"))
        self.assertEqual(a["spacing"], b["spacing"])
        steps = [(x - y) / a["spacing"] for x, y in zip(a["origin"], b["origin"])]
        for step in steps:
            self.assertAlmostEqual(step, round(step), places=9)

    def test_tets_are_those_of_the_mesh(self):
        self.succeed("tets", self.cube, "-o", "tets.vtu", "--quiet")
        mesh = self.report("info", "tets.vtu")["mesh"]
        self.assertEqual((mesh["elements"], mesh["nodes"]), (6, 8))

    def test_picture_is_a_png(self):
        self.succeed("resample", self.stokes, "-o", "out.vdb", "--quiet")
        self.succeed("picture", "out.vdb", "-o", "slice.png", "--field", "pressure", "--axis", "y")
        self.assertTrue((self.folder / "slice.png").read_bytes().startswith(b"\x89PNG\r\n"))
        self.reject(2, "speed pressure", "picture", "out.vdb", "-o", "other.png", "--field", "speed")


class Programs(AppTest):
    """tessera resample --for."""

    def setUp(self):
        super().setUp()
        vector = f'<DataArray type="Float64" Name="U" NumberOfComponents="3" format="ascii">{numbers(CUBE_POINTS)}</DataArray>'
        self.flow = self.write("flow.vtu", vtu_text(fields={"p": range(8), "T": range(8)}, extra=vector))

    def info(self, *options):
        self.succeed("resample", self.flow, "-o", "out.vdb", "--quiet", *options)
        return self.report("info", "out.vdb")

    def names(self, *options):
        return {grid["name"] for grid in self.info(*options)["grids"]}

    def test_each_sets_layout_shift_and_names(self):
        for program, shift, names in (
            ("blender", -0.5, {"density", "T", "velocity", "coverage"}),
            ("houdini", 0, {"density", "T", "vel", "coverage"}),
            ("paraview", 0, {"p", "T", "U", "coverage"}),
        ):
            info = self.info("--for", program, "--field", "p,T,U")
            self.assertEqual((info["layout"], info.get("voxel_shift", 0)), ("flat", shift))
            self.assertEqual({grid["name"] for grid in info["grids"]}, names)
            report = self.report("resample", self.flow, "-o", "out.vdb", "--for", program)
            self.assertEqual((report["for"], report["layout"]), (program, "flat"))

    def test_what_is_given_beside_it_wins(self):
        self.assertNotIn("voxel_shift", self.info("--for", "blender", "--voxel-shift", "0"))
        self.assertEqual(self.names("--for", "blender", "--field", "p=p,T,U=v"), {"p", "density", "v", "coverage"})
        self.assertEqual(self.names("--for", "houdini", "--field", "p,T=density,U"), {"p", "density", "vel", "coverage"})
        wide, narrow = (
            max(grid["active_voxels"] for grid in self.info("--for", "paraview", "--extend", layers)["grids"]) for layers in (2, 0)
        )
        self.assertGreater(wide, narrow)
        self.assertEqual(max(grid["active_voxels"] for grid in self.info("--for", "paraview")["grids"]), wide)
        self.info("--for", "houdini", "--up-axis", "keep")

    def test_says_which_names_it_gave(self):
        text = self.succeed("resample", self.flow, "-o", "out.vdb", "--for", "blender", "--field", "T,U")
        self.assertIn("T is written as grid density", text)
        self.assertIn("U is written as grid velocity", text)

    def test_contradictions_are_refused(self):
        self.resample_fails("--layout flat Blender", self.flow, "--for", "blender", "--layout", "levels")
        self.resample_fails("--up-axis keep turn", self.flow, "--for", "blender", "--up-axis", "z")
        self.resample_fails("--up-axis keep ParaView", self.flow, "--for", "paraview", "--up-axis", "y")
        self.resample_fails("--for blender houdini paraview", self.flow, "--for", "maya")
        self.resample_fails("--voxel-shift", self.flow, "--voxel-shift", "2")
        self.resample_fails("density", self.flow, "--for", "blender", "--field", "p=density,T=density")

    def test_without_it_nothing_changes(self):
        self.succeed("resample", self.flow, "-o", "a.vdb", "--quiet")
        self.succeed("resample", self.flow, "-o", "b.vdb", "--quiet", "--layout", "levels", "--up-axis", "keep", "--voxel-shift", "0")
        self.assertEqual((self.folder / "a.vdb").read_bytes(), (self.folder / "b.vdb").read_bytes())

    def test_a_lattice_like_a_shifted_one_is_not_shifted(self):
        self.succeed("resample", self.flow, "-o", "a.vdb", "--for", "blender", "--refine", "uniform", "--spacing", "0.07", "--quiet")
        origin = self.info("--refine", "uniform", "--like", "a.vdb")["lattice"]["origin"]
        for a, b in zip(self.report("info", "a.vdb")["lattice"]["origin"], origin):
            self.assertAlmostEqual((a - b) / 0.07, round((a - b) / 0.07), places=9)


class Refinement(AppTest):
    """--refine around a focus, by several criteria, by what is seen, and runs that go on."""

    def bricks(self, *options):
        # Where the finest spacing ends a refinement by error there is a warning.
        result = self.run_tessera("resample", self.stokes, "-o", "out.vdb", "--field", "pressure", "--brick-size", "8",
                                  "--json", "-", *options)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.succeed("verify", self.stokes, "out.vdb", "--quiet")
        return json.loads(result.stdout)

    def voxels(self, *options):
        return 512 * self.bricks(*options)["bricks"]["total"]

    def test_criteria_combine(self):
        focus = ("--focus", "0,0.3,0", "--radius", "0.5", "--resolution", "300")
        by_focus = self.voxels("--refine", "focus", *focus)
        by_error = self.voxels("--refine", "error", "--max-error", "5%", "--resolution", "300")
        report = self.bricks("--refine", "error,focus", "--max-error", "5%", *focus)
        both = 512 * report["bricks"]["total"]
        self.assertEqual(report["criterion"], "error,focus")
        self.assertLessEqual(both, by_focus + by_error)
        self.assertGreaterEqual(both, max(by_focus, by_error))

    def test_words_that_do_not_fit_are_refused(self):
        for words, options in (
                ("--focus x,y,z", ["--refine", "focus"]),
                ("--radius", ["--refine", "focus", "--focus", "1,2,3"]),
                ("--radius above 0", ["--refine", "focus", "--focus", "1,2,3", "--radius", "0"]),
                ("--focus 1,2", ["--refine", "focus", "--focus", "1,2", "--radius", "1"]),
                ("focus,sharp", ["--refine", "focus,sharp"]),
                ("uniform no other", ["--refine", "uniform,focus", "--resolution", "30"]),
                ("--refine focus", ["--focus", "1,2,3", "--radius", "1"]),
                ("--transfer-function", ["--refine", "error,visibility", "--max-error", "1%"]),
                ("visibility", ["--refine", "error", "--max-error", "1%", "--transfer-function", "tf.json"]),
                ("rms --resume", ["--refine", "error", "--max-error", "1%", "--error-measure", "rms", "--resume", "log"]),
                ("--resume uniform", ["--refine", "uniform", "--resolution", "30", "--resume", "log"])):
            self.reject(2, words, "resample", self.stokes, "-o", "out.vdb", *options)
        self.assertFalse((self.folder / "log").exists())

    def test_a_transfer_function_is_read_strictly(self):
        seen = ("--refine", "element-size,visibility", "--transfer-function")
        for words, text in (
                ("tf.json JSON", "{"),
                ("tf.json stops[0] unknown opacty", '{"stops": [{"value": 1, "opacty": 1}]}'),
                ("tf.json stops", '{"field": "pressure"}'),
                ("tf.json stops[1].opacity", '{"stops": [{"value": 1, "opacity": 1}, {"value": 2}]}'),
                ("tf.json ascend", '{"stops": [{"value": 1, "opacity": 1}, {"value": 0, "opacity": 1}]}'),
                ("tf.json between 0 and 1", '{"stops": [{"value": 1, "opacity": 1.5}]}')):
            self.write("tf.json", text)
            self.reject(2, words, "resample", self.stokes, "-o", "out.vdb", *seen, "tf.json")
        self.write("tf.json", '{"field": "none", "stops": [{"value": 1, "opacity": 1}]}')
        self.reject(2, "none", "resample", self.stokes, "-o", "out.vdb", *seen, "tf.json")

    def test_only_what_is_seen_is_refined(self):
        def refined(*shown):
            options = ["--refine", "error", "--max-error", "2%", "--max-levels", "6"]
            if shown:
                stops = [{"value": v, "opacity": o} for v, o in zip((shown[0], *shown, shown[1]), (0, 0.5, 0.5, 0))]
                self.write("tf.json", json.dumps({"field": "pressure", "stops": stops}))
                options[1] += ",visibility"
                options += ["--transfer-function", "tf.json"]
            return self.bricks(*options)["bricks"]
        everything, some, nothing = refined(), refined(5, 10), refined(100, 200)
        self.assertLess(some["total"], everything["total"])
        self.assertEqual(len(nothing["per_level"]), 1)
        self.assertGreater(len(some["per_level"]), 3)

    def test_a_killed_run_goes_on(self):
        def command(out, log):
            return ["resample", self.stokes, "-o", out, "--quiet", "--refine", "focus", "--focus", "0,0.3,0", "--radius", "1",
                    "--resolution", "300", "--resume", log]
        start = time.monotonic()
        self.succeed(*command("whole.vdb", "whole.log"))
        whole = time.monotonic() - start
        expected = (self.folder / "whole.vdb").read_bytes()
        kills = int(os.environ.get("TESSERA_RESUME_KILLS", 4))  # more are asked for there
        for share in (0.2 + 0.8 * (n + 0.5) / kills for n in range(kills)):
            (self.folder / "run.log").unlink(missing_ok=True)
            process = subprocess.Popen([TESSERA, *map(str, command("run.vdb", "run.log"))], cwd=self.folder)
            time.sleep(share * whole)
            process.kill()
            process.wait()
            self.succeed(*command("run.vdb", "run.log"))
            self.assertEqual((self.folder / "run.vdb").read_bytes(), expected)
        self.reject(2, "whole.log log", *command("other.vdb", "whole.log"), "--brick-size", "8")
        self.write("no.log", "text of somebody's")
        self.reject(2, "no.log log", *command("other.vdb", "no.log"))
        self.assertEqual((self.folder / "no.log").read_text(), "text of somebody's")


class Pictures(AppTest):
    """tessera render."""

    def setUp(self):
        super().setUp()
        self.vdb = self.folder / "cube.vdb"
        self.succeed("resample", self.cube, "-o", self.vdb, "--refine", "uniform", "--resolution", "17", "--brick-size", "8", "--extend", "1", "--quiet")

    def render(self, *options, size="400x320"):
        return self.report("render", self.vdb, "-o", "out.png", "--size", size, "--samples", "1", *options)

    def scene(self, **keys):
        return self.write("scene.json", json.dumps({"version": 1, **keys}))

    def pixels(self, name="out.png"):
        """Rows of (red, green, blue)."""
        data = (self.folder / name).read_bytes()
        self.assertTrue(data.startswith(b"\x89PNG"))
        at, packed = 8, b""
        while at < len(data):
            (size,), kind = struct.unpack(">I", data[at : at + 4]), data[at + 4 : at + 8]
            if kind == b"IHDR":
                width, height, depth, colour = struct.unpack(">IIBB", data[at + 8 : at + 18])
                self.assertEqual((depth, colour), (8, 2))
            if kind == b"IDAT":
                packed += data[at + 8 : at + 8 + size]
            at += size + 12
        raw, stride = zlib.decompress(packed), 3 * width
        rows, before = [], bytearray(stride)
        for y in range(height):
            kind, row = raw[y * (stride + 1)], bytearray(raw[y * (stride + 1) + 1 : (y + 1) * (stride + 1)])
            for i in range(stride):
                left, up, corner = row[i - 3] if i >= 3 else 0, before[i], before[i - 3] if i >= 3 else 0
                guess = left + up - corner
                nearest = min((abs(guess - v), n, v) for n, v in enumerate((left, up, corner)))[2]
                row[i] = (row[i] + (0, left, up, (left + up) // 2, nearest)[kind]) % 256
            rows.append([tuple(row[3 * x : 3 * x + 3]) for x in range(width)])
            before = row
        return rows

    def test_without_a_scene_all_of_the_data_is_in_the_picture(self):
        report = self.render()
        self.assertEqual((report["command"], report["field"], report["size"]), ("render", "f", [400, 320]))
        self.assertEqual(report["value_range"], [0, 1])
        self.assertEqual(report["bricks"], {"total": 27, "drawn": report["bricks"]["drawn"]})
        self.assertGreaterEqual(report["bricks"]["drawn"], 8)
        rows = self.pixels()
        self.assertEqual((len(rows), len(rows[0])), (320, 400))
        border = rows[0] + rows[-1] + [row[0] for row in rows] + [row[-1] for row in rows]
        self.assertEqual(set(border), {(255, 255, 255)})
        self.assertNotEqual(rows[160][200], (255, 255, 255))

    def test_a_mesh_is_drawn_in_bricks_around_the_scenes_focus(self):
        def render(**bricks):
            scene = self.scene(bricks={"resolution": 65, "cells": 8, **bricks}, effects={"bricks": {}}, legend=False)
            report = self.report("render", self.cube, "-o", "out.png", "--scene", scene, "--size", "90x70", "--samples", "1")
            return report["bricks"]["total"], self.pixels()

        middle, shown = render()
        self.assertEqual(render(), (middle, shown))
        self.assertEqual(render(focus=[{"place": [0.5, 0.5, 0.5], "radius": 1 / 16}]), (middle, shown))
        corner, other = render(focus=[{"place": [1, 1, 1]}])
        self.assertNotEqual(shown, other)
        both, _ = render(focus=[{"place": [1, 1, 1]}, {"place": [0, 0, 0]}])
        self.assertLess(corner, both)
        self.assertLess(render(view=30)[0], render(view=0.5)[0])
        # What is there of a field doesn't change with the bricks.
        scene = self.scene(bricks={"resolution": 33}, legend=False)
        self.assertEqual(self.report("render", self.cube, "-o", "out.png", "--scene", scene, "--size", "40x40")["value_range"], [0, 1])

    def test_a_scene_is_drawn_as_it_says(self):
        # From before y = 0, as high as three cubes: red left of the middle, blue right of it.
        stops = [{"value": v, "color": c, "opacity": 1} for v, c in ((0.5, [1, 0, 0]), (0.5, [0, 0, 1]))]
        camera = {"eye": [0.5, -2, 0.5], "target": [0.5, 0, 0.5], "height": 3}
        keys = {"camera": camera, "transfer_function": {"stops": stops}, "background": [0, 1, 0], "legend": False, "slices": 4}
        self.render("--scene", self.scene(**keys), size="120x120")
        rows = self.pixels()
        green, red, blue = (0, 255, 0), (255, 0, 0), (0, 0, 255)
        self.assertEqual([rows[60][x] for x in (35, 50, 58, 62, 70, 85)], [green, red, red, blue, blue, green])
        self.assertEqual([rows[y][50] for y in (35, 45, 75, 85)], [green, red, red, green])
        # Parts of it.
        clip = {"box": [0, 0, 0, 0.25, 1, 1], "planes": [{"normal": [0, 0, -2], "offset": -1}]}
        self.render("--scene", self.scene(**keys, clip=clip), size="120x120")
        rows = self.pixels()
        self.assertEqual([rows[70][x] for x in (45, 55, 70)], [red, green, green])
        self.assertEqual(rows[50][45], green)

    def test_options_count_instead_of_the_scene(self):
        path = self.scene(field="none", size=[50, 40], samples=4, transfer_function={"map": "magma"})
        self.reject(2, "none f", "render", self.vdb, "--scene", path, "-o", "out.png")
        report = self.report("render", self.vdb, "--scene", path, "-o", "out.exr", "--field", "f")
        self.assertEqual(report["size"], [50, 40])
        header = (self.folder / "out.exr").read_bytes()[:1000]
        for name in (b"R", b"G", b"B", b"A"):
            self.assertIn(name + b"\0\2\0\0\0", header)  # of 32-bit floats

    def test_an_effect_tells_what_it_costs_and_can_be_left_out(self):
        surfaces = {"surfaces": [{"value": 0.5, "color": [1, 0, 0]}]}
        path = self.scene(effects={"shading": {}, "isosurfaces": surfaces}, legend=False)
        report = self.render("--scene", path, "--explain", size="60x48")
        self.assertEqual([effect["name"] for effect in report["effects"]], ["isosurfaces", "shading"])
        for effect in report["effects"]:
            self.assertEqual(set(effect), {"name", "draw_ms", "device_ms", "bricks", "passes", "textures", "device_bytes", "changed_pixels",
                                           "change_rms_255"})
            self.assertGreater(effect["changed_pixels"], 50)
            self.assertGreater(effect["change_rms_255"], 0.5)
        every = self.pixels()
        self.assertNotIn("effects", self.render("--scene", path, "--without", "shading", size="60x48"))
        self.assertNotEqual(self.pixels(), every)
        text = self.succeed("render", self.vdb, "--scene", path, "-o", "out.png", "--size", "60x48", "--explain")
        for words in ("the picture", "of it isosurfaces", "of it shading", "device memory"):
            self.assertIn(words, text)
        self.render("--scene", self.scene(legend=False), size="60x48")
        volume = self.pixels()
        self.render("--scene", self.scene(effects={"shading": {}, "bricks": {}}, legend=False), "--without", "shading", "--without", "bricks", size="60x48")
        self.assertEqual(self.pixels(), volume)
        self.reject(2, "--without bricks", "render", self.vdb, "--scene", self.scene(), "-o", "x.png", "--without", "bricks")

    def test_axes_and_a_scale_bar_are_put_onto_the_picture(self):
        self.render("--scene", self.scene(legend=False))
        plain = self.pixels()
        self.render("--scene", self.scene(legend=False, length_unit="m", effects={"scale_bar": {"color": [1, 0, 0]}}))
        barred = self.pixels()
        self.assertNotEqual(barred, plain)
        path = self.scene(legend=False, effects={"axes": {}, "scale_bar": {"color": [1, 0, 0]}})
        self.render("--scene", path)
        self.assertNotEqual(self.pixels(), barred)
        report = self.render("--scene", path, "--without", "axes")
        self.assertEqual(report["draw_calls"], self.render("--scene", self.scene(legend=False))["draw_calls"])

    def test_the_outline_is_that_of_a_mesh_that_the_scene_names(self):
        self.render("--scene", self.scene(legend=False))
        plain = self.pixels()
        path = self.scene(legend=False, effects={"outline": {"mesh": os.path.basename(self.cube)}})
        self.render("--scene", path)
        self.assertNotEqual(self.pixels(), plain)
        self.render("--scene", path, "--without", "outline")
        self.assertEqual(self.pixels(), plain)
        out = ("-o", "x.png")
        self.reject(2, "missing.vtu", "render", self.vdb, *out, "--scene", self.scene(effects={"outline": {"mesh": "missing.vtu"}}))
        self.reject(2, "scene.json effects.outline.mesh missing", "render", self.vdb, *out, "--scene", self.scene(effects={"outline": {}}))
        self.succeed("render", self.cube, *out, "--scene", self.scene(effects={"outline": {}}, bricks={"resolution": 17, "cells": 8}))

    def test_errors_of_bricks_are_shown_where_the_file_has_them(self):
        path = self.scene(effects={"errors": {}}, legend=False)
        self.reject(2, "scene.json effects.errors --brick-statistics", "render", self.vdb, "-o", "x.png", "--scene", path)
        known = self.folder / "known.vdb"
        self.succeed("resample", self.cube, "-o", known, "--refine", "uniform", "--resolution", "17", "--brick-size", "8", "--extend", "1",
                     "--brick-statistics", "--quiet")
        self.report("render", known, "-o", "out.png", "--size", "60x48", "--scene", path)
        tinted = self.pixels()
        self.report("render", known, "-o", "out.png", "--size", "60x48", "--scene", path, "--without", "errors")
        self.assertNotEqual(self.pixels(), tinted)

    def test_a_camera_that_moves_makes_numbered_pictures(self):
        size = ("--size", "60x48", "--samples", "1")
        report = self.report("render", self.vdb, "-o", "turn.png", "--frames", "4", "--orbit", *size)
        names = [f"turn_{n:04}.png" for n in (1, 2, 3, 4)]
        self.assertEqual(report["output"], names)
        pictures = [self.pixels(name) for name in names]
        self.assertEqual(len(set(map(repr, pictures))), 4)
        keys = [{"eye": [3, 2, 1], "target": [0.5, 0.5, 0.5]}, {"eye": [2, 3, 1], "target": [0.5, 0.5, 0.5]}]
        path = self.write("path.json", json.dumps({"version": 1, "keys": keys}))
        self.succeed("render", self.vdb, "-o", "p%02d.png", "--frames", "3", "--path", path, "--scene", self.scene(legend=False), *size)
        # The ends are the pictures of the keys.
        for name, key in (("p01.png", keys[0]), ("p03.png", keys[1])):
            self.succeed("render", self.vdb, "-o", "one.png", "--scene", self.scene(camera=key, legend=False), *size)
            self.assertEqual(self.pixels(name), self.pixels("one.png"))
        out = ("-o", "x.png")
        self.reject(2, "--frames --path", "render", self.vdb, *out, "--frames", "3")
        self.reject(2, "--frames", "render", self.vdb, *out, "--orbit")
        self.reject(2, "standard output", "render", self.vdb, "-o", "-", "--orbit", "--frames", "2")
        self.reject(2, "--explain", "render", self.vdb, *out, "--orbit", "--frames", "2", "--explain")
        self.reject(2, "path.json keys[0]", "render", self.vdb, *out, "--frames", "2", "--path", self.write("path.json", '{"version": 1, "keys": [{}]}'))
        self.reject(2, "replace", "render", self.vdb, "-o", "path.png", "--frames", "2", "--orbit", "--json", "path_0002.png")

    def test_several_files_are_a_picture_each(self):
        other = self.folder / "other.vdb"
        self.succeed("resample", self.cube, "-o", other, "--refine", "uniform", "--resolution", "9", "--brick-size", "8", "--extend", "1", "--quiet")
        size = ("--size", "60x48", "--samples", "1")
        scene = self.scene(transfer_function={"range": [0, 1], "opacity": [[0, 0.5]]}, legend=False)
        report = self.report("render", self.vdb, other, "-o", "s.png", "--scene", scene, *size)
        self.assertEqual(report["output"], ["s_0001.png", "s_0002.png"])
        self.assertEqual(len(report["input"]), 2)
        self.succeed("render", self.vdb, "-o", "one.png", "--scene", scene, *size)
        self.assertEqual(self.pixels("s_0001.png"), self.pixels("one.png"))
        self.assertNotEqual(self.pixels("s_0002.png"), self.pixels("one.png"))
        self.reject(2, "--frames 2", "render", self.vdb, other, "-o", "s.png", "--frames", "3")
        self.reject(2, "missing.vdb", "render", self.vdb, "missing.vdb", "-o", "s.png", "--scene", scene, *size)
        result = self.run_tessera("render", self.vdb, other, "-o", "s.png", *size)
        self.assertIn("transfer_function.range", result.stderr)

    def test_a_picture_goes_to_standard_output(self):
        command = [TESSERA, "render", self.vdb, "-o", "-", "--size", "400x320", "--quiet"]
        result = subprocess.run(command, capture_output=True, check=True, timeout=300)
        self.assertTrue(result.stdout.startswith(b"\x89PNG"))
        # A bare container may have no folder for temporary files.
        without = subprocess.run(command, capture_output=True, check=True, timeout=300, env={**os.environ, "TMPDIR": "/proc"})
        self.assertEqual(without.stdout, result.stdout)

    def test_a_small_picture_has_no_legend_and_says_so(self):
        result = self.run_tessera("render", self.vdb, "-o", "out.png", "--size", "40x30")
        self.assertEqual(result.returncode, 0)
        self.assertIn("no room for a legend", result.stderr)

    def test_bad_input_is_one_line(self):
        out = ("-o", "out.png")
        self.reject(2, "missing.vdb", "render", "missing.vdb", *out)
        self.reject(2, "nowhere.vtu", "render", "nowhere.vtu", *out)
        self.reject(2, "cube.vtu none f", "render", self.cube, *out, "--field", "none")
        self.reject(2, "cube.vtu budget", "render", self.cube, *out, "--scene", self.scene(bricks={"budget": 1000}))
        self.reject(2, "scene.json bricks.cells 16", "render", self.cube, *out, "--scene", self.scene(bricks={"cells": 12}))
        self.reject(2, "scene.json bricks.focus", "render", self.cube, *out, "--scene", self.scene(bricks={"focus": [{}]}))
        self.reject(2, "cube.vdb memory", "render", self.vdb, *out, "--max-memory", "1000")
        self.reject(2, "none f", "render", self.vdb, *out, "--field", "none")
        self.reject(2, "component 3", "render", self.vdb, *out, "--component", "3")
        self.reject(2, "png exr", "render", self.vdb, "-o", "out.jpg")
        self.reject(2, "--size 0x4", "render", self.vdb, *out, "--size", "0x4")
        self.reject(2, "--size 10", "render", self.vdb, *out, "--size", "10")
        self.reject(2, "--size 10x10x10", "render", self.vdb, *out, "--size", "10x10x10")
        self.reject(2, "--samples", "render", self.vdb, *out, "--samples", "3")
        self.reject(2, "--output replace", "render", self.vdb, "-o", self.vdb)
        self.reject(2, "nowhere.json", "render", self.vdb, *out, "--scene", "nowhere.json")
        self.reject(2, "scene.json camera.eye", "render", self.vdb, *out, "--scene", self.scene(camera={"eye": 3}))
        away = self.scene(camera={"eye": [5, 5, 5], "target": [9, 9, 9]})
        self.reject(2, "scene.json camera.target", "render", self.vdb, *out, "--scene", self.scene(camera={"eye": [0.5, 0.5, 0.5]}))
        self.reject(2, "scene.json none", "render", self.vdb, *out, "--scene", self.scene(field="none"))
        self.reject(2, "scene.json component", "render", self.vdb, *out, "--scene", self.scene(component=2))
        self.reject(2, "scene.json million times", "render", self.vdb, *out, "--scene", self.scene(camera={"eye": [1e9, 0, 0]}))
        self.reject(2, "--explain --json", "render", self.vdb, "-o", "-", "--explain")
        self.reject(2, "32768 million", "render", self.vdb, *out, "--size", "32768x32768")
        away = self.scene(camera={"eye": [5, 5, 5], "target": [9, 9, 9]})
        self.reject(2, "scene.json nothing", "render", self.vdb, *out, "--scene", away)
        log = self.scene(transfer_function={"log": True})
        self.reject(2, "logarithmic", "render", self.vdb, *out, "--scene", log)

    def test_the_schema_knows_the_scenes_that_are_read(self):
        try:
            import jsonschema
        except ImportError:
            self.skipTest("python3-jsonschema is not installed")
        schema = json.loads((DATA.parent / "docs/scene.schema.json").read_text())
        jsonschema.Draft7Validator.check_schema(schema)
        validator = jsonschema.Draft7Validator(schema)
        eye = {"eye": [3, 3, 3]}
        cases = [
            (True, {}),
            (True, {"camera": {**eye, "target": [0, 0, 0], "up": [0, 1, 0], "opening": 50}, "size": [40, 30], "samples": 4, "slices": 1.5}),
            (True, {"camera": {**eye, "height": 3}, "transfer_function": {"map": "turbo", "range": [0, 2], "opacity": [[0, 0.5]]}}),
            (True, {"camera": {"direction": [1, 1, 1], "parallel": True}, "layer": 0.1, "background": [0, 0, 0], "legend": False, "unit": "m"}),
            (True, {"transfer_function": {"stops": [{"value": 0, "opacity": 1}]}, "clip": {"box": [0, 0, 0, 1, 1, 0.5], "planes": []}}),
            (True, {"clip": {"planes": [{"normal": [1, 0, 0], "offset": 0.2}]}, "field": "f"}),
            (True, {"bricks": {"resolution": 64, "cells": 8, "budget": 5e8, "focus": [{"place": [0, 0, 0], "radius": 1}], "view": 3}}),
            (False, {"bricks": {"focus": [{"radius": 1}]}}),
            (False, {"bricks": {"cells": 12}}),
            (True, {"bookmarks": [{"name": "above", "camera": {"eye": [0, 0, 9], "target": [0, 0, 0], "up": [0, 1, 0]}}]}),
            (False, {"bookmarks": [{"name": "above", "camera": {"eye": [0, 0]}}]}),
            (True, {"effects": {"shading": {"light": [1, 1, 1], "shininess": 10}, "bricks": {"width": 2}}}),
            (True, {"effects": {"isosurfaces": {"surfaces": [{"value": 0.5, "color": [1, 0, 0], "opacity": 0.5}]}}}),
            (False, {"effects": {"glow": {}}}),
            (False, {"effects": {"isosurfaces": {}}}),
            (False, {"effects": {"isosurfaces": {"surfaces": []}}}),
            (False, {"effects": {"shading": {"ambient": 2}}}),
            (False, {"colour": 1}),
            (False, {"version": 2}),
            (False, {"camera": {"target": [0, 0, 0]}}),
            (False, {"camera": {**eye, "direction": [1, 0, 0]}}),
            (False, {"camera": {**eye, "opening": 30, "height": 3}}),
            (False, {"camera": {"parallel": True, "opening": 30}}),
            (False, {"transfer_function": {"stops": [{"value": 0, "opacity": 1}], "map": "gray"}}),
            (False, {"transfer_function": {"stops": []}}),
            (False, {"transfer_function": {"map": "jet"}}),
            (False, {"transfer_function": {"opacity": [[0, 2]]}}),
            (False, {"samples": 2}),
            (False, {"size": [0, 10]}),
            (False, {"clip": {"planes": [{"normal": [1, 0, 0]}]}}),
        ]
        for is_valid, keys in cases:
            document = {"version": 1, **keys}
            self.assertEqual(validator.is_valid(document), is_valid, document)
            path = self.write("scene.json", json.dumps(document))
            result = self.run_tessera("render", self.vdb, "-o", "out.png", "--size", "40x30", "--samples", "1", "--scene", path)
            self.assertEqual(result.returncode, 0 if is_valid else 2, (document, result.stderr))


class Slices(AppTest):
    """tessera slice."""

    def slice(self, mesh, *options):
        return self.report("slice", mesh, *options)

    def reject_slice(self, words, *options, output="cut.exr", mesh=None, code=2):
        return self.reject(code, words, "slice", mesh or self.cube, "-o", output, *options)

    def test_report_tells_the_plane_the_pixels_and_the_elements(self):
        report = self.slice(self.cube, "-o", "cut.exr", "--normal", "0,0,2", "--resolution", "40")
        self.assertEqual(report["plane"], {"origin": [0.5, 0.5, 0.5], "normal": [0, 0, 1]})
        image = report["image"]
        self.assertEqual((image["width"], image["height"], image["covered_pixels"]), (40, 40, 1600))
        self.assertEqual(image["spacing"], 1 / 40)
        self.assertEqual((image["u"], image["v"]), ([1 / 40, 0, 0], [0, 1 / 40, 0]))
        for got, expected in zip(image["origin"], (1 / 80, 1 / 80, 0.5)):
            self.assertAlmostEqual(got, expected, places=15)
        # f = x: the outermost pixels' centres are half a pixel inside.
        self.assertEqual(image["channels"][0]["name"], "f")
        for got, expected in zip(image["channels"][0]["range"], (1 / 80, 79 / 80)):
            self.assertAlmostEqual(got, expected, places=6)
        self.assertEqual(report["elements"], {"total": 6, "boxes": 6, "touched": 6, "hit": 6})
        self.assertEqual(set(report["stages"]), {"read", "index", "query", "resample", "write"})
        self.assertEqual((report["algorithm"], report["sample_format"]), ("software", "r32f"))
        self.assertTrue((self.folder / "cut.exr").read_bytes().startswith(b"\x76\x2f\x31\x01"))

    def test_header_holds_every_channel_and_attribute(self):
        self.succeed("slice", self.stokes, "-o", "cut.exr", "--normal", "1,1,1", "--resolution", "100", "--quiet")
        header = (self.folder / "cut.exr").read_bytes()[:4000]
        for name in (b"pressure", b"velocity_x", b"velocity_y", b"velocity_z", b"coverage", b"R", b"G", b"B", b"A"):
            self.assertIn(b"\0" + name + b"\0", header)
        for name in (b"Origin\0v3d", b"U\0v3d", b"V\0v3d", b"Normal\0v3d", b"Spacing\0double", b"Source\0string", b"Algorithm\0string", b"Version\0string"):
            self.assertIn(b"tessera" + name + b"\0", header)
        for text in (b"stokes_p1.vtu", b"software"):
            self.assertIn(text, header)

    def test_header_is_read_by_openexrs_own_program(self):
        program = shutil.which("exrheader")
        if not program:
            self.skipTest("exrheader is not installed")
        self.succeed("slice", self.stokes, "-o", "cut.exr", "--normal", "1,1,1", "--resolution", "100", "--quiet")
        text = subprocess.run([program, "cut.exr"], capture_output=True, text=True, cwd=self.folder, check=True).stdout
        for word in ("velocity_x", "32-bit floating-point", "tesseraSpacing", "coverage", "stokes_p1.vtu"):
            self.assertIn(word, text)

    def test_png_shows_one_field(self):
        report = self.slice(self.stokes, "-o", "cut.PNG", "--normal", "0,1,0", "--field", "velocity", "--resolution", "100")
        self.assertTrue((self.folder / "cut.PNG").read_bytes().startswith(b"\x89PNG\r\n"))
        self.assertEqual([c["name"] for c in report["image"]["channels"]], ["|velocity|"])
        report = self.slice(self.stokes, "-o", "cut.png", "--field", "velocity", "--component", "2", "--range", "0,1", "--resolution", "100")
        self.assertEqual([c["name"] for c in report["image"]["channels"]], ["velocity_z"])

    def test_size_shows_a_part(self):
        options = ("--normal", "0,0,1", "--origin", "0.25,0.5,0.5", "--size", "0.5,0.25", "--resolution", "64")
        image = self.slice(self.cube, "-o", "cut.exr", *options)["image"]
        self.assertEqual((image["width"], image["height"], image["covered_pixels"]), (64, 32, 64 * 32))
        beyond = self.slice(self.cube, "-o", "cut.exr", "--size", "2", "--resolution", "64")["image"]
        self.assertEqual((beyond["width"], beyond["height"], beyond["covered_pixels"]), (64, 64, 32 * 32))

    def test_negative_numbers_need_no_equals_sign(self):
        report = self.slice(self.cube, "-o", "cut.exr", "--normal", "-1,0,0", "--up", "-0,-1,0", "--resolution", "20")
        self.assertEqual(report["plane"]["normal"], [-1, 0, 0])
        self.assertEqual(report["image"]["v"], [0, -1 / 20, 0])

    def test_any_number_of_threads_gives_the_same_file(self):
        for name in ("cut.exr", "cut.png"):
            files = set()
            for threads in (1, 2, 5):
                self.succeed("slice", self.stokes, "-o", name, "--normal", "1,2,3", "--resolution", "300", "--quiet", "--threads", threads)
                files.add((self.folder / name).read_bytes())
            self.assertEqual(len(files), 1)

    def test_quiet_prints_nothing(self):
        self.assertEqual(self.succeed("slice", self.cube, "-o", "cut.exr", "--quiet"), "")
        self.assertRegex(self.succeed("slice", self.cube, "-o", "cut.exr"), r"cut through 6 elements: 6 touched \(100.0 %\), 6 hit")

    def test_mesh_without_fields_gives_its_coverage(self):
        self.write("bare.vtu", vtu_text(fields={}))
        self.assertEqual(self.slice("bare.vtu", "-o", "cut.exr")["image"]["channels"], [])
        self.reject_slice("no field", mesh="bare.vtu", output="cut.png")

    def test_fields_that_would_clash_get_another_name(self):
        self.write("clash.vtu", vtu_text(fields={"coverage": range(8), "A": range(8), "Power": range(8), "a.b": range(8)}))
        report = self.slice("clash.vtu", "-o", "cut.exr")
        self.assertEqual([c["name"] for c in report["image"]["channels"]], ["coverage_", "A_", "Power_", "a_b"])

    def test_bad_input_says_what_is_wrong(self):
        self.reject_slice("normal zero", "--normal", "0,0,0")
        self.reject_slice("--normal", "--normal", "0,nan,1")
        self.reject_slice("--normal", "--normal", "0,1")
        self.reject_slice("--origin", "--origin", "inf,0,0")
        self.reject_slice("upward", "--up", "0,0,1")
        self.reject_slice("misses the mesh", "--origin", "0,0,5")
        self.reject_slice("misses the mesh", "--origin", "7,7,0.5", "--size", "1")
        self.reject_slice("point", "--origin", "0,0,0", "--normal", "1,1,1")
        self.reject_slice("--size", "--size", "1,2,3")
        self.reject_slice("size above", "--size", "0")
        self.reject_slice("--resolution", "--resolution", "0")
        self.reject_slice("--resolution 16384", "--resolution", "20000")
        self.reject_slice(".exr .png", output="cut.jpg")
        self.reject_slice(".exr .png", output="cut")
        self.reject_slice("speed", "--field", "speed")
        self.reject_slice("magic software", "--algorithm", "magic")
        self.reject_slice("software r32f r8", "--sample-format", "r8")
        self.reject_slice("osmesa", "--gl", "osmesa", "--algorithm", "software")
        self.reject_slice("--gl", "--gl", "glx")
        self.reject_slice("component", "--component", "0")
        self.reject_slice("--component", "--component", "3", output="cut.png")
        self.reject_slice("a < b", "--range", "1,0", output="cut.png")
        self.reject_slice("one field", "--field", "f,g", output="cut.png")
        self.reject_slice("nothing.vtu", mesh="nothing.vtu")
        self.reject_slice("nowhere/cut.exr", output="nowhere/cut.exr", code=1)
        self.reject(2, "would replace", "slice", self.cube, "-o", "cut.exr", "--json", "cut.exr")

    def test_pictures_too_large_for_memory_say_what_fits(self):
        fields = {f"f{i}": range(8) for i in range(8)}
        self.write("many.vtu", vtu_text(fields=fields))
        self.assertRegex(self.reject_slice("--resolution", "--resolution", "16384", mesh="many.vtu"), r"\d+ would fit")

    def test_disk_full_leaves_nothing(self):
        def limit():
            resource.setrlimit(resource.RLIMIT_FSIZE, (2000, 2000))

        for name in ("cut.exr", "cut.png"):
            self.reject(1, name, "slice", self.stokes, "-o", name, "--quiet", "--normal", "1,1,1", preexec_fn=limit)

    def test_auto_says_what_it_chose(self):
        report = self.slice(self.cube, "-o", "cut.exr", "--algorithm", "auto")
        self.assertIn(report["algorithm"], report["algorithm_reason"])
        self.assertNotEqual(report["algorithm"], "auto")
        self.assertIn("auto chose", self.succeed("slice", self.cube, "-o", "cut.exr", "--algorithm", "auto"))

    def test_values_that_are_not_finite_are_left_out_of_the_range(self):
        # Every element of the cube has node 0.
        self.write("nan.vtu", vtu_text(fields={"f": ["nan", *range(7)], "g": range(8)}))
        channels = {c["name"]: c["range"] for c in self.slice("nan.vtu", "-o", "cut.exr")["image"]["channels"]}
        self.assertIsNone(channels["f"])
        self.assertEqual(len(channels["g"]), 2)
        self.reject_slice("finite", "--field", "f", mesh="nan.vtu", output="cut.png")


class PageParser(html.parser.HTMLParser):
    """Counts tags, and notes what a page would load or leaves open."""

    VOID = {"meta", "br", "path", "line", "circle"}

    def __init__(self, text):
        super().__init__()
        self.counts, self.open, self.text, self.loaded = {}, [], "", []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attributes):
        self.counts[tag] = self.counts.get(tag, 0) + 1
        self.loaded += [value for name, value in attributes if name in ("src", "href")]
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attributes):
        self.counts[tag] = self.counts.get(tag, 0) + 1

    def handle_endtag(self, tag):
        if tag in self.VOID:
            return
        assert self.open and self.open[-1] == tag, f"</{tag}> within {self.open}"
        self.open.pop()

    def handle_data(self, text):
        self.text += text


class FocusTraces(AppTest):
    """tessera focus-trace."""

    COLUMNS = "step x y z moved better_ms rest_ms sampled reused dropped leaves voxels bytes spacing relative_max relative_rms nodes nodes_near cut_short"
    # To the sphere, away, hardly moved, and back.
    PATH = "# a path\n1 0 0\n\n-4, 1,1  # away\n-4 1 1.001\r\n1,0,0\n"

    def setUp(self):
        super().setUp()
        self.write("path.txt", self.PATH)

    def command(self, *options, path="path.txt", mesh=None):
        return ["focus-trace", mesh or self.stokes, "--path", path, "--radius", "1", *options]

    def rows(self, *options, **command):
        self.succeed(*self.command("-o", "trace.csv", "--quiet", *options, **command))
        with open(self.folder / "trace.csv", newline="") as file:
            rows = list(csv.DictReader(file))
        self.assertEqual(list(rows[0]), self.COLUMNS.split())
        return rows

    def test_csv_has_a_row_a_step_and_coming_back_samples_nothing(self):
        rows = self.rows()
        self.assertEqual([[float(row[k]) for k in ("step", "x", "y", "z")] for row in rows], [[1, 1, 0, 0], [2, -4, 1, 1], [3, -4, 1, 1.001], [4, 1, 0, 0]])
        for row in rows:
            self.assertEqual(int(row["voxels"]), int(row["leaves"]) * 16**3)
            self.assertEqual(float(row["spacing"]), 20 / 255)
            self.assertEqual(row["cut_short"], "false")
            self.assertLessEqual(int(row["nodes"]), int(row["nodes_near"]))
        first, away, still, back = rows
        for row in (first, away, back):
            self.assertEqual(row["moved"], "true")
            self.assertGreater(float(row["rest_ms"]), float(row["better_ms"]))
        self.assertGreater(int(away["sampled"]), 0)
        self.assertEqual([still[k] for k in ("moved", "better_ms", "sampled", "reused")], ["false", "", "0", "0"])
        self.assertEqual(back["sampled"], "0")
        self.assertGreater(int(back["reused"]), 0)
        for key in ("leaves", "spacing", "relative_max", "relative_rms", "nodes"):
            self.assertEqual(back[key], first[key])
        self.assertGreater(int(first["nodes"]), 100)
        self.assertLess(0, float(first["relative_rms"]))
        self.assertLess(float(first["relative_rms"]), float(first["relative_max"]))

    def test_a_linear_field_is_shown_as_it_is(self):
        # A node within the cube; all corners but (1, 1, 0) are within the radius too.
        inner = (0.4, 0.45, 0.6)
        centre = len(CUBE_POINTS)
        faces = [(0, 1, 3), (0, 3, 2), (4, 5, 7), (4, 7, 6), (0, 1, 5), (0, 5, 4), (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 3, 7), (1, 7, 5)]
        points = [*CUBE_POINTS, inner]
        self.write("inner.vtu", vtu_text(points, [(*face, centre) for face in faces], fields={"f": [p[0] - 2 * p[1] + 3 for p in points]}))
        self.write("path.txt", "0.4 0.45 0.6")
        row = self.rows("--resolution", "50", mesh="inner.vtu")[0]
        self.assertEqual((row["nodes"], row["nodes_near"]), ("8", "8"))
        self.assertLess(float(row["relative_max"]), 1e-6)
        # Where the lattice ends within the cube only its first corner and the node within have a whole cell.
        row = self.rows("--spacing", "0.03", mesh="inner.vtu")[0]
        self.assertEqual((row["nodes"], row["nodes_near"]), ("2", "8"))
        # A peak at the node within: trilinear cells cut it off, and the corners are as they were.
        self.write("peak.vtu", vtu_text(points, [(*face, centre) for face in faces], fields={"f": [0.0] * 8 + [1.0]}))
        row = self.rows("--resolution", "10", mesh="peak.vtu")[0]
        self.assertGreater(float(row["relative_max"]), 0.01)
        self.assertAlmostEqual(float(row["relative_max"]) / 8**0.5, float(row["relative_rms"]), places=6)

    def test_page_stands_alone(self):
        self.write("a<b&c.vtu", self.stokes.read_bytes())
        self.succeed(*self.command("-o", "trace.HTML", "--quiet", mesh="a<b&c.vtu"))
        page = PageParser((self.folder / "trace.HTML").read_text(encoding="utf-8"))
        self.assertEqual(page.open, [])
        self.assertEqual((page.counts["svg"], page.counts["table"], page.counts["tr"]), (1, 1, 5))
        self.assertEqual(page.loaded, [])
        self.assertNotIn("script", page.counts)
        # Three times to better, three to rest, four of memory.
        self.assertEqual(page.counts["circle"], 10)
        for words in ("a<b&c.vtu (18,598 elements)", "by software on", "finest spacing 0.07843", "radius 1", "milliseconds", "MB", "step of the path", "jitter"):
            self.assertIn(words, page.text)

    def test_report_and_table_tell_the_same(self):
        report = self.report(*self.command())
        self.assertEqual(list(report["steps"][0]), self.COLUMNS.split())
        self.assertEqual((report["output"], report["error_field"], report["finest_spacing"]), (None, "pressure", 20 / 255))
        self.assertEqual((report["summary"]["moves"], report["summary"]["too_small"], report["summary"]["rest"]["count"]), (2, 1, 2))
        self.assertIsNone(report["steps"][2]["better_ms"])
        text = self.succeed(*self.command())
        self.assertRegex(text, r"\n +3 +jitter +[0-9.]+ +0 +0 +0 ")
        self.assertRegex(text, r"2 moves: better after [0-9.,]+ ms \(median\) and [0-9.,]+ ms \(99 %\), at rest after [0-9.,]+ ms \(median\)")
        self.assertEqual(sorted(os.listdir(self.folder)), ["cube.vtu", "path.txt"])
        for line in text.splitlines():
            if re.search(r"\S  +\S", line):
                self.assertLessEqual(len(line), 80, text)

    def test_small_budget_drops_bricks_and_warns_when_it_cuts_short(self):
        rows = self.rows("--budget", "4M", "--field", "pressure")
        self.assertGreater(sum(int(row["dropped"]) for row in rows), 0)
        for row in rows:
            self.assertLessEqual(int(row["bytes"]), 4000000)
        result = self.run_tessera(*self.command("-o", "trace.csv", "--quiet", "--budget", "2M", "--field", "pressure"))
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertRegex(result.stderr, "^tessera: warning: .*--budget")
        self.assertIn(",true\n", (self.folder / "trace.csv").read_text())

    def test_bad_input_says_what_is_wrong(self):
        for line, text in ((2, "0 0 0\n1 2\n"), (3, "# places\n\n1 2 x\n")):
            self.write("bad.txt", text)
            self.reject(2, f"bad.txt, line {line}:", *self.command("-o", "trace.csv", path="bad.txt"))
        self.reject(2, ".csv .html '.txt'", *self.command("-o", "trace.txt"))
        self.reject(2, "--format", *self.command("--format", "csv"))
        self.reject(2, "would replace path.txt", *self.command("-o", "path.csv", "--json", "path.txt"))
        self.reject(2, "--radius 0", "focus-trace", self.cube, "--path", "path.txt", "--radius", "0")
        self.reject(2, "--spacing", *self.command("--spacing", "1", "--resolution", "9"))
        self.reject(2, "--budget", *self.command("--budget", "none"))
        self.reject(2, "budget 1000 small", *self.command("--budget", "1K"))
        self.reject(1, "nowhere/trace.csv", *self.command("-o", "nowhere/trace.csv"))


class Series(AppTest):
    def setUp(self):
        super().setUp()
        for step in range(3):
            points = [(x * (1 + step), y, z) for x, y, z in CUBE_POINTS]
            self.write(f"run_{step}.vtu", vtu_text(points=points, fields={"f": [step * p[0] ** 2 for p in points]}))
        collection = "".join(f'<DataSet timestep="{s}" file="run_{s}.vtu"/>' for s in range(3))
        self.write("all.pvd", f'<?xml version="1.0"?><VTKFile type="Collection"><Collection>{collection}</Collection></VTKFile>')

    def test_all_steps_share_one_lattice(self):
        for source in ("run_*.vtu", "all.pvd"):
            for options in (["--refine", "element-size"], ["--refine", "error", "--max-error", "5%"], ["--refine", "uniform", "--resolution", "30"]):
                self.succeed("resample", source, "-o", "out_####.vdb", "--json", "report.json", *options)
                report = json.loads((self.folder / "report.json").read_text())
                self.assertEqual(len(report["steps"]), 3)
                self.assertEqual(report["series"]["fields"][0]["ranges"], [[0, 18]])
                self.assertGreaterEqual(report["stages"]["read"], 0)
                lattices = []
                for step in range(3):
                    info = self.report("info", f"out_{step:04}.vdb")
                    lattices.append((info["lattice"]["origin"], info["lattice"]["spacing"]))
                    (self.folder / f"out_{step:04}.vdb").unlink()
                self.assertEqual(lattices[0], lattices[1])
                self.assertEqual(lattices[0], lattices[2])

    COARSE = ("--refine", "uniform", "--resolution", "20", "--quiet")

    def write_collection(self, name, *entries):
        text = "".join(f"<DataSet {entry}/>" for entry in entries)
        return self.write(name, f'<?xml version="1.0"?><VTKFile type="Collection"><Collection>{text}</Collection></VTKFile>')

    def write_halves(self):
        """A cube at two times, whole and in two parts that have the cells of each other as ghosts."""
        for part in range(2):
            ghosts = " ".join(str(int((i < 3) != (part == 0))) for i in range(6))
            array = f'<CellData><DataArray type="UInt8" Name="vtkGhostType" format="ascii">{ghosts}</DataArray></CellData>'
            for step in range(2):
                text = vtu_text(fields={"f": [step + p[0] for p in CUBE_POINTS]})
                self.write(f"half_{step}_{part}.vtu", text.replace("</PointData>", "</PointData>" + array))
        for step in range(2):
            self.write(f"whole_{step}.vtu", vtu_text(fields={"f": [step + p[0] for p in CUBE_POINTS]}))
        self.write_collection("halves.pvd", *(f'timestep="{(0.1, 2.5)[s]}" part="{p}" file="half_{s}_{p}.vtu"' for s in (0, 1) for p in (0, 1)))

    def test_parts_of_a_step_are_one_mesh(self):
        self.write_halves()
        self.succeed("resample", "halves.pvd", "-o", "half_%d.vdb", "--json", "halves.json", *self.COARSE)
        self.succeed("resample", "whole_0.vtu", "whole_1.vtu", "-o", "whole_%d.vdb", "--json", "wholes.json", *self.COARSE)
        halves, wholes = (json.loads((self.folder / name).read_text()) for name in ("halves.json", "wholes.json"))
        self.assertEqual(len(halves["steps"]), 2)
        for half, whole in zip(halves["steps"], wholes["steps"]):
            self.assertEqual(half["voxels"], whole["voxels"])
            self.assertEqual(half["mesh"]["blanked_cells"], 6)
            for key in ("cells", "elements", "nodes", "boundary_faces", "non_conforming_faces", "bounds", "fields"):
                self.assertEqual(half["mesh"][key], whole["mesh"][key], key)
        self.assertEqual(halves["steps"][1]["files"], ["half_1_0.vtu", "half_1_1.vtu"])
        self.assertEqual(self.report("info", "half_1.vdb")["source"], "halves.pvd")
        self.assertIn("claims hold", self.succeed("verify", "halves.pvd", "half_0.vdb", "--time-step", "0"))
        self.assertEqual(self.report("info", "halves.pvd", "--time-step", "1")["mesh"]["fields"][0]["ranges"], [[1, 2]])
        self.assertEqual(self.report("resample", "halves.pvd", "--time-step", "0", "-o", "one.vdb", *self.COARSE)["time"], 0.1)
        self.reject(2, "halves.pvd 2", "info", "halves.pvd", "--time-step", "2")
        self.reject(2, "would replace", "tets", "halves.pvd", "-o", "half_0_1.vtu")

    def test_both_readers_and_any_threads_join_parts_alike(self):
        self.write_halves()
        files = []
        for i, options in enumerate((["--threads", "1"], ["--threads", "3"], ["--reader", "in-process"])):
            self.succeed("resample", "halves.pvd", "-o", f"out{i}_#.vdb", *options, *self.COARSE)
            files.append((self.folder / f"out{i}_1.vdb").read_bytes())
        self.assertEqual(files[0], files[1])
        self.assertEqual(files[0], files[2])

    def test_times_go_into_files_and_reports(self):
        self.write_collection("t.pvd", 'timestep="1e-1" file="run_0.vtu"', 'timestep="0.30000000000000004" file="run_1.vtu"')
        report = self.report("resample", "t.pvd", "-o", "t_%03d.vdb", *self.COARSE[:-1])
        times = [0.1, 0.30000000000000004]
        self.assertEqual(report["series"]["times"], times)
        self.assertEqual([step["time"] for step in report["steps"]], times)
        self.assertEqual([step["step"] for step in report["steps"]], [0, 1])
        for step in range(2):
            self.assertEqual(self.report("info", f"t_{step:03}.vdb")["time"], times[step])
        self.assertIn("time 0.30000000000000004", self.succeed("info", "t_001.vdb"))
        self.assertIn(b"tessera_time", (self.folder / "t_000.vdb").read_bytes())
        self.succeed("resample", "run_0.vtu", "-o", "plain.vdb", *self.COARSE)
        self.assertNotIn(b"tessera_time", (self.folder / "plain.vdb").read_bytes())
        self.assertNotIn("time", self.report("info", "plain.vdb"))

    def test_times_choose_steps_which_keep_their_numbers(self):
        report = self.report("resample", "all.pvd", "-o", "out_%d.vdb", "--times", "1:", *self.COARSE[:-1])
        self.assertEqual([step["time"] for step in report["steps"]], [1, 2])
        self.assertEqual(sorted(p.name for p in self.folder.glob("out_*")), ["out_1.vdb", "out_2.vdb"])
        self.assertEqual(self.report("resample", "all.pvd", "-o", "one.vdb", "--times", "1:1.5", *self.COARSE[:-1])["time"], 1)
        self.reject(2, "--times 'x:1'", "resample", "all.pvd", "--dry-run", "--times", "x:1")
        for times in (":", "1", "", "2:1", "1:2:3", "nan:"):
            self.reject(2, "--times", "resample", "all.pvd", "--dry-run", f"--times={times}")
        self.reject(2, "all.pvd 0 2", "resample", "all.pvd", "--dry-run", "--times", "5:6")
        self.reject(2, "run_0.vtu .pvd", "resample", "run_*.vtu", "--dry-run", "--times", "0:1")

    def test_names_that_a_shell_expanded_are_in_natural_order(self):
        for number in (10, 2, 1):
            self.write(f"step_{number}.vtu", vtu_text(fields={"f": [number * p[0] for p in CUBE_POINTS]}))
        names = ["step_1.vtu", "step_10.vtu", "step_2.vtu"]
        report = self.report("resample", *names, "-o", "out_####.vdb", *self.COARSE[:-1])
        self.assertEqual([step["input"] for step in report["steps"]], ["step_1.vtu", "step_2.vtu", "step_10.vtu"])
        self.assertEqual(self.report("info", "out_0002.vdb")["source"], "step_10.vtu")
        self.reject(2, "step_1.vtu twice", "resample", *names, "./step_1.vtu", "-o", "x_####.vdb")
        self.reject(2, "all.pvd", "resample", "all.pvd", "step_1.vtu", "-o", "x_####.vdb")

    def test_output_names(self):
        for pattern, name in {"a%04d.vdb": "a0001.vdb", "b%d.vdb": "b1.vdb", "c%3d.vdb": "c  1.vdb", "d%02d%%.vdb": "d01%.vdb", "e#_##.vdb": "e#_01.vdb", "f#%d.vdb": "f#1.vdb"}.items():  # fmt: skip
            with self.subTest(pattern=pattern):
                self.succeed("resample", "run_0.vtu", "run_1.vtu", "-o", pattern, *self.COARSE)
                self.assertTrue((self.folder / name).exists(), sorted(os.listdir(self.folder)))
        for pattern in ("%s.vdb", "%.vdb", "a%b.vdb", "%-4d.vdb", "%004d.vdb", "%x.vdb", "%4%.vdb"):
            with self.subTest(pattern=pattern):
                self.reject(2, "%04d", "resample", "run_0.vtu", "run_1.vtu", "-o", pattern, *self.COARSE)
        for pattern in ("same.vdb", "same%%.vdb"):
            self.reject(2, "#### %04d", "resample", "run_0.vtu", "run_1.vtu", "-o", pattern, *self.COARSE)

    def test_info_shows_the_steps_and_the_ranges_over_all(self):
        for inputs in (["all.pvd"], ["run_*.vtu"], ["run_0.vtu", "run_2.vtu", "run_1.vtu"]):
            report = self.report("info", *inputs)
            self.assertEqual(report["series"]["fields"][0]["ranges"], [[0, 18]])
            self.assertEqual(report["series"]["bounds"], [[0, 0, 0], [3, 1, 1]])
            self.assertEqual([step["mesh"]["elements"] for step in report["steps"]], [6, 6, 6])
            self.assertEqual([step["input"].rsplit("/")[-1] for step in report["steps"]], [f"run_{s}.vtu" for s in range(3)])
        self.assertEqual(self.report("info", "all.pvd")["series"]["times"], [0, 1, 2])
        text = self.succeed("info", "all.pvd")
        self.assertRegex(text, r"step +time +cells +elements +nodes +files\n +0 +0 +6 +6 +8 +run_0.vtu\n")
        self.assertRegex(text, r"f +points +1 +0 +18")
        self.write("run_3.vtu", vtu_text(fields={"g": [0] * 8}))
        self.assertIn("field 'f' is in 3 of 4 steps only", self.succeed("info", "run_*.vtu"))
        self.reject(2, "vdb", "info", "a.vdb", "b.vdb")
        self.reject(2, "--repair", "info", "all.pvd", "--repair")
        self.reject(2, "would replace", "info", "all.pvd", "--json", "run_1.vtu")

    def test_collections_that_go_wrong(self):
        self.write("empty.vtu", "")
        self.write("grid.vtk", "# vtk DataFile Version 3.0\nx\nASCII\nDATASET STRUCTURED_POINTS\nDIMENSIONS 2 2 2\nORIGIN 0 0 0\nSPACING 1 1 1\n")
        cases = {
            "bad.pvd byte gone.vtu": ['timestep="0" file="gone.vtu"'],
            "bad.pvd byte gone.vtu exist": ['timestep="0" part="0" file="run_0.vtu"', 'timestep="0" part="1" file="gone.vtu"'],
            "bad.pvd byte 'soon' number": ['timestep="soon" file="run_0.vtu"'],
            "bad.pvd byte .pvd": ['timestep="0" file="bad.pvd"'],
            "all.pvd byte .pvd": ['timestep="0" file="all.pvd"'],
            "bad.pvd byte /dev/zero regular": ['timestep="0" file="/dev/zero"'],
            "bad.pvd byte part twice": ['timestep="0" part="0" file="run_0.vtu"', 'timestep="0" part="0" file="run_1.vtu"'],
            "grid.vtk kind run_0.vtu": ['timestep="0" part="0" file="run_0.vtu"', 'timestep="0" part="1" file="grid.vtk"'],
            "empty.vtu empty": ['timestep="0" part="0" file="run_0.vtu"', 'timestep="0" part="1" file="empty.vtu"'],
            "bad.pvd no files": [],
        }
        for words, entries in cases.items():
            with self.subTest(words=words):
                self.write_collection("bad.pvd", *entries)
                self.reject(2, words, "resample", "bad.pvd", "-o", "out_####.vdb")
                self.reject(2, words, "info", "bad.pvd")
        os.symlink("/dev/zero", self.folder / "zero.pvd")
        os.mkfifo(self.folder / "pipe.pvd")
        for name in ("zero.pvd", "pipe.pvd"):
            self.reject(2, f"{name} regular", "resample", name, "-o", "out_####.vdb")
            self.reject(2, f"{name} regular", "info", name)


class Compare(AppTest):
    def test_two_code_paths_agree(self):
        text = self.succeed("compare", self.stokes, "--algorithms", "software,software", "--resolution", "40", "--runs", "2")
        self.assertIn("the algorithms agree", text)
        report = self.report("compare", self.stokes, "--algorithms", "software,software", "--resolution", "40", "--field", "pressure")
        self.assertTrue(report["agrees"])
        mesh = report["meshes"][0]
        self.assertEqual(max(mesh["lattice"]["points"]), 40)
        first, second = mesh["algorithms"]
        self.assertEqual(first["check"], second["check"])
        self.assertEqual((first["check"]["holes"], first["check"]["spills"], first["check"]["wrong_values"]), (0, 0, 0))
        against = mesh["against_first"][0]
        self.assertEqual(against["covered_by_both"], first["check"]["covered"])
        self.assertEqual((against["only_first"], against["only_this"], against["away_from_boundary"]), (0, 0, 0))
        self.assertEqual([f["field"] for f in against["fields"]], ["pressure"])
        self.assertEqual(against["fields"][0]["max"], 0)

    def test_every_algorithm_here_agrees(self):
        report = self.report("compare", self.stokes, "--resolution", "24", "--runs", "1")
        self.assertTrue(report["agrees"])
        ran = [a["label"] for a in report["meshes"][0]["algorithms"]]
        self.assertEqual(ran[0], "software")
        self.assertEqual(len(ran), len(set(ran)))
        if os.environ.get("TESSERA_REQUIRE_GL"):
            self.assertEqual(report["absent"], [])
        if "hybrid" not in ran:
            return
        target = report["meshes"][0]["algorithms"][ran.index("hybrid")]["target"]
        names = ["hybrid", "hybrid:processor", "slicing:device", f"slicing:{target}:processor"]
        by_both = self.report("compare", self.stokes, "--resolution", "24", "--runs", "2", "--algorithms", ",".join(names))
        self.assertEqual([a["label"] for a in by_both["meshes"][0]["algorithms"]], names)
        for against in by_both["meshes"][0]["against_first"]:
            self.assertEqual((against["only_first"], against["only_this"], against["fields"][0]["max"]), (0, 0, 0), against["label"])

    def test_the_grid_covers_the_cube(self):
        report = self.report("compare", self.cube, "--algorithms", "software", "--spacing", "0.125")
        self.assertEqual(report["meshes"][0]["lattice"]["points"], [9, 9, 9])
        self.assertEqual(report["meshes"][0]["algorithms"][0]["check"]["covered"], 729)

    def test_markdown_has_a_row_for_each_mesh_and_algorithm(self):
        text = self.succeed("compare", self.cube, self.stokes, "--algorithms", "software,software", "--resolution", "12", "--markdown")
        lines = text.splitlines()
        self.assertEqual(len(lines), 2 + 2 * 2)
        self.assertEqual({line.count("|") for line in lines}, {lines[0].count("|")})
        self.assertIn("cube.vtu", lines[2])

    def test_bad_usage(self):
        self.reject(2, "magic software", "compare", self.cube, "--algorithms", "magic")
        self.reject(2, "software nowhere", "compare", self.cube, "--algorithms", "software:nowhere")
        self.reject(2, "--algorithms", "compare", self.cube, "--algorithms", "software,,software")
        self.reject(2, "", "compare", self.cube, "--resolution", "1")
        self.reject(2, "", "compare", self.cube, "--resolution", "9", "--spacing", "0.1")
        self.reject(2, "", "compare", self.cube, "--spacing", "0")
        self.reject(2, "spacing", "compare", self.cube, "--spacing", "1e-9")
        self.reject(2, "", "compare", self.cube, "--runs", "0")
        self.reject(2, "speed", "compare", self.cube, "--field", "speed")
        self.reject(2, "nothing.vtu", "compare", "nothing.vtu")
        self.reject(2, "", "compare")
        self.reject(2, "would replace", "compare", self.cube, "--json", "cube.vtu")


class Bench(AppTest):
    """What accuracy costs in time."""

    FAST = ("--quick", "--runs", "2", "--seconds", "60", "--longest-run", "60", "--points", "9,17")  # nothing left out on a busy machine

    def bench(self, *words):
        text = self.succeed("bench", self.cube, "-o", "report", *self.FAST, *words)
        return text, json.loads((self.folder / "report/report.json").read_text())

    def test_every_part_of_the_report_is_there(self):
        text, report = self.bench("--algorithms", "software,hybrid:processor")
        self.assertEqual(sorted(p.name for p in (self.folder / "report").iterdir()), ["index.html", "oracle.csv", "plots", "report.json", "runs.csv"])
        self.assertEqual({v["role"] for v in report["variants"]}, {"main", "again", "peer"})
        runs = report["runs"]
        self.assertEqual({r["criterion"] for r in runs}, {"uniform", "element size", "error", "focus"})
        for run in runs:
            self.assertLessEqual(run["ms"]["low"], run["ms"]["median"])
            self.assertGreaterEqual(run["ms"]["high"], run["ms"]["median"])
            self.assertEqual(run["ms"]["count"], 2)
        # The field is linear: trilinear bricks are exact, up to float.
        self.assertLess(max(r["error"]["max"] for r in runs), 1e-6)
        for variant in report["oracle"]["variants"]:
            self.assertLess(variant["max"], 1e-6, variant)
            if variant["variant"] != "VTK":
                self.assertEqual((variant["holes"], variant["spills"]), (0, 0), variant)
        self.assertEqual({e["bound"] for e in report["equal_error"]}, {0.1, 0.05, 0.02, 0.01})
        for kind in ("resolution", "elements"):
            self.assertIn("software", [f["variant"] for f in report["scaling"][kind]])
        self.assertEqual([s["elements"] for s in report["paper"]["data_sets"]], [6])
        grid = report["paper"]["data_sets"][0]["grids"][0]
        self.assertEqual(grid["published"]["MultiComb"]["tot_s"], 0.69)
        self.assertIn("software", grid["measured"])
        self.assertTrue(report["roofline"]["runs"] and report["warm"] and report["advice"] and report["again"])
        self.assertIn("is the quickest algorithm here", text)
        rows = (self.folder / "report/runs.csv").read_text().splitlines()
        self.assertEqual(len(rows), 1 + len(runs))

    def test_errors_are_those_of_an_independent_computation(self):
        self.succeed("tets", DATA / "disk_out_ref/disk_out_ref.vtu", "-o", "tets.vtu")
        self.succeed("bench", "tets.vtu", "-o", "report", *self.FAST, "--field", "Temp", "--algorithms", "software,compute", "--no-vtk")
        script = pathlib.Path(__file__).resolve().parents[2] / "bench/check_oracle.py"
        done = subprocess.run([sys.executable, script, "tets.vtu", "report"], cwd=self.folder, capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        self.assertIn("1000 places, 2 variants: 0 differences", done.stdout)

    def test_two_reports_are_compared(self):
        _, first = self.bench("--algorithms", "software", "--no-vtk")
        shutil.copy(self.folder / "report/report.json", self.folder / "old.json")
        # Every time is a tenth of what it was: this build is slow.
        for run in first["runs"]:
            for key in ("median", "low", "high"):
                run["ms"][key] /= 10
        for part in [*first["scaling"]["elements"]]:
            for point in part["points"]:
                for key in ("median", "low", "high"):
                    point["ms"][key] /= 10
        for warm in first["warm"]:
            for key in ("median", "low", "high"):
                warm["ms"][key] /= 10
        (self.folder / "quick.json").write_text(json.dumps(first))
        text, report = self.bench("--algorithms", "software", "--no-vtk", "--compare", "quick.json")
        self.assertIn("software got slower", text)
        self.assertEqual(report["compared"]["algorithms"][0]["verdict"], "slower")
        self.reject(2, "graded", "bench", "graded:600", "-o", "other", *self.FAST, "--compare", "old.json")

    def test_bad_usage(self):
        self.reject(2, "required", "bench", self.cube)
        self.reject(2, "nothing.vtu", "bench", "nothing.vtu", "-o", "report")
        self.reject(2, "--peer", "bench", self.cube, "-o", "report", "--peer", "probe")
        self.reject(2, "magic", "bench", self.cube, "-o", "report", "--algorithms", "magic")
        self.reject(2, "report.json", "bench", self.cube, "-o", "report", "--compare", self.cube)
        self.write("file", "x")
        self.reject(1, "file", "bench", self.cube, "-o", "file")
        extra = f'<DataArray type="Float64" Name="v" NumberOfComponents="3" format="ascii">{" ".join(["1"] * 24)}</DataArray>'
        self.write("vector.vtu", vtu_text(fields={}, extra=extra))
        self.reject(2, "scalar --field", "bench", "vector.vtu", "-o", "report")


class Reader(AppTest):
    """Meshes are read by a process of its own."""

    def test_the_reader_of_common_formats_starts_without_the_libraries_of_others(self):
        loaded = subprocess.run(["ldd", pathlib.Path(TESSERA).parent / "tessera_read_mesh"], capture_output=True, text=True, check=True).stdout
        self.assertIn("libvtkIOXML", loaded)
        for library in ("hdf5", "netcdf", "openvdb"):
            self.assertNotIn(library, loaded)

    def read_by_a_stopped_child(self, *options):
        """A run of `info` and its child, stopped while it reads (or loads its libraries)."""
        for _ in range(10):
            process = subprocess.Popen([TESSERA, "info", self.stokes, *options], cwd=self.folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
            self.addCleanup(process.kill)
            child = self.stop_child(process)
            if child:
                return process, child
            process.communicate()
        self.fail("no child was seen in ten runs")

    def stop_child(self, process):
        children = pathlib.Path(f"/proc/{process.pid}/task/{process.pid}/children")
        while process.poll() is None:
            try:
                for child in map(int, children.read_text().split()):
                    if os.readlink(f"/proc/{child}/exe").endswith("tessera_read_mesh"):  # until then its parent waits for it
                        os.kill(child, signal.SIGSTOP)
                        return child
            except OSError:
                pass  # it ended between two of these lines
        return None

    def finish(self, process, child, code):
        _, errors = process.communicate(timeout=60)
        self.assertEqual(process.returncode, code, errors)
        self.assertEqual(len(errors.splitlines()), 1, errors)
        self.assertFalse(pathlib.Path(f"/proc/{child}").exists())
        self.assertEqual(os.listdir(self.folder), ["cube.vtu"])
        return errors

    def test_both_readers_give_the_same_file(self):
        files = set()
        for options in ([], ["--reader", "isolated"], ["--reader", "in-process"]):
            self.succeed("resample", self.stokes, "-o", "out.vdb", "--quiet", *options)
            files.add((self.folder / "out.vdb").read_bytes())
        self.assertEqual(len(files), 1)

    def test_a_crash_of_the_reader_is_one_line(self):
        process, child = self.read_by_a_stopped_child()
        os.kill(child, signal.SIGSEGV)
        os.kill(child, signal.SIGCONT)
        self.assertRegex(self.finish(process, child, 2), r"stokes_p1.vtu: the reader crashed \(signal 11")

    def test_a_reader_that_takes_too_long_is_one_line(self):
        process, child = self.read_by_a_stopped_child("--max-read-time", "1")
        self.assertIn("stokes_p1.vtu: reading it took more than 1 s", self.finish(process, child, 2))

    def test_interrupting_ends_the_reader_too(self):
        for number, code in ((signal.SIGINT, 130), (signal.SIGTERM, 143)):
            process, child = self.read_by_a_stopped_child()
            process.send_signal(number)
            self.assertIn("interrupted", self.finish(process, child, code))

    def test_too_little_memory_says_what_it_would_take(self):
        # 60^3 points become over a million tetrahedra.
        n = 60
        head = f"# vtk DataFile Version 3.0\ngrid\nBINARY\nDATASET STRUCTURED_POINTS\nDIMENSIONS {n} {n} {n}\nORIGIN 0 0 0\nSPACING 1 1 1\n"
        self.write("grid.vtk", (head + f"POINT_DATA {n**3}\nSCALARS f unsigned_char 1\nLOOKUP_TABLE default\n").encode() + bytes(n**3))
        for command in (["info", "grid.vtk"], ["resample", "grid.vtk", "-o", "out.vdb"], ["tets", "grid.vtk", "-o", "out.vtu"]):
            line = self.reject(2, "grid.vtk memory", *command, "--max-memory", "40M")
            self.assertRegex(line, r"more than 40 MiB .* would be \d+ MiB")
        self.succeed("info", "grid.vtk")
        line = self.resample_fails("--max-memory before", "grid.vtk", "--max-memory", "250M")
        enough = line.split("--max-memory ")[-1].split()[0]
        result = self.run_tessera("resample", "grid.vtk", "-o", "out.vdb", "--max-memory", enough, "--brick-size", "8")
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("the finest spacing is", result.stderr)
        for algorithm in ("software", "slicing"):
            report = self.report("resample", "grid.vtk", "-o", "out.vdb", "--max-memory", "600M", "--algorithm", algorithm)
            self.assertLess(report["peak_memory_bytes"], 600 << 20)

    def test_processor_time_is_named(self):
        n = 180
        head = f"# vtk DataFile Version 3.0\ngrid\nBINARY\nDATASET STRUCTURED_POINTS\nDIMENSIONS {n} {n} {n}\nORIGIN 0 0 0\nSPACING 1 1 1\n"
        self.write("grid.vtk", (head + f"POINT_DATA {n**3}\nSCALARS f unsigned_char 1\nLOOKUP_TABLE default\n").encode() + bytes(n**3))
        for most in (1, 100):  # the program is ended by force, or by a signal

            def limit():
                resource.setrlimit(resource.RLIMIT_CPU, (1, most))

            self.reject(1, "grid.vtk (ulimit -t)", "info", "grid.vtk", preexec_fn=limit)
            self.reject(1, "(ulimit -t) no unfinished file", "resample", self.cube, "-o", "out.vdb", "--quiet", "--refine", "uniform", "--resolution", "1500",
                        "--max-voxels", "10G", preexec_fn=limit)  # fmt: skip

    def test_bad_options(self):
        for value in ("0", "-1", "nan", "inf", "soon"):
            self.reject(2, "--max-read-time", "info", self.cube, f"--max-read-time={value}")
        self.reject(2, "--reader", "info", self.cube, "--reader", "psychic")
        self.reject(2, "--max-memory", "info", self.cube, "--max-memory", "lots")

    def test_bounds_that_would_be_without_effect_are_refused(self):
        self.succeed("resample", self.cube, "-o", "cube.vdb", "--refine", "uniform", "--resolution", "9")
        self.reject(2, "--max-read-time in-process", "info", self.cube, "--reader", "in-process", "--max-read-time", "5")
        self.reject(2, "--max-memory in-process", "info", self.cube, "--reader", "in-process", "--max-memory", "1G")
        self.succeed("info", "cube.vdb", "--max-read-time", "50")
        self.reject(2, "cube.vdb memory", "info", "cube.vdb", "--max-memory", "1000")
        self.succeed("picture", "cube.vdb", "-o", "cube.png", "--max-read-time", "50", "--mesh", self.cube)
        self.succeed("resample", self.cube, "-o", "out.vdb", "--reader", "in-process", "--max-memory", "1G")
        self.reject(2, "--max-memory", "resample", self.cube, "-o", "more.vdb", "--reader", "in-process", "--max-memory", "10M")

    def test_few_open_files_are_enough_or_one_line(self):
        codes = set()
        for files in range(6, 33):
            def limit():
                resource.setrlimit(resource.RLIMIT_NOFILE, (files, files))

            result = self.run_tessera("info", self.cube, preexec_fn=limit)
            codes.add(result.returncode)
            self.assertIn(result.returncode, (0, 1), f"{files} files: {result.stderr}")
            if result.returncode == 1:
                self.assertEqual(len(result.stderr.splitlines()), 1, result.stderr)
                self.assertRegex(result.stderr, "open files.*ulimit -n")
        self.assertEqual(codes, {0, 1})

    def test_few_open_files_are_one_line_for_every_command(self):
        self.succeed("resample", self.cube, "-o", "cube.vdb", "--refine", "uniform", "--resolution", "9")
        for files, arguments in ((4, ["info", "cube.vdb"]), (5, ["resample", self.cube, "-o", "out.vdb"]), (6, ["verify", self.cube, "cube.vdb"]),
                                 (9, ["render", "cube.vdb", "-o", "out.png"]), (8, ["render", self.cube, "-o", "out.png"])):  # fmt: skip
            self.reject(1, "open files (ulimit -n)", *arguments, preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_NOFILE, (files, files)))

    def test_reads_without_proc(self):
        hide = ["unshare", "--mount", "sh", "-c", 'mount -t tmpfs none /proc && exec "$@"', "sh"]
        if os.geteuid() != 0 or subprocess.run([*hide, "true"], capture_output=True).returncode:
            self.skipTest("hiding /proc needs root")
        expected = self.succeed("info", self.stokes)
        for program in (TESSERA, os.path.relpath(TESSERA, self.folder)):
            result = subprocess.run([*hide, program, "info", self.stokes], capture_output=True, text=True, cwd=self.folder)
            self.assertEqual((result.returncode, result.stdout, result.stderr), (0, expected, ""))

    def test_the_readers_own_command_is_hidden_and_useless_by_hand(self):
        self.assertNotIn("read-mesh", self.succeed("--help"))
        self.reject(2, "started by tessera itself", "read-mesh")
        self.reject(2, "started by tessera itself", "read-mesh", "1", "1000", "1", "-1", self.cube)

    def test_libraries_that_can_not_start_are_one_line(self):
        ends = set()
        for mebibytes in range(150, 301, 25):
            def limit():
                resource.setrlimit(resource.RLIMIT_AS, (mebibytes << 20, mebibytes << 20))

            result = self.run_tessera("info", self.cube, preexec_fn=limit)
            ends.add(result.returncode)
            self.assertIn(result.returncode, (0, 1, 127), result.stderr)  # 127: the system can't load them
            self.assertEqual(len(result.stderr.splitlines()), 0 if result.returncode == 0 else 1, result.stderr)
        self.assertTrue(ends - {127})

    def test_no_address_space_is_enough_or_one_line(self):
        """Whatever memory there is: done, or one line and no file."""
        seen = set()
        for mebibytes in (300, 400, 500, 600, 700, 800, 1000, 1500):
            def limit():
                resource.setrlimit(resource.RLIMIT_AS, (mebibytes << 20, mebibytes << 20))

            result = self.run_tessera("resample", self.stokes, "-o", "out.vdb", "--quiet", "--refine", "uniform", "--resolution", "300", "--threads", "1", preexec_fn=limit)
            if result.returncode == 127:
                continue  # not even the libraries can be loaded
            seen.add(result.returncode)
            self.assertIn(result.returncode, (0, 1), result.stderr)
            self.assertEqual(len(result.stderr.splitlines()), result.returncode, result.stderr)
            if result.returncode == 1:
                self.assertIn("out of memory", result.stderr)
            self.assertEqual((self.folder / "out.vdb").exists(), result.returncode == 0)
            self.assertEqual(len(os.listdir(self.folder)), 2 - result.returncode)
            (self.folder / "out.vdb").unlink(missing_ok=True)
        self.assertTrue(seen)


class Terminal(AppTest):
    """What stands on a terminal."""

    def on_a_terminal(self, *arguments, columns=80):
        """Exit code, standard output, and what the terminal was sent on standard error."""
        master, slave = pty.openpty()
        fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", 24, columns, 0, 0))
        environment = dict(os.environ, TERM="xterm")
        process = subprocess.Popen([TESSERA, *map(str, arguments)], cwd=self.folder, stdout=subprocess.PIPE, stderr=slave, text=True, env=environment)
        self.addCleanup(process.kill)
        os.close(slave)
        sent = b""
        while True:
            try:
                piece = os.read(master, 1 << 16)
            except OSError:  # the other end is closed
                break
            if not piece:
                break
            sent += piece
        os.close(master)
        output = process.communicate(timeout=300)[0]
        return process.returncode, output, sent.decode()

    def lines_drawn(self, sent, columns):
        """The texts of the progress line, each sent as a whole; what is wiped leaves nothing."""
        lines = [line for line in re.findall("\r([^\r\n\x1b]*)\x1b\\[K", sent) if line]
        for line in lines:
            self.assertLess(len(line), columns, line)
        shares = [int(re.search(r"(\d+) %", line)[1]) for line in lines]
        self.assertEqual(shares, sorted(shares), "progress went backwards")
        return lines

    def test_progress_is_one_line_that_never_goes_back(self):
        words = "reading|planning|sampling|measuring the error|extending the edges|writing"
        for columns in (80, 50):
            # How much is drawn depends on how long the work takes: a fast machine gets more of it.
            for millions in (4, 8, 16, 32):
                options = ["--refine", "error", "--max-error", "0.01%", "--brick-size", "8", "--max-voxels", f"{millions}M", "--threads", "1"]
                code, output, sent = self.on_a_terminal("resample", self.stokes, "-o", "out.vdb", *options, columns=columns)
                self.assertEqual(code, 0, sent)
                lines = self.lines_drawn(sent, columns)
                for line in lines:
                    self.assertRegex(line, f"^({words})")
                if len(lines) > 3 and any(line.startswith("sampling") for line in lines):
                    break
            else:
                self.fail(f"hardly any progress was drawn: {lines}")
            # Whatever is printed stands on a line of its own.
            rest = re.sub("\r[^\r\n\x1b]*\x1b\\[K", "", sent)
            for line in rest.splitlines():
                self.assertRegex(line, "^(tessera: warning:.*|    .*)?$")
            self.assertTrue(sent.endswith("\x1b[K") or sent.endswith("\n"), repr(sent[-80:]))

    def test_a_series_says_which_step(self):
        for step in range(3):
            shutil.copy(self.stokes, self.folder / f"run_{step}.vtu")
        code, output, sent = self.on_a_terminal("resample", "run_*.vtu", "-o", "out_#.vdb", "--refine", "uniform", "--resolution", "200", "--threads", "1")
        self.assertEqual(code, 0, sent)
        lines = self.lines_drawn(sent, 80)
        steps = [int(m[1]) for line in lines if (m := re.match(r"step (\d) of 3: ", line))]
        self.assertEqual(steps, sorted(steps))
        # A step that takes less than the time between two drawings may not be seen.
        self.assertGreaterEqual(len(set(steps)), 1)
        self.assertLessEqual(set(steps), {1, 2, 3})

    def test_quiet_or_no_terminal_draws_nothing(self):
        code, output, sent = self.on_a_terminal("resample", self.stokes, "-o", "out.vdb", "--quiet", "--refine", "uniform", "--resolution", "150")
        self.assertEqual((code, output, sent), (0, "", ""))
        self.succeed("resample", self.stokes, "-o", "out.vdb")

    def test_interruption_leaves_no_line_behind(self):
        code, output, sent = self.on_a_terminal("resample", "nothing.vtu", "-o", "out.vdb")
        self.assertEqual((code, sent.count("\n")), (2, 1))

    def test_tables_fit_eighty_columns(self):
        names = ["p", "velocity_magnitude_of_the_second_phase_averaged_over_time", "T", "k" * 90, "omega", "nut"]
        extra = "".join(f'<DataArray type="Float64" Name="S{i}" NumberOfComponents="9" format="ascii">'
                        f'{" ".join(str(0.123456789 * j - 1e-5) for j in range(72))}</DataArray>' for i in range(2))  # fmt: skip
        points = [(1234.56789 + x / 3, -98765.4321 + y / 3, 0.000123456 + z / 3) for x, y, z in CUBE_POINTS]
        self.write("wide.vtu", vtu_text(points, fields={name: [1e-9 / 3 * (i + 1) * p[0] for p in points] for i, name in enumerate(names)}, extra=extra))
        texts = [self.succeed("info", "wide.vtu"), self.succeed("resample", "wide.vtu", "-o", "out.vdb"), self.succeed("info", "out.vdb"),
                 self.succeed("verify", "wide.vtu", "out.vdb"), self.succeed("resample", "wide.vtu", "--dry-run"),
                 self.succeed("compare", "wide.vtu", "--algorithms", "software,software", "--resolution", "20", "--runs", "1"),
                 self.succeed("bench", "wide.vtu", "-o", "report", "--field", "p", "--algorithms", "software", *Bench.FAST)]  # fmt: skip
        for text in texts:
            for line in text.splitlines():
                # Sentences are the terminal's to break; rows of tables have gaps between columns.
                if re.search(r"\S  +\S", line):
                    self.assertLessEqual(len(line), 80, text)
        self.assertRegex(texts[1], r"velocity_magnitude.*\.\.\..*averaged_over_time")
        self.assertRegex(texts[1], r" kkk+\.\.\.kkk+ ")

    def test_help_fits_the_terminal(self):
        for command in ([], ["resample"], ["compare"]):
            for line in self.succeed(*command, "--help").splitlines():
                if not line.startswith("  tessera "):
                    self.assertLessEqual(len(line), 80, line)


class Help(AppTest):
    def test_every_command_has_help_with_an_example(self):
        for command in ([], ["resample"], ["info"], ["verify"], ["tets"], ["picture"], ["compare"], ["bench"], ["slice"], ["focus-trace"]):
            text = self.succeed(*command, "--help")
            self.assertIn("Example", text)
        self.reject(2, "no command 'resmaple'", "resmaple", "mesh.vtu")
        self.assertRegex(self.succeed("--version"), r"^tessera \d+\.\d+\.\d+\n$")


class Drivers(AppTest):
    """OpenGL drivers that crash, stall or lose their device cost a result that needs them, and no more."""

    CRASH = "the driver crashed (signal 11, Segmentation fault)"

    def broken(self, way, platforms=("egl", "osmesa")):
        return dict(os.environ, LD_LIBRARY_PATH=":".join(str(BROKEN_DRIVERS / p) for p in platforms), TESSERA_BROKEN_DRIVER=way)

    def sample(self, *options, env=None):
        return self.run_tessera("resample", self.cube, "-o", "out.vdb", "--refine", "uniform", "--resolution", "12", *options, env=env)

    def check_auto(self, env, reason, *options):
        """Software's result, and one warning."""
        self.assertEqual(self.sample().returncode, 0)
        expected = self.report("info", "out.vdb")
        result = self.sample("--algorithm", "auto", *options, env=env)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(result.stderr, f"tessera: warning: no OpenGL from egl-device, egl-surfaceless, osmesa: {reason}\n")
        self.assertIn("auto chose software", result.stdout)
        self.assertEqual(self.report("info", "out.vdb"), expected)
        os.remove(self.folder / "out.vdb")

    def test_a_driver_that_crashes_is_a_reason(self):
        for way in ("load", "draw"):
            env = self.broken(way)
            self.check_auto(env, self.CRASH)
            text = self.succeed("info", "--gl", env=env)
            for platform in ("egl-device", "egl-surfaceless", "osmesa"):
                self.assertIn(f"{platform}: no, {self.CRASH}\n", text)
            compared = self.succeed("compare", self.cube, "--resolution", "12", env=env)
            for algorithm in ("slicing", "hybrid"):
                self.assertIn(f"{algorithm} is left out: there is no OpenGL 4.5 here", compared)
            for arguments in (("slice", self.cube, "-o", "out.png"), ("resample", self.cube, "-o", "out.vdb")):
                self.reject(1, self.CRASH, *arguments, "--algorithm", "slicing", env=env)
        self.reject(1, f"no OpenGL from osmesa: {self.CRASH}", "render", self.cube, "-o", "out.png", "--gl", "osmesa", env=env)
        self.reject(1, f"no OpenGL from osmesa: {self.CRASH}", "compare", self.cube, "--algorithms", "hybrid:osmesa",
                    env=self.broken("load", ["osmesa"]))

    def test_a_driver_that_stalls_is_a_reason(self):
        env = self.broken("stall")
        self.check_auto(env, "the driver didn't answer within 0.3 s", "--max-driver-time", "0.3")
        self.reject(1, "the driver didn't answer within 0.3 s", "render", self.cube, "-o", "out.png", "--max-driver-time", "0.3", env=env)

    def test_other_platforms_are_used_in_place_of_a_broken_one(self):
        result = self.sample("--algorithm", "hybrid", "--json", "report.json", env=self.broken("load", ["egl"]))
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(result.stderr, f"tessera: warning: no OpenGL from egl-device, egl-surfaceless: {self.CRASH}\n")
        self.assertEqual(json.loads((self.folder / "report.json").read_text())["target"], "osmesa")

    def test_a_device_that_is_lost_is_an_error(self):
        for algorithm in ("slicing", "hybrid"):
            self.reject(1, "OpenGL failed: the device was lost", "resample", self.cube, "-o", "out.vdb", "--algorithm", algorithm,
                        "--refine", "uniform", "--resolution", "60", env=self.broken("lose"))

    def test_software_tries_no_driver(self):
        result = self.sample("--algorithm", "software", env=self.broken("load"))
        self.assertEqual((result.returncode, result.stderr), (0, ""))


if __name__ == "__main__":
    arguments = sys.argv[1:]

    def take(name):
        """An option and its value, which unittest doesn't see."""
        at = arguments.index(name)
        value = pathlib.Path(arguments[at + 1]).resolve()
        del arguments[at : at + 2]
        return value

    TESSERA = str(take("--tessera"))
    FORKED = ForkedTessera(TESSERA)
    DATA = take("--data")
    if "--broken-drivers" in arguments:
        BROKEN_DRIVERS = take("--broken-drivers")
    unittest.main(argv=[sys.argv[0], *arguments])
