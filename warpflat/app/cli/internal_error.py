"""What no command has foreseen: one line, and an exit code of its own."""

from __future__ import annotations

import os
import re
import sys
import traceback
from collections.abc import Sequence

from warpflat.core import one_line

__all__ = ["INTERNAL_ERROR", "report_internal_error"]

#: The exit code, as `sysexits.h` has it: 1 means that there is a result.
INTERNAL_ERROR = 70
_TRACEBACK = "WARPFLAT_TRACEBACK"


def report_internal_error(error: BaseException, arguments: Sequence[str]) -> int:
    """Print one line about an error of the program itself, and return the exit code.

    The traceback comes before it if the arguments have -v, or if the variable WARPFLAT_TRACEBACK is set.
    """
    if os.environ.get(_TRACEBACK) or any(re.fullmatch(r"--verbose|-[a-z]*v[a-z]*", word) for word in arguments):
        traceback.print_exception(error, file=sys.stderr)
    last = traceback.extract_tb(error.__traceback__)[-1:]
    place = f" in {os.path.basename(last[0].filename)}, line {last[0].lineno}" if last else ""
    line = one_line(f"{type(error).__name__}: {error}"[:300])
    print(
        f"warpflat: internal error, the program's own fault: {line}{place}; please report it with the command and its files "
        f"({_TRACEBACK}=1 prints where it was raised)",
        file=sys.stderr,
    )
    return INTERNAL_ERROR
