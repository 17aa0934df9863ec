#!/usr/bin/env python3
"""Runs tessera-tetrahedralize on damaged files: it must end with exit code 0 or 2, soon, in little memory, with a mesh or one line of error.

usage: mutated_surfaces.py --program PROGRAM [--count N] [--seed S] [--first I] [--jobs J] [--keep FOLDER]

Small good files of every format are damaged: bits, bytes, numbers, lines, words, the end. Which, and how, follows from seed and index. The undamaged
ones must be accepted. A mutant that breaks a rule is kept, with the command and what went wrong, in a folder named by seed and index.
"""

import argparse
import collections
import concurrent.futures
import dataclasses
import os
import pathlib
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time

import surfaces
from mesh_statistics import Mesh

LONGEST_S = 10
LARGEST_BYTES = 1 << 30
# What a run may need beyond what it was allowed: to notice it, and to load the program.
SLACK_S, SLACK_BYTES = 2, 128 << 20
OPTIONS = ["-q", "--max-time", str(LONGEST_S), "--max-memory", "1G"]
LONGEST_LINE_BYTES = 1000
FURTHER_OPTIONS = [[]] * 6 + [["--repair-surface"]] * 3 + [["--size", "0.4"], ["--boundary", "refine"], ["--hull-limit", "0.8"]]
NUMBER = re.compile(rb"-?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?")
NUMBERS = ["-1", "0", "1", "2", "1e308", "-1e308", "1e999", "1e-320", "1e30", "nan", "-inf", "inf", "2147483647", "2147483648", "4294967296",
           "-2147483648", "9223372036854775807", "18446744073709551616", "0x10", "1.5", "-", "9" * 400, "1 2", "", "x"]  # fmt: skip
WORDS = [0, 1, 3, 255, 65535, 2**24, 2**27, 2**31 - 1, 2**31, 2**32 - 1]


def sound_files():
    """name -> bytes"""
    ball, nested = surfaces.with_fields(surfaces.sphere(1)), surfaces.nested_spheres("inwards", 1)
    ring, boxes = surfaces.with_fields(surfaces.torus(8, 6)), surfaces.two_boxes()
    cloud = surfaces.with_fields(surfaces.single_precision(surfaces.noisy_scan(200)))
    written = [
        ("ball.stl", ball, {}), ("text.stl", boxes, {"binary": False}), ("ring.ply", ring, {}), ("big_endian.ply", ball, {"order": ">"}),
        ("text.ply", ball, {"binary": False}), ("nested.obj", nested, {}), ("slashes.obj", ball, {"corner": "{0}/1/1"}), ("ring.off", ring, {}),
        ("ball.poly", ball, {"regions": [(0, 0, 0, 5, 0.1)]}), ("nested.poly", nested, {"first": 0}), ("ring.vtp", ring, {}),
        ("cloud.csv", cloud, {}), ("paraview.csv", cloud, {"style": "paraview"}), ("semicolon.csv", cloud, {"style": "semicolon"}),
        ("bare.csv", cloud, {"style": "bare"}), ("cloud.node", cloud, {}),
    ]  # fmt: skip
    with tempfile.TemporaryDirectory(prefix="tessera-sound-") as folder:
        return {name: surfaces.write(pathlib.Path(folder) / name, surface, **options).read_bytes() for name, surface, options in written}


def is_text(data):
    return b"\0" not in data and sum(byte > 126 for byte in data[:1000]) < 10


def damage_text(data, rng):
    kind = rng.randrange(8)
    if kind <= 3:
        found = NUMBER.search(data, rng.randrange(len(data)))
        if found:
            old = found.group()
            near = [str(int(old) + step) for step in (-1, 1)] + [str(-int(old)), str(2 * int(old))] if old.lstrip(b"-").isdigit() else []
            return data[: found.start()] + rng.choice(NUMBERS + near).encode() + data[found.end() :], "number"
    lines = data.split(b"\n")
    at, other = rng.randrange(len(lines)), rng.randrange(len(lines))
    if kind <= 5:
        return b"\n".join(lines[:at] + [lines[at]] * rng.choice([0, 0, 2, 2, 50]) + lines[at + 1 :]), "line left out or repeated"
    if kind == 6:
        lines[at], lines[other] = lines[other], lines[at]
        return b"\n".join(lines), "lines swapped"
    words, others = lines[at].split(b" "), lines[other].split(b" ")
    words[rng.randrange(len(words))] = rng.choice(others)
    lines[at] = b" ".join(words)
    return b"\n".join(lines), "word"


