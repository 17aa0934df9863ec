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
    """run() is subprocess.run() with captured text; what it returns says too how many seconds of processor time (cpu_s) and bytes of
    memory (peak_bytes) the run took. Each thread has a process of its own; where the build lacks the program beside tessera, tessera
    itself is run, without these."""

    def __init__(self, tessera):
        self.tessera = str(tessera)
        self.program = pathlib.Path(tessera).resolve().parent / "forked_tessera"
        self.local = threading.local()

    def run(self, arguments, cwd=None, watch=None, tick_s=TIMEOUT_S):
        """@param watch is called with the process's number after every tick; without it a tick without an end is an error."""
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
            while not select.select([process.stdout], [], [], tick_s)[0]:
                if watch is None:
                    os.killpg(process.pid, 9)
                    raise subprocess.TimeoutExpired(words, tick_s)
                for child in pathlib.Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split():
                    watch(int(child))
            status, microseconds, kibibytes = struct.unpack("=iqq", process.stdout.read(20))
            texts = [pathlib.Path(path).read_text(encoding="utf-8", errors="backslashreplace") for path in outputs]
        result = subprocess.CompletedProcess([self.tessera, *words], os.waitstatus_to_exitcode(status), *texts)
        result.cpu_s, result.peak_bytes = microseconds / 1e6, kibibytes << 10
        return result
