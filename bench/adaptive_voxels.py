#!/usr/bin/env python3
"""Voxels that bricks refined by error take, against a uniform lattice within the same bound, and those of
combined criteria against the sum of the single ones. Prints two tables in Markdown. With --focus another one
instead: bricks around a focus against uniform ones at the same finest spacing, voxels and time.

adaptive_voxels.py --programs build/release mesh:field[:x,y,z] ... [--bounds 5,2,1] [--focus 512,1024]

x, y, z is the place that is refined by focus; the middle of the mesh's bounds where it isn't given. Its
radius is a sixteenth of the longest side, its finest spacing, for all criteria, that of 1024 points along it,
or of as many as --focus says.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile


def tessera(programs, *words):
    """The report of a run, from --json."""
    with tempfile.TemporaryDirectory() as folder:
        report = os.path.join(folder, "report.json")
        command = [os.path.join(programs, "apps/tessera/tessera"), *words, "--quiet", "--json", report]
        if words[0] == "resample":
            command += ["-o", os.path.join(folder, "bricks.vdb")]
        done = subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, check=False)
        if done.returncode != 0:
            sys.exit(f"{' '.join(command)}: {done.stderr}")
        with open(report, encoding="utf-8") as file:
            return json.load(file)


def uniform_points(programs, mesh, field, bounds):
    """Points of the coarsest uniform lattice within each bound: of its box, by the bound."""
    command = [os.path.join(programs, "bench/uniform_for_error"), mesh, field, *(str(b / 100) for b in bounds)]
    lines = subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()[1:]
    return [float(line.split()[3]) if "more than" not in line else float("inf") for line in lines]


def print_against_uniform(programs, meshes, bounds):
    print("| mesh, field | bound | voxels, by error | levels | error reached | points, uniform | ratio |")
    print("|---|---:|---:|---:|---:|---:|---:|")
    for mesh, field, _ in meshes:
        uniform = uniform_points(programs, mesh, field, bounds)
        for bound, points in zip(bounds, uniform):
            run = tessera(programs, "resample", mesh, "--field", field, "--refine", "error", "--max-error", f"{bound}%")
            voxels = run["voxels"]["total"]
            reached = 100 * max(error["relative_max"] for error in run["error"].values())
            print(f"| {os.path.basename(mesh)}, {field} | {bound:g} % | {voxels / 1e6:.3g} M | "
                  f"{run['lattice']['levels']} | {reached:.2f} % | {points / 1e6:.3g} M | {points / voxels:.3g} |",
                  flush=True)


def focus_options(programs, mesh, place):
    low, high = tessera(programs, "info", mesh)["mesh"]["bounds"]
    longest = max(b - a for a, b in zip(low, high))
    place = place or ",".join(str((a + b) / 2) for a, b in zip(low, high))
    return ["--focus", place, "--radius", str(longest / 16)]


def print_focus(programs, meshes, resolutions):
    """Times are those of planning, sampling and writing."""
    print("| mesh, field | points | uniform | | around a focus | | voxels | time |")
    print("|---|---:|---:|---:|---:|---:|---:|---:|")
    for mesh, field, place in meshes:
        focus = focus_options(programs, mesh, place)
        for points in resolutions:
            runs = [tessera(programs, "resample", mesh, "--field", field, "--resolution", points, "--max-voxels", "2G",
                            "--refine", *criterion) for criterion in (["uniform"], ["focus", *focus])]
            voxels = [run["voxels"]["total"] for run in runs]
            ms = [sum(run["stages"][stage] for stage in ("plan", "resample", "write")) for run in runs]
            sides = " | ".join(f"{v / 1e6:.3g} M | {t / 1000:.3g} s" for v, t in zip(voxels, ms))
            print(f"| {os.path.basename(mesh)}, {field} | {points} | {sides} | {100 * voxels[1] / voxels[0]:.2f} % | "
                  f"{100 * ms[1] / ms[0]:.1f} % |", flush=True)


def print_combined(programs, meshes, bound):
    print("\n| mesh, field | element size | error | focus | size + error | size + focus | error + focus | all |")
    print("|---|---:|---:|---:|---:|---:|---:|---:|")
    for mesh, field, place in meshes:
        options = {"element-size": [], "error": ["--max-error", f"{bound}%"],
                   "focus": focus_options(programs, mesh, place)}

        def voxels(*criteria):
            words = [word for criterion in criteria for word in options[criterion]]
            run = tessera(programs, "resample", mesh, "--field", field, "--refine", ",".join(criteria),
                          "--resolution", "1024", *words)
            return run["voxels"]["total"]

        single = {criterion: voxels(criterion) for criterion in options}
        cells = [f"{single[criterion] / 1e6:.3g} M" for criterion in options]
        for together in (("element-size", "error"), ("element-size", "focus"), ("error", "focus"),
                         ("element-size", "error", "focus")):
            count, most = voxels(*together), sum(single[criterion] for criterion in together)
            cells.append(f"{count / 1e6:.3g} M ({100 * count / most:.0f} %)")
        print(f"| {os.path.basename(mesh)}, {field} | {' | '.join(cells)} |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("meshes", nargs="+", metavar="mesh:field[:x,y,z]")
    parser.add_argument("--programs", default="build/release", help="folder of the build")
    parser.add_argument("--bounds", default="5,2,1", help="on the error, per cent of the field's range")
    parser.add_argument("--focus", help="points along the longest side, several by commas")
    arguments = parser.parse_args()
    bounds = [float(bound) for bound in arguments.bounds.split(",")]
    meshes = [tuple((mesh.split(":") + [""])[:3]) for mesh in arguments.meshes]
    if arguments.focus:
        return print_focus(arguments.programs, meshes, arguments.focus.split(","))
    print_against_uniform(arguments.programs, meshes, bounds)
    print_combined(arguments.programs, meshes, bounds[0])


if __name__ == "__main__":
    main()