def damage_bytes(data, rng):
    data = bytearray(data)
    at, length = rng.randrange(len(data)), rng.choice([1, 4, 8, 16, 64, 512])
    kind = rng.randrange(9)
    if kind <= 1:
        data[at] ^= 1 << rng.randrange(8)
        return bytes(data), "bit"
    if kind == 2:
        data[at] = rng.choice([0, 0xFF, 0x7F, 0x80, rng.randrange(256)])
        return bytes(data), "byte"
    if kind == 3:
        del data[at:]
        return bytes(data), "cut"
    if kind == 4:
        del data[at : at + length]
        return bytes(data), "removal"
    if kind == 5:
        data[at:at] = rng.choice([rng.randbytes(length), bytes(data[at : at + length]), bytes(length)])
        return bytes(data), "insertion"
    if kind == 6:
        other = rng.randrange(len(data))
        first, second = bytes(data[at : at + length]), bytes(data[other : other + length])
        data[at : at + len(second)] = second
        data[other : other + len(first)] = first
        return bytes(data), "pieces swapped"
    # A whole number, or part of one with a fraction, where one may stand.
    at -= at % 4
    new = rng.choice(WORDS).to_bytes(4, "little") if kind == 7 else rng.choice([b"\0\0\xc0\x7f", b"\0\0\x80\x7f", b"\xff\xff\x7f\x7f", b"\0\0\0\0"])
    data[at : at + 4] = new
    return bytes(data), "word of four bytes"


def make_mutant(sound, seed, index):
    """(name, bytes, further options, words that say how it came about)"""
    rng = random.Random(f"{seed}:{index}")
    name = rng.choice(list(sound))
    data, steps = sound[name], []
    for _ in range(rng.choice([1, 1, 1, 2, 4])):
        if not data:
            break
        as_text = rng.random() < (0.85 if is_text(data) else 0.15)
        data, how = (damage_text if as_text else damage_bytes)(data, rng)
        steps.append(how)
    return name, data, rng.choice(FURTHER_OPTIONS), ", ".join(steps)


@dataclasses.dataclass
class Run:
    name: str
    code: int  # negative for a signal
    seconds: float
    peak_bytes: int
    faults: list
    stderr: str = ""


def measured(arguments, folder):
    """Exit code, seconds, peak bytes of the largest process, standard output and error; ends what runs far too long."""
    begin = time.monotonic()
    outputs = [folder / name for name in ("stdout", "stderr")]
    with open(outputs[0], "wb") as out, open(outputs[1], "wb") as err:
        process = subprocess.Popen(arguments, stdin=subprocess.DEVNULL, stdout=out, stderr=err, cwd=folder, start_new_session=True)
        timer = threading.Timer(3 * LONGEST_S, os.killpg, (process.pid, signal.SIGKILL))
        timer.start()
        _, status, usage = os.wait4(process.pid, 0)
        timer.cancel()
        process.returncode = os.waitstatus_to_exitcode(status)
    seconds = time.monotonic() - begin
    texts = [path.read_bytes().decode(errors="backslashreplace") for path in outputs]
    for path in outputs:
        path.unlink()
    return process.returncode, seconds, usage.ru_maxrss << 10, *texts


def faults_of(code, seconds, peak, stdout, stderr, folder, new_files):
    faults = []
    if code not in (0, 2):
        faults.append(f"ended by {signal.Signals(-code).name}" if code < 0 else f"exit code {code}")
    if seconds > LONGEST_S + SLACK_S:
        faults.append(f"took {seconds:.1f} s")
    if peak > LARGEST_BYTES + SLACK_BYTES:
        faults.append(f"peak memory {peak >> 20} MiB")
    if stdout:
        faults.append("text on stdout in spite of -q")
    lines = stderr.split("\n")
    if lines[-1] != "":
        faults.append("the last line on stderr has no end")
    errors = [line for line in lines[:-1] if not line.startswith("tessera-tetrahedralize: warning: ")]
    if any(not line.startswith("tessera-tetrahedralize: ") for line in errors):
        faults.append("a line on stderr that isn't the program's")
    if len(errors) != (0 if code == 0 else 1):
        faults.append(f"{len(errors)} lines of error")
    if any(len(line.encode()) > LONGEST_LINE_BYTES for line in lines):
        faults.append("a line on stderr of more than 1000 bytes")
    if any(ord(c) < 32 or ord(c) == 127 for line in lines for c in line):
        faults.append("control characters on stderr")
    expected = ["out.vtu"] if code == 0 else []
    if new_files != expected:
        faults.append(f"files {new_files}, expected {expected}")
    elif code == 0:
        try:
            mesh = Mesh(folder / "out.vtu")
            inside_out = int((mesh.volumes() <= 0).sum())
            crowded, same_side = mesh.faces()[1:]
            if inside_out or crowded or same_side:
                faults.append(f"{inside_out} elements inside out, {crowded + same_side} faces that don't fit")
        except (ValueError, IndexError) as error:
            faults.append(f"the output can't be read: {error}")
    return faults


