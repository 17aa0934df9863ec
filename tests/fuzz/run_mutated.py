#!/usr/bin/env python3
"""Runs tessera on damaged meshes, .vdb files and logs of bricks: it must end with exit code 0 or 2, soon, in little memory, with one line of error and no file left behind.

usage: run_mutated.py --tessera PROGRAM [--format NAME,...] [--count N] [--seed S] [--first I] [--jobs J] [--keep FOLDER]

Formats are vtk (XML and legacy files), parallel, multiblock, series, tetgen, exodus, cgns, ensight, openfoam and vdb (with logs); without --format all.
The undamaged files are read first and must be accepted. A mutant that breaks a rule is kept, with the command and what went wrong, in a folder named by
its format, seed and index.
"""

import argparse
import collections
import concurrent.futures
import dataclasses
import functools
import os
import pathlib
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time

import mutate_files
import mutate_mesh
import mutate_vdb

sys.path.append(str(pathlib.Path(__file__).resolve().parents[1] / "app"))
from forked_tessera import ForkedTessera  # noqa: E402

FORMATS = ["vtk", *mutate_files.PLAIN_FORMATS, *mutate_files.WRITTEN_FORMATS, "vdb"]
LONGEST_S = 10
BUSY_WAIT_S = 300
LARGEST_BYTES = 2 << 30
LARGEST_VDB_BYTES = 1 << 30
LARGEST_PARENT_BYTES = 256 << 20
LONGEST_LINE_BYTES = 1000
POLL_S = 0.02
busy = False

COMMANDS = {
    "info": (["info", "{mesh}", "--json", "out.json"], "out.json"),
    "tets": (["tets", "{mesh}", "-o", "out.vtu", "--quiet"], "out.vtu"),
    "uniform": (["resample", "{mesh}", "-o", "out.vdb", "--quiet", "--refine", "uniform", "--resolution", "20"], "out.vdb"),
    "element-size": (["resample", "{mesh}", "-o", "out.vdb", "--quiet", "--max-memory", "100M"], "out.vdb"),
    "error": (["resample", "{mesh}", "-o", "out.vdb", "--quiet", "--refine", "error", "--max-error", "5%", "--max-memory", "30M"], "out.vdb"),
    "slice": (["slice", "{mesh}", "-o", "out.exr", "--quiet", "--normal", "1,2,3", "--resolution", "64"], "out.exr"),
}  # fmt: skip


# Of .vdb files, and of what --resume keeps: what is damaged has a name by its ending.
MADE_FROM = {
    "levels": ["--refine", "error", "--max-error", "5%", "--max-voxels", "300k", "--brick-size", "8"],
    "flat": ["--refine", "uniform", "--resolution", "16", "--layout", "flat", "--extend", "1"],
    "half": ["--refine", "uniform", "--resolution", "12", "--half"],
}
VDB_COMMANDS = {
    "info": (["info", "bad.vdb"], None),
    "verify": (["verify", "mesh.vtu", "bad.vdb", "--quiet"], None),
    "picture": (["picture", "bad.vdb", "-o", "out.png", "--quiet"], "out.png"),
    "like": (["resample", "mesh.vtu", "-o", "out.vdb", "--like", "bad.vdb", "--quiet", "--max-voxels", "1M"], "out.vdb"),
}
SET_COMMANDS = ["info"] * 6 + ["tets", "uniform", "uniform", "element-size"]
SERIES_COMMANDS = ["info", "info", "tets"]  # resampling has an output for every step
LOG_COMMAND = ["resample", "mesh.vtu", "-o", "out.vdb", "--refine", "error", "--max-error", "5%", "--quiet", "--resume", "bad.log"]


@dataclasses.dataclass
class Run:
    name: str
    code: int  # as subprocess has it: negative for a signal
    seconds: float
    peak_bytes: int
    faults: list
    stderr: str = ""


