"""What is being done just now, in a few words, told to whoever listens; to nobody otherwise.

A callback tells of every step of a relaxation. This is for the rest of a run: compiling, sewing, drafting, drawing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

__all__ = ["doing", "listening"]

_listener: ContextVar[Callable[[str], None] | None] = ContextVar("listener", default=None)


def doing(words: str) -> None:
    """Tell what is being done from now on."""
    listener = _listener.get()
    if listener is not None:
        listener(words)


@contextmanager
def listening(listener: Callable[[str], None]) -> Iterator[None]:
    """Have `listener` told of what is done in the body."""
    before = _listener.set(listener)
    try:
        yield
    finally:
        _listener.reset(before)