def run_case(program, name, file, data, options, origin, keep):
    """Runs one file in a folder of its own."""
    folder = pathlib.Path(tempfile.mkdtemp(prefix="tessera-mutant-"))
    try:
        (folder / file).write_bytes(data)
        arguments = [program, file, "-o", "out.vtu", *OPTIONS, *options]
        code, seconds, peak, stdout, stderr = measured(arguments, folder)
        new_files = sorted(path.name for path in folder.iterdir() if path.name != file)
        faults = faults_of(code, seconds, peak, stdout, stderr, folder, new_files)
        if faults:
            place = keep / name
            shutil.rmtree(place, ignore_errors=True)
            shutil.copytree(folder, place)
            (place / "report.txt").write_text(
                f"{' '.join(arguments)}\n{origin}\n{'; '.join(faults)}\nexit code {code}, {seconds:.2f} s, {peak >> 20} MiB\n{stderr}"
            )
        return Run(f"{name} ({origin})", code, seconds, peak, faults, stderr)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def run_sound(program, file, data, keep):
    """An undamaged file must be accepted: otherwise its mutants would test nothing."""
    run = run_case(program, f"sound_{file}", file, data, [], f"{file}, undamaged", keep)
    if run.code != 0 and not run.faults:
        run.faults.append(f"an undamaged file was refused: {run.stderr.strip()}")
    return run


def run_mutant(program, sound, seed, index, keep):
    file, data, options, how = make_mutant(sound, seed, index)
    return run_case(program, f"mutant_{seed}_{index}", file, data, options, " ".join([f"{file}: {how};", *options]).rstrip("; "), keep)


def print_table(runs):
    """How the runs ended, by format."""
    counts = collections.defaultdict(collections.Counter)
    for run in runs:
        suffix = re.search(r"\((\w+\.\w+)", run.name)[1]
        counts[suffix][{0: "meshed", 2: "refused"}.get(run.code, "else")] += 1
        counts[suffix]["offend"] += bool(run.faults)
    print(f"{'made from':<16}{'meshed':>9}{'refused':>9}{'else':>6}{'offend':>8}")
    for suffix, row in sorted(counts.items()):
        print(f"{suffix:<16}{row['meshed']:>9}{row['refused']:>9}{row['else']:>6}{row['offend']:>8}")
    slowest, largest = max(runs, key=lambda r: r.seconds), max(runs, key=lambda r: r.peak_bytes)
    print(f"slowest {slowest.seconds:.2f} s: {slowest.name}\nlargest {largest.peak_bytes >> 20} MiB: {largest.name}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", required=True, type=lambda path: str(pathlib.Path(path).resolve()))
    parser.add_argument("--count", type=int, default=2000)
    parser.add_argument("--seed", default="1")
    parser.add_argument("--first", type=int, default=0, help="index of the first mutant")
    parser.add_argument("--jobs", type=int, default=2)
    kept = pathlib.Path("mutated_surfaces")
    parser.add_argument("--keep", type=pathlib.Path, default=kept, help=f"where offending files go (default: ./{kept})")
    arguments = parser.parse_args()
    if not pathlib.Path(arguments.program).exists():
        parser.error(f"there is no {arguments.program}")
    keep, sound = arguments.keep.resolve(), sound_files()
    runs = []
    with concurrent.futures.ThreadPoolExecutor(arguments.jobs) as pool:
        undamaged = list(pool.map(lambda file: run_sound(arguments.program, file, sound[file], keep), sound))
        indices = range(arguments.first, arguments.first + arguments.count)
        for run in pool.map(lambda index: run_mutant(arguments.program, sound, arguments.seed, index, keep), indices):
            runs.append(run)
            if len(runs) % 500 == 0:
                print(f"  {len(runs)} mutants, {sum(bool(r.faults) for r in runs)} offend", flush=True)
    if runs:
        print_table(runs)
    offending = [run for run in undamaged + runs if run.faults]
    for run in offending:
        print(f"FAILED {run.name}: {'; '.join(run.faults)}")
    if offending:
        print(f"{len(offending)} of {len(undamaged) + len(runs)} runs broke a rule; their files are in {keep}")
    else:
        print(f"all {len(undamaged) + len(runs)} runs kept the rules")
    return 1 if offending else 0


if __name__ == "__main__":
    sys.exit(main())
