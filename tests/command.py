"""The command line, run in this process and in a folder of the test's own."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest
from fuzz.snapshot import snapshot

__all__ = ["Command", "Ended", "command_in"]


class Ended(NamedTuple):
    """How a command ended: exit code, standard output and error, and the files that are new, gone, or of other content."""

    code: int
    out: str
    err: str
    changed: frozenset[str]

    @property
    def refusal(self) -> str:
        """The line of a command that is refused as was promised, and that left everything as it was; "" otherwise."""
        line = re.fullmatch(r"warpflat: ([^\n]+)\n", self.err)
        if line is None or (self.code, self.out, self.changed) != (2, "", frozenset()) or not line[1].isprintable():
            return ""
        return line[1]


Command = Callable[..., Ended]


def command_in(folder: Path, capfd: pytest.CaptureFixture[str]) -> Command:
    """Return what runs the command line, given its words, and tells how it ended and what it changed below a folder."""
    from warpflat.app.cli.main import main

    def run(*arguments: str) -> Ended:
        before = snapshot(folder)
        capfd.readouterr()
        code = main(list(arguments))
        told = capfd.readouterr()
        after = snapshot(folder)
        same = {name for name in before.keys() & after.keys() if before[name] == after[name]}
        return Ended(code, told.out, told.err, frozenset((before.keys() | after.keys()) - same))

    return run