def own_bytes(pid):
    """Resident memory of a process."""
    try:
        return int(pathlib.Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except (OSError, IndexError):
        return 0  # it has just ended


def tree_bytes(pid):
    """The same, with its children."""
    total = own_bytes(pid)
    try:
        for child in pathlib.Path(f"/proc/{pid}/task/{pid}/children").read_text().split():
            total += tree_bytes(int(child))
    except (OSError, IndexError):
        pass  # it has just ended
    return total


def measured(forked, arguments, folder):
    """Exit code, seconds (of a busy machine: those of its processors), peak bytes of the process with its children and of it alone, standard error; ends what runs too long or grows too large."""
    begin = time.monotonic()
    peak = own_peak = 0
    is_ended = False

    def watch(process):
        nonlocal peak, own_peak, is_ended
        own_peak = max(own_peak, own_bytes(process))
        peak = max(peak, tree_bytes(process))
        # Some room beyond the limits, so that what is reported is how far a run went and not where it was ended.
        if time.monotonic() - begin > (BUSY_WAIT_S if busy else 2 * LONGEST_S) or peak > 1.5 * LARGEST_BYTES:
            is_ended = True
            os.kill(process, signal.SIGKILL)

    run = forked.run(arguments, cwd=folder, watch=watch, tick_s=POLL_S)
    seconds = run.cpu_s if busy and not is_ended else time.monotonic() - begin
    # The children that were waited for count too: the kernel keeps the largest.
    return run.returncode, seconds, max(peak, run.peak_bytes), own_peak, run.stderr


def faults_of(code, seconds, peak, stderr, new_files, output):
    faults = []
    if code not in (0, 2):
        faults.append(f"ended by {signal.Signals(-code).name}" if code < 0 else f"exit code {code}")
    if seconds > LONGEST_S:
        faults.append(f"took {seconds:.1f} s")
    if peak > LARGEST_BYTES:
        faults.append(f"peak memory {peak >> 20} MiB")
    lines = stderr.split("\n")
    if lines[-1] != "":
        faults.append("the last line on stderr has no end")
    errors = [line for line in lines[:-1] if not line.startswith("tessera: warning: ")]
    if any(not line.startswith("tessera: ") for line in errors):
        faults.append("a line on stderr that isn't tessera's")
    if len(errors) != (0 if code == 0 else 1):
        faults.append(f"{len(errors)} lines of error")
    if any(len(line.encode()) > LONGEST_LINE_BYTES for line in errors):
        faults.append("a line of error of more than 1000 bytes")
    if any(ord(c) < 32 or ord(c) == 127 for line in lines for c in line):
        faults.append("control characters on stderr")
    expected = {output} if code == 0 and output else set()
    if new_files != expected:
        faults.append(f"files {sorted(new_files)}, expected {sorted(expected)}")
    return faults


def write_files(folder, files):
    for name, data in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(data)


def run_case(program, name, files, mesh, command_name, keep, origin):
    """Runs one command on one mesh in a folder of its own."""
    words, output = COMMANDS[command_name]
    arguments = [word.format(mesh=mesh) for word in words]
    folder = pathlib.Path(tempfile.mkdtemp(prefix="tessera-mutant-"))
    try:
        write_files(folder, files)
        code, seconds, peak, _, stderr = measured(program, arguments, folder)
        new_files = {str(p.relative_to(folder)) for p in folder.rglob("*") if not p.is_dir()} - set(files)
        faults = faults_of(code, seconds, peak, stderr, new_files, output)
        if faults:
            place = keep / name
            shutil.rmtree(place, ignore_errors=True)
            place.mkdir(parents=True)
            write_files(place, files)
            (place / "report.txt").write_text(
                f"tessera {' '.join(arguments)}\nfrom {origin}\n{'; '.join(faults)}\nexit code {code}, {seconds:.2f} s, {peak >> 20} MiB\n{stderr}"
            )
        return Run(f"{name} ({command_name}; {origin})", code, seconds, peak, faults, stderr)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def run_mutant(program, seed, index, keep):
    files, mesh, origin = mutate_mesh.make_mutant(seed, index)
    command = random.Random(f"{seed}:{index}:command").choice(list(COMMANDS))
    return run_case(program, f"mutant_{seed}_{index}", files, mesh, command, keep, origin)


def run_set_mutant(program, seed, index, keep, kind, sets):
    files, read_by, origin = mutate_files.make_mutant(sets, kind, seed, index)
    command = random.Random(f"{seed}:{index}:command").choice(SERIES_COMMANDS if kind == "series" else SET_COMMANDS)
    return run_case(program, f"{kind}_{seed}_{index}", files, read_by, command, keep, origin)


def make_vdb_files(program):
    """Undamaged .vdb files, a log and their mesh, by name."""
    folder = pathlib.Path(tempfile.mkdtemp(prefix="tessera-sound-"))
    try:
        name = next(name for name, file in mutate_mesh.sound_files().items() if file().extension == ".vtu")
        (folder / "mesh.vtu").write_bytes(mutate_mesh.sound_files()[name]().serialise())
        for made, words in MADE_FROM.items():
            subprocess.run([program.tessera, "resample", "mesh.vtu", "-o", f"{made}.vdb", "--quiet", *words], cwd=folder, check=True)
        subprocess.run([program.tessera, *LOG_COMMAND], cwd=folder, check=True)
        return {path.name: path.read_bytes() for path in folder.iterdir() if path.name != "out.vdb"}
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def run_vdb_mutant(program, seed, index, keep, sound):
    rng = random.Random(f"{seed}:{index}:vdb command")
    if rng.random() < 0.1 and "bad.log" in sound:
        made, bad, command, words, output = "bad.log", "bad.log", "resume", LOG_COMMAND, "out.vdb"
    else:
        made, bad = rng.choice(list(MADE_FROM)) + ".vdb", "bad.vdb"
        command = rng.choice(list(VDB_COMMANDS))
        words, output = VDB_COMMANDS[command]
    data, how = mutate_vdb.mutant(sound[made], seed, index)
    folder = pathlib.Path(tempfile.mkdtemp(prefix="tessera-mutant-"))
    name = f"vdb_{seed}_{index}"
    try:
        (folder / bad).write_bytes(data)
        (folder / "mesh.vtu").write_bytes(sound["mesh.vtu"])
        code, seconds, peak, own_peak, stderr = measured(program, words, folder)
        new_files = {path.name for path in folder.iterdir()} - {bad, "mesh.vtu"}
        faults = faults_of(code, seconds, peak, stderr, new_files, output)
        if peak > LARGEST_VDB_BYTES:
            faults.append(f"peak memory {peak >> 20} MiB")
        if own_peak > LARGEST_PARENT_BYTES:
            faults.append(f"the program itself took {own_peak >> 20} MiB")
        if faults:
            place = keep / name
            shutil.rmtree(place, ignore_errors=True)
            shutil.copytree(folder, place)
            (place / "report.txt").write_text(f"tessera {' '.join(words)}\nfrom {made}, {how}\n{'; '.join(faults)}\n{stderr}")
        return Run(f"{name} ({command}; {made}, {how})", code, seconds, peak, faults, stderr)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def run_sound(program, keep, name, files, read_by):
    """An undamaged file must be read: otherwise its mutants would test nothing."""
    run = run_case(program, f"sound_{name}", files, read_by, "tets", keep, name)
    if run.code != 0 and not run.faults:
        run.faults.append(f"an undamaged file was refused: {run.stderr.strip()}")
    return run


def undamaged(formats, sets):
    """(name, files, the one that is read) of each."""
    found = []
    if "vtk" in formats:
        for name, make in mutate_mesh.sound_files().items():
            file = make()
            found.append((name, {"mesh" + file.extension: file.serialise()}, "mesh" + file.extension))
    for kind, cases in sets.items():
        found += [(f"{kind} {case}", files, mutate_files.named_file(files)) for case, files in cases.items()]
    return found


def summarise(runs, title):
    codes = collections.Counter(run.code for run in runs)
    print(f"{title}: {len(runs)} runs; exit codes " + ", ".join(f"{code}: {count}" for code, count in sorted(codes.items())))
    slowest, largest = max(runs, key=lambda r: r.seconds), max(runs, key=lambda r: r.peak_bytes)
    print(f"  slowest {slowest.seconds:.2f} s: {slowest.name}\n  largest {largest.peak_bytes >> 20} MiB: {largest.name}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tessera", required=True)
    parser.add_argument("--format", default=",".join(FORMATS), help="which formats, with commas between them (default: all)")
    parser.add_argument("--count", type=int, default=1000, help="mutants of each format")
    parser.add_argument("--writer", help="the test program write_box_files (default: the one of the program's build folder)")
    parser.add_argument("--seed", default="1")
    parser.add_argument("--first", type=int, default=0, help="index of the first mutant")
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--keep", type=pathlib.Path, default=pathlib.Path("mutants"), help="where offending meshes go (default: ./mutants)")
    parser.add_argument("--busy", action="store_true", help="others work on this machine: time on its processors counts, and a run may wait for 300 s")
    parser.add_argument("--skip-sound", action="store_true", help="leave out the undamaged files")
    arguments = parser.parse_args()
    global busy
    busy = arguments.busy
    program = ForkedTessera(pathlib.Path(arguments.tessera).resolve())
    if not program.program.exists():
        parser.error(f"there is no {program.program}")
    writer = arguments.writer or str(pathlib.Path(program.tessera).parents[2] / "tests" / "write_box_files")
    formats = arguments.format.split(",")
    if unknown := [name for name in formats if name not in FORMATS]:
        parser.error(f"there is no format {unknown[0]}; known are {', '.join(FORMATS)}")
    keep = arguments.keep.resolve()
    sets = mutate_files.sound_sets([name for name in formats if name not in ("vtk", "vdb")], writer)
    print(f"seed {arguments.seed}, mutants {arguments.first} to {arguments.first + arguments.count - 1}", flush=True)
    runs, mutants = [], []
    with concurrent.futures.ThreadPoolExecutor(arguments.jobs) as pool:
        if not arguments.skip_sound:
            runs = list(pool.map(lambda sound: run_sound(program, keep, *sound), undamaged(formats, sets)))
            if runs:
                summarise(runs, "undamaged")
        for name in formats:
            if name == "vtk":
                mutate = run_mutant
            elif name == "vdb":
                mutate = functools.partial(run_vdb_mutant, sound=make_vdb_files(program))
            else:
                mutate = functools.partial(run_set_mutant, kind=name, sets=sets[name])
            done = []
            indices = range(arguments.first, arguments.first + arguments.count)
            for run in pool.map(lambda i, mutate=mutate: mutate(program, arguments.seed, i, keep), indices):
                done.append(run)
                if len(done) % 1000 == 0:
                    print(f"  {len(done)} mutants, {sum(bool(r.faults) for r in done)} offend", flush=True)
            summarise(done, name)
            mutants += done
    offending = [run for run in runs + mutants if run.faults]
    for run in offending:
        print(f"FAILED {run.name}: {'; '.join(run.faults)}")
    if offending:
        print(f"{len(offending)} of {len(runs) + len(mutants)} runs broke a rule; their meshes are in {keep}")
    else:
        print("every run kept the rules")
    return 1 if offending else 0


if __name__ == "__main__":
    sys.exit(main())
