"""Output that native code writes straight to the file descriptor of standard error, past Python's `sys.stderr`."""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager

__all__ = ["native_errors"]


@contextmanager
def native_errors() -> Iterator[list[str]]:
    """Capture what native code writes to standard error in the block; its lines are in the list at the end.

    It holds for the whole process, other threads included, so the body should be short. Nothing is kept where there is no standard
    error or no room for a temporary file.
    """
    lines = list[str]()
    try:
        heard, stderr = tempfile.TemporaryFile(), os.dup(2)  # noqa: SIM115 (closed below)
    except OSError:
        yield lines
        return
    with heard:
        if sys.stderr is not None:
            sys.stderr.flush()
        try:
            os.dup2(heard.fileno(), 2)
            yield lines
        finally:
            if sys.stderr is not None:
                sys.stderr.flush()
            os.dup2(stderr, 2)
            os.close(stderr)
            heard.seek(0)
            lines += heard.read().decode(errors="replace").splitlines()
