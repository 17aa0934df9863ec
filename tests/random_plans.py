#!/usr/bin/python3 -B
"""Random plans from outside: seeded runs of `tessera resample` whose files are read with pyopenvdb and checked against the mesh in numpy.

usage: random_plans.py --tessera PROGRAM [--seeds 1-25] [--jobs N] [--keep FOLDER] [--algorithms software,slicing,hybrid]

A seed draws a mesh, its fields and the options, and makes the same run everywhere. The reconstruction of docs/vdb_layout.md and the exact field are
computed anew here (tests/plans), independently of the program. A seed that fails prints its command and what was expected and found; with --keep its mesh
and file stay in FOLDER/seed_N. Exit code 1 when any failed.
"""

import argparse
import collections
import concurrent.futures
import functools
import os
import pathlib
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import traceback

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before numpy: the processes are the threads

import numpy  # noqa: E402

sys.path.insert(0, str(pathlib.Path(__file__).parent / "app"))
from forked_tessera import ForkedTessera  # noqa: E402
from plans.checks import PLACE, Checker
from plans.meshes import make_mesh, write_vtu
from plans.options import draw_options
from plans.oracle import MeshSamples
from plans.tamper import check_verify
from plans.vdb_reader import TesseraFile

MOST_REFUSED = 0.1  # of all seeds


class Outcome:
    def __init__(self, seed):
        self.seed = seed
        self.problems, self.ratios, self.counts, self.features = [], {}, {}, set()
        self.command, self.refused, self.seconds = "", "", 0.0


@functools.cache
def forked(program):
    return ForkedTessera(program)


def run_program(command):
    return forked(command[0]).run(command[1:])


def run_seed(seed, program, folder, algorithms):
    outcome = Outcome(seed)
    numpy.seterr(over="ignore", invalid="ignore")  # fields with values near the end of double are drawn too
    begin = time.monotonic()
    rng = numpy.random.default_rng([seed, 2001])
    mesh = make_mesh(rng)
    arguments, features = draw_options(rng, mesh, algorithms)
    outcome.features = features | mesh.features
    folder.mkdir(parents=True, exist_ok=True)
    mesh_path, vdb_path = folder / "mesh.vtu", folder / "out.vdb"
    write_vtu(mesh, mesh_path)
    command = [program, "resample", str(mesh_path), "-o", str(vdb_path), "--quiet", *arguments]
    outcome.command = shlex.join(command)
    try:
        result = run_program(command)
        if result.returncode == 2 and len(result.stderr.strip().splitlines()) == 1:
            outcome.refused = result.stderr.strip()
        elif result.returncode != 0:
            outcome.problems.append(f"exit code: {result.returncode}: {result.stderr.strip()}")
        else:
            check_file(outcome, rng, program, mesh, mesh_path, vdb_path, arguments)
    except Exception:
        outcome.problems.append("the check itself failed: " + traceback.format_exc())
    outcome.seconds = time.monotonic() - begin
    return outcome


def check_file(outcome, rng, program, mesh, mesh_path, vdb_path, arguments):
    algorithm = arguments[arguments.index("--algorithm") + 1]
    file = TesseraFile(vdb_path)
    if "--extend" in arguments:
        extend = int(arguments[arguments.index("--extend") + 1])
    else:
        extend = 1 if file.layout == "flat" else 0
    if file.extend != extend:
        outcome.problems.append(f"metadata: tessera_extend is {file.metadata.get('tessera_extend')}, expected {extend}")
        file.extend = extend
    samples = MeshSamples(mesh, file.tree, PLACE[algorithm])
    findings = Checker(mesh, samples, file, algorithm).run(numpy.random.default_rng([outcome.seed, 1]))
    outcome.problems += findings.problems
    outcome.ratios, outcome.counts = findings.ratios, findings.counts
    outcome.features |= file_features(file)
    changed_path = vdb_path.with_name("changed.vdb")
    tessera = lambda *words: run_program([program, *map(str, words)])  # noqa: E731
    problems, what = check_verify(rng, tessera, mesh_path, vdb_path, changed_path, file, samples)
    outcome.problems += problems
    findings.count("changed voxels", what != "")
    if what and not findings.problems and outcome.seed % 4 == 0:
        # These checks must see the change too.
        changed = TesseraFile(changed_path)
        changed.extend = file.extend
        findings.count("changes that these checks looked for")
        if not Checker(mesh, samples, changed, algorithm).run(numpy.random.default_rng([outcome.seed, 1])).problems:
            outcome.problems.append(f"these checks don't see that {what}")


