"""Work beside the main process: a function writes its files in a fork of the process, on another core.

Only a program allows it, by :func:`work_beside`: a fork has no thread but its own, so the function must wait for no other.
Everywhere else, and where there is one core, a function runs when its result is asked for.
"""

from __future__ import annotations

import gc
import os
import pickle
import signal
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from contextvars import ContextVar
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any, Generic, TypeVar

from warpflat.core import activity_listener, listening_to_reads, note_read, report_activity, thread_count
from warpflat.pattern.files.left_out import LeftOut, leave_out, listening_to_left_out

__all__ = ["Beside", "two_at_a_time", "work_beside"]

Item = TypeVar("Item")
Result = TypeVar("Result")

# PR_SET_PDEATHSIG of Linux's prctl.
_SIGNAL_OF_PARENTS_DEATH = 1

_is_allowed: ContextVar[bool] = ContextVar("beside", default=False)


@contextmanager
def work_beside() -> Iterator[None]:
    """Allow functions to run in forks of the process in the block."""
    before = _is_allowed.set(True)
    try:
        yield
    finally:
        _is_allowed.reset(before)


class Beside(Generic[Result]):
    """A function without arguments that runs in a process of its own while the caller goes on; used in a ``with`` block.

    Its result must be picklable. Files that it writes into an output folder belong to the caller's run, and so do those that it reads or
    leaves out. At the end of the block the process is ended if its result has not been taken.

    Attributes:
        process: the number of the other process; 0 if there was none.
    """

    def __init__(self, function: Callable[[], Result], activity: str = "") -> None:
        """Prepare a function; it runs from the beginning of the block, or in `result` where there is no other process.

        Args:
            function: what is to be done.
            activity: reported while the other process is waited for.
        """
        self._function, self._activity = function, activity
        self.process = 0
        self._child: Any = None

    def __enter__(self) -> Beside[Result]:
        if not _is_allowed.get() or sys.platform != "linux" or thread_count() < 2:
            return self  # frameworks of macOS do not bear a fork
        warp = sys.modules.get("warp")
        if warp is not None and warp.is_cuda_available():
            return self  # nor does a process with a CUDA device
        from multiprocessing import get_context

        context = get_context("fork")
        self._answer, answer = context.Pipe(duplex=False)
        child = context.Process(target=_answer_in_child, args=(self._function, answer, os.getpid()))
        with answer, suppress(OSError):  # no memory, or no process, for it
            child.start()
            self._child, self.process = child, child.pid or 0
        return self

    def __exit__(self, *_: object) -> None:
        if self._child is not None:
            self._child.kill()
            self._wait()

    def result(self) -> Result:
        """Wait for the function and return its result, or raise its error.

        Where its process has died, which the system does where memory is short, the function runs again in this one.
        """
        if self._child is None:
            return self._function()
        if self._activity:
            report_activity(self._activity)
        try:
            good, value, read, left_out = self._answer.recv()
        except (EOFError, OSError):
            return self._function()
        finally:
            self._wait()
        for path in read:
            note_read(path)
        for step in left_out:
            leave_out(step)
        if not good:
            raise value
        return value

    def _wait(self) -> None:
        child, self._child = self._child, None
        child.join()
        self._answer.close()


def two_at_a_time(function: Callable[[Item], Result], items: Iterable[Item]) -> Iterator[Result]:
    """Yield what a function makes of items, in their order, every other one in a process of its own."""

    def on_one_core(item: Item) -> Result:
        from warpflat.core import on_one_thread

        with on_one_thread():
            return function(item)

    rest = iter(items)
    for item in rest:
        following = list(islice(rest, 1))
        with ExitStack() as stack:
            others = [stack.enter_context(Beside(partial(on_one_core, other))) for other in following]
            yield (on_one_core if any(other.process for other in others) else function)(item)
            for other in others:
                yield other.result()


def _answer_in_child(function: Callable[[], Any], answer: Any, parent: int) -> None:
    """Send whether a function went well, its result or error, and what it has read and left out; end the process, whatever happens."""
    # What the parent has dropped is not collected here: the end of a Dask client waits for a thread, which a fork lacks.
    gc.freeze()
    import ctypes

    try:
        for name in ("SIGINT", "SIGTERM", "SIGHUP"):
            signal.signal(getattr(signal, name), signal.SIG_DFL)
        # Let the system kill this process when its parent dies, so that it does not write into a folder that is being
        # cleared.
        ctypes.CDLL(None).prctl(_SIGNAL_OF_PARENTS_DEATH, signal.SIGKILL)
        if os.getppid() != parent:  # it has died meanwhile
            return
        good, read, left_out = True, list[Path](), list[LeftOut]()
        try:
            with (
                activity_listener(lambda activity: None),
                listening_to_reads(read.append),
                listening_to_left_out(left_out.append),
            ):
                value = function()
        except Exception as error:
            good, value = False, error
        try:
            content = pickle.dumps((good, value, read, left_out))
            pickle.loads(content)  # an exception may not be made again from its arguments
        except Exception as error:
            fault = error if good else value
            content = pickle.dumps((False, RuntimeError(f"{type(fault).__name__}: {fault}"), read, left_out))
        answer.send_bytes(content)
    finally:
        os._exit(0)
