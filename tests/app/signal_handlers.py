"""What a running process does with signals; Linux."""

import pathlib


def catches(pid, number):
    """Whether the process has a handler for a signal: before main runs it has none, and a signal simply ends it."""
    try:
        status = pathlib.Path(f"/proc/{pid}/status").read_text()
    except OSError:
        return False
    mask = next((line.split()[1] for line in status.splitlines() if line.startswith("SigCgt:")), "0")
    return bool(int(mask, 16) >> (number - 1) & 1)
