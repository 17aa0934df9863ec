#!/usr/bin/env python3
"""Peak memory of `tessera resample` under bounds: proportional set size (PSS) of the program and of the processes
that it starts, all together, from /proc, every 50 ms. Prints a table in Markdown, a row for each combination
of mesh, bound and algorithm; criteria, or layouts, take turns. Each is asked for more than fits. Exit code 1 when
one takes more than 5 % above its bound or fails; one that is refused because the bound is too little keeps to it.

peak_memory.py --program build/release/apps/tessera/tessera --bounds 200M,1G --algorithms software,slicing \\
    mesh[:x,y,z,r] ...

x, y, z and r are the place that is refined by focus and its radius.
"""

import argparse
import itertools
import os
import re
import subprocess
import sys
import tempfile
import time

CRITERIA = {
    "uniform": ["--refine", "uniform"],
    "error": ["--refine", "error", "--max-error", "0.2%"],
    "element-size": ["--refine", "element-size", "--samples-per-element", "6"],
    "focus": ["--refine", "focus", "--resolution", "1024"],
}
TURNS = ["uniform", "error", "element-size flat", "focus", "uniform flat", "element-size", "error flat"]
UNITS = {"K": 10, "M": 20, "G": 30}
TICK_S = 0.05


def processes_of(root):
    """A process and all below it."""
    found = [root]
    for process in found:
        try:
            for task in os.listdir(f"/proc/{process}/task"):
                with open(f"/proc/{process}/task/{task}/children", encoding="ascii") as file:
                    found += [int(child) for child in file.read().split()]
        except OSError:
            pass
    return found


def pss_bytes(process):
    try:
        with open(f"/proc/{process}/smaps_rollup", encoding="ascii") as file:
            for line in file:
                if line.startswith("Pss:"):
                    return int(line.split()[1]) * 1024
    except OSError:
        pass
    return 0


def measure(command):
    """Exit code, last line of stderr, seconds and peak bytes of a command."""
    start, peak = time.monotonic(), 0
    with tempfile.TemporaryFile("w+") as errors:
        with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=errors) as run:
            while run.poll() is None:
                peak = max(peak, sum(pss_bytes(process) for process in processes_of(run.pid)))
                time.sleep(TICK_S)
        errors.seek(0)
        lines = errors.read().strip().splitlines() or [""]
    return run.returncode, lines[-1], time.monotonic() - start, peak


def bytes_of(bound):
    return int(bound[:-1]) << UNITS[bound[-1]] if bound[-1] in UNITS else int(bound)


def finest_uniform(command):
    """The resolution that is said to fit."""
    words = [*command, "--resolution", "4000", "--dry-run"]
    said = subprocess.run(words, capture_output=True, text=True, check=False).stderr
    fits = re.search(r"a resolution of (\d+)", said)
    return ["--resolution", fits[1] if fits else "4000"]


def command_of(program, mesh, bound, algorithm, turn):
    mesh, _, focus = mesh.partition(":")
    criterion, *flat = turn.split()
    command = [program, "resample", mesh, "--algorithm", algorithm, *CRITERIA[criterion]]
    command += ["--max-memory", bound]
    command += ["--layout", "flat"] if flat else []
    if criterion == "focus":
        place, _, radius = (focus or "0,0,0,1").rpartition(",")
        command += ["--focus", place, "--radius", radius]
    if criterion == "uniform":
        command += finest_uniform(command)
    return command


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("meshes", nargs="+", metavar="mesh")
    parser.add_argument("--program", required=True)
    parser.add_argument("--bounds", default="200M,400M,1000M", help="such as 200M,2G")
    parser.add_argument("--algorithms", default="software,slicing,hybrid,auto")
    arguments = parser.parse_args()
    print("| mesh | bound | algorithm | criterion | peak, MiB | of the bound | s | end |")
    print("|---|---|---|---|---|---|---|---|")
    runs = above = 0
    turns = itertools.cycle(TURNS)
    combinations = itertools.product(arguments.meshes, arguments.bounds.split(","), arguments.algorithms.split(","))
    for (mesh, bound, algorithm), turn in zip(combinations, turns):
        with tempfile.TemporaryDirectory() as folder:
            command = command_of(arguments.program, mesh, bound, algorithm, turn)
            code, error, seconds, peak = measure([*command, "-o", os.path.join(folder, "out.vdb")])
        is_refused = code == 2 and ("--max-memory" in error or "bound" in error or "memory" in error)
        end = "done" if code == 0 else "refused" if is_refused else f"{code}: {error}"
        share = peak / bytes_of(bound)
        runs += 1
        above += share > 1.05 or end not in ("done", "refused")
        name = os.path.basename(mesh.partition(":")[0])
        row = [name, bound, algorithm, turn, f"{peak / 2**20:.0f}", f"{share:.2f}", f"{seconds:.0f}", end]
        print("| " + " | ".join(row) + " |", flush=True)
    print(f"\n{runs} combinations, {above} failed or above their bound by more than 5 %")
    return 1 if above else 0


if __name__ == "__main__":
    sys.exit(main())
