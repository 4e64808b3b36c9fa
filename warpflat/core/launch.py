"""Launches on all cores: on the CPU a kernel runs over contiguous ranges of its threads, one range per core.

A launch on the CPU is one serial loop that holds no interpreter lock while it runs, so ranges of it, each a recorded
launch of Warp's, run at once from Python threads. A kernel that is launched so takes ``first: int`` as its last input and begins with
``i = wp.tid() + first``; it writes to places of its own index only, so that the result is the same, bit for bit, for
any number of threads. On a CUDA device the same calls are ordinary launches, and a sequence that is run again and again becomes a graph.

    step = Sequence([record(gather_forces, dim=n, inputs=[...], outputs=[...]), record(advance, ...)])
    step.launch()                   # both, each over ranges, the second when all of the first is done

The number of threads is that of the cores this process may use, or the environment variable ``WARPFLAT_THREADS``, or an
argument.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterator
from collections.abc import Sequence as SequenceOf
from contextlib import contextmanager
from functools import partial
from queue import SimpleQueue
from typing import Any

import numpy as np
import warp as wp

from warpflat.core.compile import compile_common_modules, kernel_cache_errors, start_warp
from warpflat.core.threads import thread_count

__all__ = ["Launch", "Sequence", "launch_each", "on_one_thread", "record", "split_range"]

Command = Callable[[], None]

# A range shorter than this is not worth waking a thread for (benchmarks/threads.py measures it).
_LEAST_RANGE = 2048
# Ranges begin at multiples of this, so that no two threads write to one cache line.
_ALIGNMENT = 64
# Runs after which a sequence on a CUDA device becomes a graph, which takes as long as several of them.
_GRAPH_AFTER = 2


def split_range(size: int, parts: int, *, least: int | None = None) -> list[tuple[int, int]]:
    """Split 0 to `size` into at most `parts` ranges (begin, end), of which only the last may be shorter than `least`."""
    least = _LEAST_RANGE if least is None else least
    parts = max(1, min(parts, size // max(least, 1)))
    stride = -(-size // parts)
    if parts > 1:
        stride = -(-stride // _ALIGNMENT) * _ALIGNMENT
    return [(begin, min(begin + stride, size)) for begin in range(0, size, stride)] if size > 0 else []


class Launch:
    """A recorded launch; `launch` runs it and returns when it is done (on a CUDA device: when it is under way).

    Attributes:
        commands: one for each range. device: where they run.
    """

    def __init__(
        self, commands: SequenceOf[Command], keep: object = None, device: str | wp.Device | None = "cpu"
    ) -> None:
        """Hold the commands for the ranges, and in `keep` the arrays that they point to."""
        self.commands = tuple(commands)
        self.device = wp.get_device(device)
        self._keep = keep

    def launch(self) -> None:
        """Run it."""
        _run([self.commands])


class Sequence:
    """Launches one after the other on the same threads, with a barrier after each.

    On a CUDA device they become one graph once they have been run a few times: to start that takes as long as to start one of them.

    Attributes:
        launches: in their order.
    """

    def __init__(self, launches: SequenceOf[Launch]) -> None:
        """Hold these launches, without those that have no range."""
        self.launches = tuple(launches)
        self._phases = [launch.commands for launch in self.launches if launch.commands]
        self._device = next((launch.device for launch in self.launches if launch.device.is_cuda), None)
        self._runs, self._graph = 0, None

    def launch(self) -> None:
        """Run them."""
        if self._graph is not None:
            wp.capture_launch(self._graph)
            return
        _run(self._phases)
        self._runs += 1
        if self._device is not None and self._runs == _GRAPH_AFTER and len(self._phases) > 1:
            with wp.ScopedCapture(device=self._device, force_module_load=False) as capture:
                _run(self._phases)
            self._graph = capture.graph


def record(
    kernel: wp.Kernel,
    *,
    dim: int,
    inputs: SequenceOf[Any],
    outputs: SequenceOf[Any] = (),
    first: int = 0,
    device: str | wp.Device | None = None,
    threads: int | None = None,
    least: int | None = None,
    turns: int = 1,
) -> Launch:
    """Record a launch of a kernel whose last input is ``first: int``. All values are fixed; arrays may change in place.

    Args:
        kernel: writes at its own index only.
        dim: number of its threads.
        inputs: all but `first`.
        outputs: arrays it writes.
        first: index of its first thread.
        device: Warp device.
        threads: of the CPU that share it; `thread_count()` if not given.
        least: shortest range worth a thread of its own.
        turns: ranges that each thread takes, every so many-th, where some may take much longer than others.
    """
    start_warp()
    where = wp.get_device(device)
    least = _LEAST_RANGE if least is None else max(least, 1)
    if where.is_cuda or dim < 2 * least:
        ranges, threads = [(0, dim)] if dim > 0 else [], 1
    else:
        threads = thread_count() if threads is None else threads
        # So many that all threads take equally many.
        each = max(1, min(turns, dim // (threads * least))) if threads > 1 else 1
        ranges = split_range(dim, threads * each, least=least)
    commands: list[Command] = []
    # Of two threads that load a module at once one has its code unloaded by the other.
    with _recording, kernel_cache_errors():  # nothing runs yet, but a module that is new is compiled
        if ranges and kernel not in _known:
            compile_common_modules(kernel.module, where)
            _known.add(kernel)
        for begin, end in ranges:
            given = {"inputs": [*inputs, first + begin], "outputs": list(outputs)}
            commands.append(wp.launch(kernel, dim=end - begin, **given, device=where, record_cmd=True).launch)
    if len(commands) > threads:
        commands = [partial(_run_all, commands[i::threads]) for i in range(threads)]
    return Launch(commands, keep=(inputs, outputs), device=where)


_recording = threading.Lock()
_known: set[wp.Kernel] = set()


def _run_all(commands: SequenceOf[Command]) -> None:
    for command in commands:
        command()


def launch_each(
    kernel: wp.Kernel,
    count: int,
    inputs: SequenceOf[Any],
    outputs: SequenceOf[Any],
    *,
    device: str | wp.Device = "cpu",
    least: int | None = None,
) -> None:
    """Run a kernel, whose last input is ``first: int``, once: on all cores where it is long enough.

    Args:
        kernel: writes at its own index only.
        count: number of its threads.
        inputs: all but `first`; arrays of Warp on the device, or on the CPU of NumPy.
        outputs: arrays it writes, likewise.
        device: Warp device.
        least: shortest range worth a thread of its own.
    """
    inputs = [np.ascontiguousarray(given) if isinstance(given, np.ndarray) else given for given in inputs]
    record(kernel, dim=count, inputs=inputs, outputs=outputs, device=device, least=least).launch()


class _Pool:
    """Threads that run commands beside the caller. They are daemons and die with the process."""

    def __init__(self) -> None:
        self.busy = threading.Lock()
        self._size = 0
        self._commands: SimpleQueue[Command | None] = SimpleQueue()
        self._done: SimpleQueue[BaseException | None] = SimpleQueue()

    def _serve(self) -> None:
        while (command := self._commands.get()) is not None:
            self._done.put(_error_of(command))

    def run(self, commands: SequenceOf[Command]) -> None:
        """Run the commands at once, the first on the caller's thread. The caller holds the lock `busy`."""
        while self._size < len(commands) - 1:
            self._size += 1
            threading.Thread(target=self._serve, name=f"warpflat-{self._size}", daemon=True).start()
        for command in commands[1:]:
            self._commands.put(command)
        errors = [_error_of(commands[0]), *(self._done.get() for _ in commands[1:])]
        for error in errors:
            if error is not None:
                raise error

    def close(self) -> None:
        """End the threads, each after what it is doing."""
        for _ in range(self._size):
            self._commands.put(None)


