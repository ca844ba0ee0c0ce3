"""One input in a forked process: crashes, hangs and memory are outcomes like others."""

from __future__ import annotations

import json
import os
import re
import select
import signal
import tempfile
import time
from dataclasses import asdict
from pathlib import Path

from formats import Format
from limits import STUCK_SECONDS, limited_memory
from outcome import Outcome, outcome_of, warnings_are_errors

_FRAME = re.compile(r'File "[^"]*/(psdmc/[\w/]+\.py)", line \d+ in (\w+)')
"""A line of faulthandler, which begins with the innermost frame."""


def outcome_in_child(format: Format, data: bytes, folder: Path) -> Outcome:
    """The outcome of a deep run; `folder` is a scratch folder in which the format was set up."""
    with tempfile.TemporaryFile() as fault:
        reading, writing = os.pipe()
        child = os.fork()
        if child == 0:
            os.close(reading)
            _child(format, data, folder, fault.fileno(), writing)
        os.close(writing)
        said = _read(reading, child)
        _, status = os.waitpid(child, 0)
        fault.seek(0)
        trace = fault.read().decode("utf-8", errors="replace")
    if said:
        return Outcome(**json.loads(said))
    return died(-os.waitstatus_to_exitcode(status), trace)


def died(number: int, trace: str) -> Outcome:
    """The outcome of a process that a signal ended; `trace` is what faulthandler wrote."""
    try:
        kind = "Hang" if number == signal.SIGKILL else signal.Signals(number).name
    except ValueError:
        kind = f"Exit{-number}"
    frame = _FRAME.search(trace)
    where = f"{frame[1]}:{frame[2]}" if frame else "outside psdmc"
    return Outcome(kind, where, f"the process ended with {kind}", trace[:4000])


def _child(format: Format, data: bytes, folder: Path, fault: int, writing: int) -> None:
    import faulthandler

    os.dup2(fault, 2)
    faulthandler.enable(fault)
    with warnings_are_errors(), limited_memory():
        outcome = outcome_of(lambda: format.run(data, folder, True))
    os.write(writing, json.dumps(asdict(outcome)).encode()[:60_000])
    os._exit(0)


def _read(reading: int, child: int) -> bytes:
    """What the child wrote before it ended; it is ended where it is stuck."""
    end, said = time.monotonic() + STUCK_SECONDS, b""
    while time.monotonic() < end:
        if select.select([reading], [], [], 1.0)[0]:
            part = os.read(reading, 65536)
            if not part:
                break
            said += part
    else:
        os.kill(child, signal.SIGKILL)
    os.close(reading)
    return said
