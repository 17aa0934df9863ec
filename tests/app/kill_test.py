#!/usr/bin/env python3
"""Ends tessera at random moments, and fills the disk beneath it: nothing but a whole file may ever stand at an output's name.

usage: kill_test.py --tessera PROGRAM --data FOLDER [--count N] [--seed S]

Every run gets SIGKILL, SIGINT or SIGTERM after a random time, or as soon as it writes, with and without an older file at the output's name. Afterwards:
- what stands at an output's name is the older file bit for bit, or the whole new one (the bits of an undisturbed run, which `verify` accepts);
- after SIGINT and SIGTERM the exit code is 128 + signal with one line on stderr, the outputs are as before (a series keeps the steps that are done), and
  no other file is there;
- after SIGKILL at most a hidden .NAME.PID.tmp is left, and it hurts no later run, not even one of the same process number.
"""

import argparse
import collections
import json
import os
import pathlib
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time

from signal_handlers import catches

LONGEST_S = 120
OLD = b"an older file\n" * 40


class Command:
    """A command line, the files it writes, and what an undisturbed run made of them."""

    def __init__(self, name, arguments, outputs):
        self.name, self.arguments, self.outputs = name, [str(a) for a in arguments], outputs
        self.seconds = 0.0
        self.reference = {}

    def is_whole(self, output, content):
        if not output.endswith(".json"):
            return content == self.reference[output]
        try:  # a report holds times
            return json.loads(content).keys() == json.loads(self.reference[output]).keys()
        except ValueError:
            return False


def commands(data, folder):
    stokes, fichera = data / "freefem-stokes-sphere/stokes_p1.vtu", data / "dolfinx-fichera-p3/fichera_p3.vtu"
    sampled = folder / "sampled.vdb"
    return [
        Command("uniform", ["resample", stokes, "-o", "out.vdb", "--refine", "uniform", "--resolution", 160, "--json", "out.json"], ["out.vdb", "out.json"]),
        Command("error", ["resample", fichera, "-o", "out.vdb", "--refine", "error", "--max-error", "3%", "--max-voxels", "3M"], ["out.vdb"]),
        Command("flat", ["resample", stokes, "-o", "out.vdb", "--refine", "uniform", "--resolution", 100, "--layout", "flat"], ["out.vdb"]),
        Command("series", ["resample", folder / "step_*.vtu", "-o", "out_#.vdb"], ["out_0.vdb", "out_1.vdb"]),
        Command("tets", ["tets", stokes, "-o", "out.vtu", "--json", "out.json"], ["out.vtu", "out.json"]),
        Command("slice", ["slice", stokes, "-o", "out.exr", "--normal", "1,2,3", "--resolution", 1000], ["out.exr"]),
        Command("slice-png", ["slice", stokes, "-o", "out.png", "--normal", "1,2,3", "--resolution", 1000, "--field", "pressure"], ["out.png"]),
        Command("picture", ["picture", sampled, "-o", "out.png", "--pixels", 1500], ["out.png"]),
        Command("compare", ["compare", stokes, "--algorithms", "software,software", "--resolution", 48, "--json", "out.json"], ["out.json"]),
        Command("verify", ["verify", stokes, sampled, "--json", "out.json"], ["out.json"]),
        Command("info", ["info", sampled, "--json", "out.json"], ["out.json"]),
    ]  # fmt: skip