def _error_of(command: Command) -> BaseException | None:
    try:
        command()
    except BaseException as error:
        return error
    return None


_pool = _Pool()


@contextmanager
def on_one_thread() -> Iterator[None]:
    """Run kernels on the caller's thread in the block: for processes that work beside each other."""
    pool = _pool
    mine = pool.busy.acquire(blocking=False)
    try:
        yield
    finally:
        if mine:
            pool.busy.release()


def _begin_anew() -> None:
    """Make new threads and locks in a forked process, which has none of its parent's threads."""
    global _pool, _recording
    _pool, _recording = _Pool(), threading.Lock()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_begin_anew)


def _run(phases: SequenceOf[SequenceOf[Command]]) -> None:
    """Run phases of commands one after the other, those of a phase at once."""
    global _pool
    pool = _pool
    # Another thread of the caller's may be using them, or a launch be inside one: then these run in order.
    if not any(len(commands) > 1 for commands in phases) or not pool.busy.acquire(blocking=False):
        for commands in phases:
            _run_all(commands)
        return
    try:
        for commands in phases:
            if len(commands) > 1:
                pool.run(commands)
            else:
                _run_all(commands)
    except BaseException:
        # After an interrupt others may still be at work, and nobody waits for them any more. The lock stays closed.
        _pool = _Pool()
        pool.close()
        raise
    pool.busy.release()