def file_features(file):
    levels = sum(1 for bricks in file.tree.bricks if len(bricks))
    features = {f"{file.layout} of {levels} levels"}
    if file.flat_level > 0:
        features.add("flat capped")
    return features


def parse_seeds(text):
    first, _, last = text.partition("-")
    return range(int(first), int(last or first) + 1)


def summarise(outcomes):
    features, ratios, counts = collections.Counter(), {}, collections.Counter()
    for outcome in outcomes:
        if not outcome.refused:
            features.update(outcome.features)
        counts.update(outcome.counts)
        for name, value in outcome.ratios.items():
            if value > ratios.get(name, (0, 0))[0]:
                ratios[name] = (value, outcome.seed)
    print("features: " + ", ".join(f"{name} {count}" for name, count in sorted(features.items())))
    print("checked: " + ", ".join(f"{name} {count}" for name, count in sorted(counts.items())))
    print("largest error over allowance: " + ", ".join(f"{n} {v:.3g} (seed {s})" for n, (v, s) in sorted(ratios.items())))


def interrupt(*_):
    raise KeyboardInterrupt


def run_all(options, base):
    """Outcomes of the seeds, and whether a signal ended it before all had run."""
    outcomes = []
    signal.signal(signal.SIGTERM, interrupt)
    with concurrent.futures.ProcessPoolExecutor(options.jobs, initializer=signal.signal, initargs=(signal.SIGTERM, signal.SIG_DFL)) as pool:
        algorithms = options.algorithms.split(",")
        runs = [pool.submit(run_seed, seed, options.tessera, base / f"seed_{seed}", algorithms) for seed in options.seeds]
        try:
            for run in concurrent.futures.as_completed(runs):
                outcome = run.result()
                outcomes.append(outcome)
                if outcome.problems:
                    print(f"\nseed {outcome.seed} ({outcome.seconds:.1f} s): {outcome.command}")
                    for problem in outcome.problems:
                        print("    " + problem.replace("\n", "\n    "))
                    sys.stdout.flush()
                else:
                    shutil.rmtree(base / f"seed_{outcome.seed}", ignore_errors=True)
        except KeyboardInterrupt:
            pool.shutdown(cancel_futures=True)
    return outcomes, len(outcomes) < len(options.seeds)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tessera", required=True)
    parser.add_argument("--seeds", default="1-25", type=parse_seeds)
    parser.add_argument("--jobs", default=1, type=int)
    parser.add_argument("--keep", type=pathlib.Path)
    parser.add_argument("--algorithms", default="software")
    options = parser.parse_args()
    base = options.keep or pathlib.Path(tempfile.mkdtemp(prefix="tessera-plans-"))
    begin = time.monotonic()
    try:
        outcomes, ended_early = run_all(options, base)
    finally:
        if not options.keep:
            shutil.rmtree(base, ignore_errors=True)
    if not outcomes:
        return 1
    refused = [o for o in outcomes if o.refused]
    failed = sorted(o.seed for o in outcomes if o.problems)
    print()
    summarise(outcomes)
    for outcome in sorted(refused, key=lambda o: o.seed):
        print(f"refused: seed {outcome.seed}: {outcome.refused}")
    too_many = len(outcomes) >= 20 and len(refused) > MOST_REFUSED * len(outcomes)
    if too_many:
        print(f"too many plans were refused: {len(refused)} of {len(outcomes)}")
    slowest = max(outcomes, key=lambda o: o.seconds)
    print(
        f"{len(outcomes)} seeds, {len(refused)} refused, {len(failed)} failed {failed or ''} "
        f"in {time.monotonic() - begin:.0f} s (slowest: seed {slowest.seed}, {slowest.seconds:.1f} s)"
    )
    if ended_early:
        print(f"ended early: {len(options.seeds) - len(outcomes)} seeds have not run")
    return 1 if failed or too_many or ended_early else 0


if __name__ == "__main__":
    sys.exit(main())
