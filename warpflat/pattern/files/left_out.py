"""Steps that a run left out, and who hears of them: the run that keeps them for its report, the command line, a test."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path

__all__ = ["LeftOut", "Listener", "is_heard", "leave_out", "listening_to_left_out"]


@dataclass(frozen=True, kw_only=True)
class LeftOut:
    """A step that was left out.

    Attributes:
        note: what was left out, and why: one sentence.
        folder: of the run; None outside of one.
        is_needed: whether the pattern is not complete without it.
    """

    note: str
    folder: Path | None
    is_needed: bool


#: Called with each step that is left out.
Listener = Callable[[LeftOut], object]
_listeners: ContextVar[tuple[Listener, ...]] = ContextVar("left_out", default=())


def leave_out(step: LeftOut) -> None:
    """Tell whoever listens of a step that was left out."""
    for listener in _listeners.get():
        listener(step)


def is_heard() -> bool:
    """Return whether anybody listens."""
    return bool(_listeners.get())


@contextmanager
def listening_to_left_out(listener: Listener) -> Iterator[None]:
    """Call `listener` with each step that is left out in the block."""
    before = _listeners.set((*_listeners.get(), listener))
    try:
        yield
    finally:
        _listeners.reset(before)