class KillTest:
    def __init__(self, program, data, seed):
        self.program, self.seed = program, seed
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="tessera-kill-test-"))
        self.commands = commands(data, self.folder)
        self.faults = []
        self.tally = collections.Counter()
        self.stokes = data / "freefem-stokes-sphere/stokes_p1.vtu"

    def fault(self, context, text):
        self.faults.append(f"{context}: {text}")

    def start(self, command, cwd):
        return subprocess.Popen([self.program, *command.arguments], cwd=cwd, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)

    def prepare(self):
        """Undisturbed runs: how long they take, and what a whole output is."""
        for step in range(2):
            shutil.copy(self.stokes, self.folder / f"step_{step}.vtu")
        sampled = [self.program, "resample", self.stokes, "-o", "sampled.vdb", "--refine", "uniform", "--resolution", "64", "--quiet"]
        subprocess.run(sampled, cwd=self.folder, check=True, timeout=LONGEST_S)
        for command in self.commands:
            place = self.folder / "reference" / command.name
            place.mkdir(parents=True)
            begin = time.monotonic()
            result = subprocess.run([self.program, *command.arguments], cwd=place, capture_output=True, timeout=LONGEST_S)
            command.seconds = time.monotonic() - begin
            if result.returncode != 0:
                raise SystemExit(f"kill_test: {command.name} fails by itself: {result.stderr.decode()}")
            for output in command.outputs:
                command.reference[output] = (place / output).read_bytes()
            if command.outputs[0].endswith(".vdb") and command.name != "flat":
                mesh = self.stokes if command.name == "series" else command.arguments[1]
                subprocess.run([self.program, "verify", mesh, command.outputs[0]], cwd=place, check=True, capture_output=True, timeout=LONGEST_S)

    def wait_for_writing(self, process, cwd):
        """Until an unfinished file has bytes."""
        end = time.monotonic() + LONGEST_S
        while time.monotonic() < end and process.poll() is None:
            for entry in os.scandir(cwd):
                try:
                    if entry.name.endswith(".tmp") and entry.stat().st_size > 0:
                        return
                except FileNotFoundError:
                    pass
            time.sleep(0.0005)

    def kill_once(self, index):
        rng = random.Random(f"{self.seed}:{index}")
        command = rng.choice(self.commands)
        number = rng.choice([signal.SIGKILL, signal.SIGKILL, signal.SIGINT, signal.SIGTERM])
        while_writing, with_old = rng.random() < 0.4, rng.random() < 0.5
        delay = rng.uniform(0, 0.03) if while_writing else rng.uniform(0, 0.9 * command.seconds)
        context = f"run {index} ({command.name}, {number.name}{', writing' if while_writing else ''}, {delay:.3f} s{', older file' if with_old else ''})"
        place = self.folder / "run"
        shutil.rmtree(place, ignore_errors=True)
        place.mkdir()
        if with_old:
            for output in command.outputs:
                (place / output).write_bytes(OLD)
        process = self.start(command, place)
        if while_writing:
            self.wait_for_writing(process, place)
        time.sleep(delay)
        handled = catches(process.pid, number)
        process.send_signal(number)
        errors = process.communicate(timeout=LONGEST_S)[1].decode(errors="replace")
        self.tally[f"{number.name} -> {'exit code ' + str(process.returncode) if process.returncode >= 0 else 'ended'}"] += 1
        self.check_outcome(context, command, number, handled, process.returncode, errors)
        self.check_outputs(context, command, place, process.returncode, with_old)
        self.check_remains(context, command, number if handled or number == signal.SIGKILL else signal.SIGKILL, place)

    def check_outcome(self, context, command, number, handled, code, errors):
        lines = [line for line in errors.splitlines() if not line.startswith("tessera: warning: ")]
        if code == 0 or number == signal.SIGKILL:
            if lines:
                self.fault(context, f"ends with {code} and says {errors!r}")
        elif code == 128 + number:
            if len(lines) != 1:
                self.fault(context, f"{len(lines)} lines on stderr: {errors!r}")
        elif handled or code != -number:
            self.fault(context, f"ends with {code}: {errors!r}")

    def check_outputs(self, context, command, place, code, with_old):
        for output in command.outputs:
            path = place / output
            if not path.exists():
                if with_old or code == 0:
                    self.fault(context, f"there is no {output}")
                continue
            content = path.read_bytes()
            is_old, is_whole = content == OLD, command.is_whole(output, content)
            if not is_whole and not (is_old and with_old):
                self.fault(context, f"{output} of {len(content)} bytes is neither whole nor the older file")
            elif code == 0 and not is_whole:
                self.fault(context, f"exit code 0, and {output} wasn't written")
            elif code > 0 and is_whole and command.name != "series":  # a series keeps the steps that are done
                self.fault(context, f"interrupted, and {output} was written")

    def check_remains(self, context, command, number, place):
        for name in sorted(set(os.listdir(place)) - set(command.outputs)):
            is_temporary = any(re.fullmatch(rf"\.{re.escape(output)}\.\d+(-\d+)?\.tmp", name) for output in command.outputs)
            if number != signal.SIGKILL or not is_temporary:
                self.fault(context, f"{name} is left")
            else:
                self.tally["SIGKILL left a temporary file"] += 1

    def stale_files(self):
        """What a killed run left is no obstacle, though a new process may have the same number."""
        command = next(c for c in self.commands if c.name == "tets")
        place = self.folder / "stale"
        place.mkdir()
        script = 'for n in "" -1; do echo stale > ".out.vtu.$$$n.tmp"; echo stale > ".out.json.$$$n.tmp"; done; exec "$@"'
        result = subprocess.run(["sh", "-c", script, "sh", self.program, *command.arguments], cwd=place, capture_output=True, timeout=LONGEST_S)
        if result.returncode != 0 or result.stderr:
            self.fault("stale files", f"exit code {result.returncode}: {result.stderr!r}")
        self.check_outputs("stale files", command, place, result.returncode, False)
        stale = [name for name in os.listdir(place) if name.endswith(".tmp")]
        if len(stale) != 4 or any((place / name).read_text() != "stale\n" for name in stale):
            self.fault("stale files", f"they were touched: {stale}")

    def full_disk(self, shares):
        """A small tmpfs with room for a share of the output. Returns why it can't be tried, or nothing."""
        place = self.folder / "small"
        place.mkdir()
        for command in self.commands:
            size = len(command.reference[command.outputs[0]])
            for share in shares:
                room = int(share * size) // 4096 * 4096
                filler = 4096 * (1 + len(command.outputs))
                mount = ["mount", "-t", "tmpfs", "-o", f"size={room + filler}", "none", str(place)]
                if os.geteuid() != 0 or subprocess.run(mount, capture_output=True).returncode:
                    return "mounting a small file system needs root"
                try:
                    self.run_on_full_disk(command, place, f"full disk ({command.name}, room for {room} of {size} bytes)")
                finally:
                    subprocess.run(["umount", place], check=True)
        return None

    def run_on_full_disk(self, command, place, context):
        (place / "filler").write_bytes(bytes(4096))
        for output in command.outputs:
            (place / output).write_bytes(OLD)
        result = subprocess.run([self.program, *command.arguments], cwd=place, capture_output=True, timeout=LONGEST_S)
        lines = result.stderr.decode(errors="replace").splitlines()
        if result.returncode != 1 or len(lines) != 1 or not lines[0].startswith("tessera: can't write "):
            self.fault(context, f"exit code {result.returncode}: {lines}")
        for output in command.outputs:
            if (place / output).read_bytes() != OLD:
                self.fault(context, f"{output} isn't the older file")
        if sorted(os.listdir(place)) != sorted(["filler", *command.outputs]):
            self.fault(context, f"left: {os.listdir(place)}")
        self.tally["full disk"] += 1


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tessera", required=True)
    parser.add_argument("--data", type=pathlib.Path, required=True)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", default="1")
    arguments = parser.parse_args()
    test = KillTest(str(pathlib.Path(arguments.tessera).resolve()), arguments.data.resolve(), arguments.seed)
    try:
        test.prepare()
        print(f"seed {arguments.seed}; undisturbed: " + ", ".join(f"{c.name} {c.seconds:.1f} s" for c in test.commands), flush=True)
        for index in range(arguments.count):
            test.kill_once(index)
        test.stale_files()
        why_not = test.full_disk((0, 0.5, 0.95) if arguments.count >= 100 else (0.5,))
        if why_not:
            print(f"skipped the full disk: {why_not}")
    finally:
        shutil.rmtree(test.folder, ignore_errors=True)
    for what, count in sorted(test.tally.items()):
        print(f"  {what}: {count}")
    for fault in test.faults:
        print(f"FAILED {fault}")
    print(f"{len(test.faults)} faults")
    return 1 if test.faults else 0


if __name__ == "__main__":
    sys.exit(main())
