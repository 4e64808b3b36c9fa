"""Signals that end the program: Ctrl-C, SIGTERM, and SIGHUP of a terminal that closes.

While nothing is open they end the process where it stands. While files are open they raise an exception, so that no temporary file stays.
"""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

from warpflat.core import SIGNALS

__all__ = [
    "INTERRUPTED",
    "TERMINATED",
    "Stopped",
    "end_at_once",
    "ignore_at_exit",
    "signal_message",
    "stop_on_signals",
]

INTERRUPTED, TERMINATED = 130, 143
_WORDS = {INTERRUPTED: "warpflat: interrupted", TERMINATED: "warpflat: terminated"}
_LATER = 0.01  # [s]


class Stopped(KeyboardInterrupt):
    """A signal has asked the program to end.

    It is a KeyboardInterrupt whatever the signal: Python's own compiler swallows every other exception of a signal handler.

    Attributes:
        code: the exit code for it.
    """

    def __init__(self, number: int) -> None:
        """Keep the number of the signal."""
        super().__init__(number)
        self.code = 128 + number


def signal_message(code: int) -> str | None:
    """Return the message for the exit code of a signal; None if the terminal is closed."""
    return _WORDS.get(code)


def end_at_once(code: int | None = None) -> None:
    """Let signals end the process without a traceback, while nothing is open that must be removed.

    Args:
        code: the exit code that the process has already earned, and has told why; by default that of the signal.
    """

    def end(number: int, _: object) -> None:
        message = signal_message(128 + number) if code is None else None
        if message is not None:
            os.write(2, f"{message}\n".encode())
        os._exit(128 + number if code is None else code)

    for number in _ours():
        signal.signal(number, end)


def ignore_at_exit() -> None:
    """Let the very end of the process, after all exit functions, pass over signals: Python then gives them back their default action."""
    import atexit

    def ignore() -> None:
        for number in _ours():
            signal.signal(number, signal.SIG_IGN)

    atexit.register(ignore)


@contextmanager
def stop_on_signals() -> Iterator[None]:
    """Let the first signal raise `Stopped` in the body, and a second one end the process at once.

    Where Python or a library would swallow the exception, in a destructor or while a module is imported, it is raised a little later.
    """
    before = {number: signal.getsignal(number) for number in _ours()}
    imports = _imports(sys._getframe())
    came, waiting = SIGNALS, list[Any]()
    came.clear()

    def stop(number: int, frame: FrameType | None) -> None:
        if _imports(frame) > imports:
            later(number)
            return
        came.append(number)
        for each in before:
            signal.signal(each, signal.SIG_DFL)
        raise Stopped(number)

    def later(number: int) -> None:
        import threading

        def again() -> None:
            waiting.clear()
            if hasattr(signal, "pthread_kill"):
                # A call in which the main thread waits ends early only by a signal to that thread.
                signal.pthread_kill(threading.main_thread().ident or 0, number)
            else:
                signal.raise_signal(number)

        if not waiting:
            waiting.append(threading.Timer(_LATER, again))
            waiting[0].daemon = True
            waiting[0].start()

    def lost(what: sys.UnraisableHookArgs) -> None:
        if not isinstance(what.exc_value, Stopped):
            hook(what)
            return
        for number in before:
            signal.signal(number, stop)
        later(what.exc_value.args[0])

    hook, sys.unraisablehook = sys.unraisablehook, lost
    for number in before:
        signal.signal(number, stop)
    try:
        yield
    except Exception:
        # Native code may make an exception of its own of it.
        if came:
            raise Stopped(came[0]) from None
        raise
    finally:
        for timer in waiting:
            timer.cancel()
        sys.unraisablehook = hook
        for number, handler in before.items():
            signal.signal(number, handler)


def _imports(frame: FrameType | None) -> int:
    """Return how many frames of the call stack belong to Python's import."""
    count = 0
    while frame is not None:
        count += frame.f_globals.get("__name__") == "importlib._bootstrap"
        frame = frame.f_back
    return count


def _ours() -> list[int]:
    """Return the signals that still have their default action; others are ignored, as by nohup, or handled by the caller."""
    import threading

    if threading.current_thread() is not threading.main_thread():
        return []  # only the main thread may handle signals
    known = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]
    usual = []
    for number in known:
        handler = signal.getsignal(number)
        if handler in (signal.SIG_DFL, signal.default_int_handler) or getattr(handler, "__module__", None) == __name__:
            usual.append(number)
    return usual
