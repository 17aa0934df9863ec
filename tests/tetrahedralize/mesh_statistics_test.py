#!/usr/bin/env python3
"""mesh_statistics tells sound meshes of known shape from spoilt ones.

usage: mesh_statistics_test.py [unittest arguments]
"""

import json
import pathlib
import subprocess
import sys
import tempfile
import unittest

import numpy as np
from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray
from vtkmodules.vtkCommonCore import vtkPoints
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkUnstructuredGrid
from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridWriter

import mesh_statistics

FOLDER = pathlib.Path(__file__).resolve().parent
CUBE_TETS = np.array([(0, 1, 3, 7), (0, 3, 2, 7), (0, 2, 6, 7), (0, 6, 4, 7), (0, 4, 5, 7), (0, 5, 1, 7)])
REGULAR = np.array([(1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)], float)
REGULAR_ANGLE = np.degrees(np.arccos(1 / 3))


def box_mesh(n):
    """The unit cube in n^3 cubes of six tetrahedra."""
    points = np.stack(np.meshgrid(*[np.arange(n + 1)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    strides = np.array([(n + 1) ** 2, n + 1, 1])
    first = points[(points < n).all(axis=1)] @ strides
    corners = np.array([(k & 1, k >> 1 & 1, k >> 2) for k in range(8)]) @ strides
    return points / n, (first[:, None, None] + corners[CUBE_TETS]).reshape(-1, 4)


def merged(points, tets):
    points, same = np.unique(points, axis=0, return_inverse=True)
    return points, same.reshape(-1)[tets]


class Statistics(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="tessera-statistics-test-")
        self.addCleanup(folder.cleanup)
        self.path = pathlib.Path(folder.name, "mesh.vtu")
        self.points, self.tets = box_mesh(3)

    def write(self, points, tets, cell_fields=None):
        places, cells, grid, writer = vtkPoints(), vtkCellArray(), vtkUnstructuredGrid(), vtkXMLUnstructuredGridWriter()
        places.SetData(numpy_to_vtk(np.ascontiguousarray(points), deep=True))
        cells.SetData(4, numpy_to_vtkIdTypeArray(np.ascontiguousarray(tets, np.int64).ravel(), deep=True))
        grid.SetPoints(places)
        grid.SetCells(10, cells)
        for name, values in (cell_fields or {}).items():
            array = numpy_to_vtk(np.ascontiguousarray(values), deep=True)
            array.SetName(name)
            grid.GetCellData().AddArray(array)
        writer.SetFileName(str(self.path))
        writer.SetInputData(grid)
        writer.Write()

    def measure(self, points, tets, cell_fields=None):
        self.write(points, tets, cell_fields)
        return mesh_statistics.statistics(self.path)

    def check_faults(self, points, tets, *words):
        faults = self.measure(points, tets)["faults"]
        self.assertEqual(len(faults), len(words), faults)
        for fault, word in zip(faults, words):
            self.assertIn(word, fault)

    def test_a_regular_tetrahedron(self):
        s = self.measure(REGULAR, [(0, 1, 2, 3)])
        for key, expected in {"worst_aspect": 1, "least_angle": REGULAR_ANGLE, "largest_angle": REGULAR_ANGLE, "volume": 8 / 3,
                              "boundary_area": 8 * 3**0.5, "mean_edge": 8**0.5, "shortest_edge": 8**0.5, "longest_edge": 8**0.5}.items():  # fmt: skip
            self.assertAlmostEqual(s[key], expected, 12, key)
        self.assertEqual((s["faults"], s["edges"], s["boundary_faces"], s["aspect_counts"][0]), ([], 6, 4, 1))
        self.assertEqual(s["angle_counts"][7], 6)

    def test_a_box(self):
        s = self.measure(self.points, self.tets)
        self.assertEqual((s["points"], s["tetrahedra"], s["boundary_faces"], s["faults"], s["pinched_points"]), (64, 162, 108, [], 0))
        self.assertAlmostEqual(s["volume"], 1, 12)
        self.assertAlmostEqual(s["boundary_area"], 6, 12)
        self.assertAlmostEqual(s["longest_edge"], 3**0.5 / 3, 12)
        # Along the axes, across squares and across cubes.
        edges = [3 * 3 * 16, 3 * 4 * 9, 27]
        self.assertEqual(s["edges"], sum(edges))
        self.assertAlmostEqual(s["mean_edge"], sum(n * (k + 1) ** 0.5 / 3 for k, n in enumerate(edges)) / sum(edges), 12)
        self.assertEqual((sum(s["aspect_counts"]), sum(s["angle_counts"])), (162, 972))
        self.assertAlmostEqual(s["least_angle"], 45, 6)
        self.assertAlmostEqual(s["largest_angle"], 90, 6)

    def test_many_points_are_counted_alike(self):
        """Beyond 2^21 points another way of sorting is taken."""
        expected = self.measure(self.points, self.tets)
        far = np.stack([np.arange(2.0**21) + 2] * 3, axis=1)
        found = self.measure(np.vstack([self.points, far]), self.tets)
        for key in ("boundary_faces", "boundary_area", "edges", "mean_edge", "crowded_faces", "same_side_faces", "bad_boundary_edges"):
            self.assertEqual(found[key], expected[key], key)
        self.assertEqual(found["unused_points"], 2**21)

    def test_volumes_of_regions(self):
        middles = self.points[self.tets].mean(axis=1)
        s = self.measure(self.points, self.tets, {"region": np.where(middles[:, 0] < 1 / 3, 7, 2)})
        self.assertEqual(sorted(s["region_volumes"]), [2, 7])
        self.assertAlmostEqual(s["region_volumes"][7], 1 / 3, 12)
        self.assertEqual(s["faults"], [])

    def test_a_cavity_is_sound(self):
        middles = self.points[self.tets].mean(axis=1)
        s = self.measure(self.points, self.tets[(abs(middles - 0.5) > 1 / 6).any(axis=1)])
        self.assertEqual((s["faults"], s["boundary_faces"]), ([], 120))
        self.assertAlmostEqual(s["volume"], 26 / 27, 12)

    def test_elements_all_turned_are_sound(self):
        self.check_faults(self.points, self.tets[:, [1, 0, 2, 3]])

    def test_one_element_turned(self):
        self.tets[80] = self.tets[80, [1, 0, 2, 3]]
        self.check_faults(self.points, self.tets, "4 inner faces", "161 elements of positive and 1 of negative")

    def test_an_element_twice(self):
        at = int(abs(self.points[self.tets].mean(axis=1) - 0.5).sum(axis=1).argmin())
        self.check_faults(self.points, np.vstack([self.tets, self.tets[at]]), "4 faces of more than two")

    def test_a_flat_element(self):
        points = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], float)
        s = self.measure(points, [(0, 1, 2, 3)])
        self.assertEqual((s["zero_volumes"], s["worst_aspect"], s["aspect_counts"][-1]), (1, np.inf, 1))

    def test_a_hanging_point(self):
        """Divided on one side of a face only."""
        corners = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 0, -1), (0.5, 0.5, 0)], float)
        faults = self.measure(corners, [(0, 1, 2, 3), (0, 5, 1, 4), (0, 2, 5, 4)])["faults"]
        self.assertEqual(len(faults), 1, faults)
        self.assertIn("boundary edges", faults[0])

    def test_points_beside_others_and_unused(self):
        """A slit of no width, which is a boundary like any other."""
        points = np.vstack([self.points, self.points[:1], [(5, 5, 5)]])
        tets = self.tets.copy()
        tets[0][tets[0] == 0] = 64
        self.check_faults(points, tets, "1 points that no element", "1 points where another is")

    def test_boxes_that_touch(self):
        for shift, bad_edges, pinched in (((1, 1, 0), 3, 2), ((1, 1, 1), 0, 1), ((1, 0, 0), 0, 0)):
            points, tets = merged(np.round(np.vstack([3 * self.points, 3 * (self.points + shift)])), np.vstack([self.tets, self.tets + 64]))
            s = self.measure(points, tets)
            self.assertEqual((s["bad_boundary_edges"], bool(s["pinched_points"])), (bad_edges, bool(pinched)), shift)
        self.assertAlmostEqual(s["volume"], 54, 9)

    def test_what_is_not_of_tetrahedra_is_refused(self):
        self.path.write_text("<?xml version='1.0'?><html/>")
        self.assertRaises(ValueError, mesh_statistics.statistics, self.path)

    def test_the_program(self):
        self.write(self.points, self.tets)
        program = [sys.executable, "-B", FOLDER / "mesh_statistics.py", self.path, "--json", self.path.with_suffix(".json")]
        run = subprocess.run(program, capture_output=True, text=True)
        self.assertEqual((run.returncode, run.stderr), (0, ""))
        self.assertIn("the elements fit together", run.stdout)
        self.assertEqual(json.loads(self.path.with_suffix(".json").read_text())[str(self.path)]["tetrahedra"], 162)
        self.write(self.points, np.vstack([self.tets, self.tets]))
        self.assertEqual(subprocess.run(program, capture_output=True).returncode, 1)


if __name__ == "__main__":
    unittest.main()
