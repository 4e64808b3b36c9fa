"""The process that runs the command line on one case after the other, and may crash or hang without harm.

It reads one JSON object per line from its standard input and answers each with one on its standard output.
"""

from __future__ import annotations

import faulthandler
import gc
import json
import os
import resource
import signal
import sys
import traceback
import warnings
from contextlib import suppress
from pathlib import Path
from typing import Any

MEMORY = 6 * 1024**3
"""Address space of the process [B]; a third of it is taken by the libraries."""

GRACE = 2.0
"""Seconds before the harness gives a case up at which it is told where the case hangs."""


def processor_seconds() -> float:
    """What this process and those that it has started and that have ended took of the processor [s]: a busy machine adds nothing."""
    own, others = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return own.ru_utime + own.ru_stime + others.ru_utime + others.ru_stime


def peak_memory(*, reset: bool = False) -> int:
    """The most memory [B] that this process has had in use since the last reset; 0 where the system does not tell."""
    try:
        if reset:
            Path("/proc/self/clear_refs").write_text("5")
        line = next(line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("VmHWM"))
    except (OSError, StopIteration):
        return 0
    return int(line.split()[1]) * 1024


def attack(arguments: list[str]) -> int:
    """Attack the studio of this process; it goes on for the next case."""
    sys.path.insert(0, str(Path(__file__).parents[1]))
    from fuzz.studio_messages import run_attack

    return run_attack(Path(arguments[1]))


def run_case(case: dict[str, Any]) -> dict[str, Any]:
    """Run the command line in the case's folder, with standard output and error in files; return code, seconds of the
    processor and bytes.
    """
    from warpflat.app.cli.main import main

    os.chdir(case["folder"])
    for number, name in ((1, "stdout"), (2, "stderr")):
        file = os.open(case[name], os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(file, number)
        os.close(file)
    before = peak_memory(reset=True)
    # Tells where a case hangs. It reads the frames of a thread that runs on, which crashes Python now and then: not before
    # the case is sure to have hung.
    faulthandler.dump_traceback_later(case["patience"] - GRACE, file=2)
    started = processor_seconds()
    try:
        with warnings.catch_warnings():  # each case warns anew
            code = main(case["arguments"]) if case["arguments"][:1] != ["studio-attack"] else attack(case["arguments"])
    except SystemExit as ended:
        code = ended.code
    except BaseException:
        traceback.print_exc()
        code = 1
    seconds = processor_seconds() - started
    faulthandler.cancel_dump_traceback_later()
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):
            stream.flush()
    return {"code": code, "seconds": seconds, "memory": peak_memory() - before}


def serve() -> None:
    """Answer requests until the input ends."""
    requests, answers = os.fdopen(os.dup(0)), os.fdopen(os.dup(1), "w")
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    # A file of 1 GB is an answer to no case.
    resource.setrlimit(resource.RLIMIT_FSIZE, (1024**3, 1024**3))
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    faulthandler.enable(file=2)
    for request in requests:
        answers.write(json.dumps(run_case(json.loads(request))) + "\n")
        answers.flush()
        if not gc.get_freeze_count():
            gc.collect()
            gc.freeze()  # what the first case has loaded stays, and need not be searched again


if __name__ == "__main__":
    serve()
