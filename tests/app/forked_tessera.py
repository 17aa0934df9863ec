"""Runs of tessera that start from one process, which has loaded the libraries already (forked_tessera.cpp)."""

import os
import pathlib
import select
import struct
import subprocess
import tempfile
import threading

TIMEOUT_S = 300


class ForkedTessera:
    """run() is subprocess.run() with captured text. Each thread has a process of its own; where the build lacks the program beside
    tessera, tessera itself is run."""

    def __init__(self, tessera):
        self.tessera = str(tessera)
        self.program = pathlib.Path(tessera).resolve().parent / "forked_tessera"
        self.local = threading.local()

    def run(self, arguments, cwd=None):
        words = list(map(str, arguments))
        if not self.program.exists():
            return subprocess.run([self.tessera, *words], capture_output=True, text=True, timeout=TIMEOUT_S, cwd=cwd)
        if getattr(self.local, "process", None) is None or self.local.process.poll() is not None:
            self.local.process = subprocess.Popen([self.program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True)
        with tempfile.TemporaryDirectory(prefix="tessera-run-") as folder:
            outputs = [os.path.join(folder, name) for name in ("out", "err")]
            request = b"".join(os.fsencode(word) + b"\0" for word in [str(cwd or os.getcwd()), *outputs, *words])
            process = self.local.process
            process.stdin.write(struct.pack("=I", len(request)) + request)
            process.stdin.flush()
            if not select.select([process.stdout], [], [], TIMEOUT_S)[0]:
                os.killpg(process.pid, 9)
                raise subprocess.TimeoutExpired(words, TIMEOUT_S)
            status = os.waitstatus_to_exitcode(struct.unpack("=i", process.stdout.read(4))[0])
            texts = [pathlib.Path(path).read_text(encoding="utf-8") for path in outputs]
        return subprocess.CompletedProcess([self.tessera, *words], status, *texts)
