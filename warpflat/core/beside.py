"""Work beside the main process: a function writes its files in a fork of the process, on another core.

Only a program allows it, by :func:`work_beside`: a fork has no thread but its own, so the function must wait for no other.
Everywhere else, and where there is one core, a function runs when its result is asked for.

A fork shares the memory of the process, but has to import what only its function needs. A :class:`ForkServer` imports that while the
process goes on, and takes a copy of the function.
"""

from __future__ import annotations

import importlib
import os
import pickle
import signal
import socket
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from functools import partial
from typing import Any, Generic, TypeVar

from warpflat.core.activity import activity_listener, report_activity
from warpflat.core.atomic_files import adopt_files, files_written
from warpflat.core.threads import thread_count

__all__ = ["Beside", "ForkServer", "work_beside"]

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


class ForkServer:
    """A process that is forked early, imports modules, and forks itself for every function that it is sent; used in a ``with`` block.

    The block waits for what it has forked, and where an error ends the block all of that is ended. Where no process may be forked, there is
    none.

    Attributes:
        process: the number of its process; 0 if there is none.
    """

    def __init__(self, imports: Sequence[str]) -> None:
        """Prepare a server that imports these modules; none is needed where there are no imports."""
        self._imports = imports
        self._answers = list[int]()
        self.process = 0

    def __enter__(self) -> ForkServer:
        if self._imports and _can_fork():
            self._socket, theirs = socket.socketpair()
            with theirs:
                self.process = _fork(partial(_serve, self._imports, self._socket, theirs))
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if self.process:
            self._socket.close()
            if kind is not None:
                os.kill(self.process, signal.SIGKILL)
            os.waitpid(self.process, 0)
        for answer in self._answers:
            while os.read(answer, 1 << 20):  # until what writes it has died with the server
                pass
            os.close(answer)

    def run(self, function: Callable[[], Any]) -> int:
        """Let a picklable function run in another process, and return the pipe from which its answer is read."""
        sent = os.memfd_create("function")
        answer, theirs = os.pipe()
        self._answers.append(answer)
        try:
            with open(sent, "wb", closefd=False) as file:
                pickle.dump(function, file, pickle.HIGHEST_PROTOCOL)
            with suppress(OSError):  # where the server has died, the answer is empty
                socket.send_fds(self._socket, [b"1"], [sent, theirs])
        finally:
            os.close(sent)
            os.close(theirs)
        return answer


class Beside(Generic[Result]):
    """A function without arguments that runs in a process of its own while the caller goes on; used in a ``with`` block.

    Its result must be picklable. Files that it writes into an output folder belong to the caller's run. At the end of the block the process
    is ended if its result has not been taken.

    Attributes:
        process: the number of the other process; 0 if there was none, or if a server has forked it.
    """

    def __init__(self, function: Callable[[], Result], activity: str = "", *, server: ForkServer | None = None) -> None:
        """Prepare a function; it runs from the beginning of the block, or in `result` where there is no other process.

        Args:
            function: what is to be done; picklable, if there is a server.
            activity: reported while the other process is waited for.
            server: in whose processes it runs, if it has one.
        """
        self._function, self._activity, self._server = function, activity, server
        self.process = self._child = 0
        self._pipe = -1

    def __enter__(self) -> Beside[Result]:
        if self._server is not None and self._server.process:
            self._pipe = self._server.run(self._function)
        elif _can_fork():
            read, write = os.pipe()
            self.process = self._child = _fork(partial(_answer, self._function, write))
            os.close(write)
            if self._child:
                self._pipe = read
            else:
                os.close(read)
        return self

    def __exit__(self, *_: object) -> None:
        if self._child:
            with suppress(ProcessLookupError):
                os.kill(self._child, signal.SIGKILL)
            self._wait()

    def result(self) -> Result:
        """Wait for the function and return its result, or raise its error.

        Where its process has died, which the system does where memory is short, the function runs again in this one.
        """
        if self._pipe < 0:
            return self._function()
        if self._activity:
            report_activity(self._activity)
        parts = []
        while part := os.read(self._pipe, 1 << 20):
            parts.append(part)
        self._wait()
        if not parts:
            return self._function()
        good, value, files = pickle.loads(b"".join(parts))
        adopt_files(files)
        if not good:
            raise value
        return value

    def _wait(self) -> None:
        if self._child:  # a server keeps its pipes
            os.close(self._pipe)
            with suppress(ChildProcessError):
                os.waitpid(self._child, 0)
        self._pipe, self._child = -1, 0


def _can_fork() -> bool:
    """Return whether a fork gains time and does no harm: frameworks of macOS do not bear it, nor does a process with a CUDA device."""
    if not (_is_allowed.get() and sys.platform == "linux" and thread_count() > 1):
        return False
    warp = sys.modules.get("warp")
    return warp is None or not warp.is_cuda_available()


def _fork(function: Callable[[], None]) -> int:
    """Run a function in another process, which ends with it or with this one; return its number, 0 if the system gives none."""
    parent = os.getpid()
    try:
        child = os.fork()
    except OSError:  # no memory, or no process, for it
        return 0
    if child == 0:
        try:
            for name in ("SIGINT", "SIGTERM", "SIGHUP"):
                signal.signal(getattr(signal, name), signal.SIG_DFL)
            _die_with(parent)
            function()
        finally:
            os._exit(0)  # without any cleaning up of the parent's
    return child


def _die_with(parent: int) -> None:
    """Let the system kill this process when its parent dies, so that it does not write into a folder that is being cleared."""
    import ctypes

    ctypes.CDLL(None).prctl(_SIGNAL_OF_PARENTS_DEATH, signal.SIGKILL)
    if os.getppid() != parent:  # it has died meanwhile
        os._exit(0)


def _serve(imports: Sequence[str], parents: socket.socket, own: socket.socket) -> None:
    """Import modules, then run each function that comes in a fork."""
    parents.close()
    for name in imports:
        importlib.import_module(name)
    children = []
    while descriptors := socket.recv_fds(own, 1, 2)[1]:
        sent, pipe = descriptors
        with open(sent, "rb") as file:
            file.seek(0)
            children.append(_fork(lambda: _answer(pickle.load(file), pipe)))  # noqa: B023 (it runs at once)
        os.close(pipe)
    for child in filter(None, children):
        os.waitpid(child, 0)


def _answer(function: Callable[[], Any], pipe: int) -> None:
    """Run the function, and write its result or error into the pipe."""
    before = files_written()
    try:
        with activity_listener(lambda activity: None):
            answer: tuple[bool, Any] = True, function()
    except Exception as error:
        answer = False, error
    new = [(folder, name) for folder, name in files_written() if (folder, name) not in before]
    content = memoryview(_pickled(*answer, new))
    while content:
        content = content[os.write(pipe, content) :]


def _pickled(good: bool, value: Any, files: list[tuple[str, str]]) -> bytes:
    try:
        content = pickle.dumps((good, value, files))
        pickle.loads(content)  # an exception may not be made again from its arguments
    except Exception as error:
        what = f"{type(value).__name__}: {value}" if not good else f"{type(error).__name__}: {error}"
        content = pickle.dumps((False, RuntimeError(what), files))
    return content
