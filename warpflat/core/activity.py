"""The activity of a run, such as "compiling kernels", is reported here to the registered listener, if there is one.

The callback of a relaxation reports its steps. This is for the rest of a run: compiling, sewing, drafting, drawing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

__all__ = ["activity_listener", "report_activity"]

_listener: ContextVar[Callable[[str], None] | None] = ContextVar("listener", default=None)


def report_activity(activity: str) -> None:
    """Report what the run does from now on, in a few words."""
    listener = _listener.get()
    if listener is not None:
        listener(activity)


@contextmanager
def activity_listener(listener: Callable[[str], None]) -> Iterator[None]:
    """Register `listener` for the activities that are reported in the block."""
    before = _listener.set(listener)
    try:
        yield
    finally:
        _listener.reset(before)
