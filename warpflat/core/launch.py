"""Launches on all cores: on the CPU a kernel runs over contiguous ranges of its threads, one range per core.

A launch on the CPU is one serial loop that holds no interpreter lock while it runs, so ranges of it run at once from
Python threads. A kernel that is launched so takes ``first: int`` as its last input and begins with
``i = wp.tid() + first``; it writes to places of its own index only, so that the result is the same, bit for bit, for
any number of threads. On a CUDA device the same calls are ordinary launches, and a sequence that is run again and again becomes a graph.

    step = Sequence([record(gather_forces, dim=n, inputs=[...], outputs=[...]), record(advance, ...)])
    step.launch()                   # both, each over ranges, the second when all of the first is done

The number of threads is that of the cores this process may use, or the environment variable ``WARPFLAT_THREADS``, or an
argument.
"""

from __future__ import annotations

import contextlib
import os
import threading
from collections.abc import Sequence as SequenceOf
from functools import partial
from typing import Any

import numpy as np
import warp as wp

from warpflat.core.compile import start_warp
from warpflat.core.launch_arguments import Command, launch_commands
from warpflat.core.threads import thread_count

__all__ = ["Launch", "Sequence", "launch_each", "record", "record_copy", "record_zero", "split_range"]

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
        """Hold the commands for the ranges, and in `keep` the objects that they point to."""
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
        device: Warp device.
        threads: of the CPU that share it; `thread_count()` if not given.
        least: shortest range worth a thread of its own.
        turns: ranges that each thread takes, every so many-th, where some may take much longer than others.
    """
    start_warp()
    where = wp.get_device(device)
    least = _LEAST_RANGE if least is None else max(least, 1)
    if where.is_cuda or dim < 2 * least:
        return Launch(
            launch_commands(kernel, [(0, dim)] if dim > 0 else [], inputs, outputs, where), (inputs, outputs), where
        )
    threads = thread_count() if threads is None else threads
    ranges = split_range(dim, threads * _fair_turns(dim, threads, turns, least), least=least)
    commands = launch_commands(kernel, ranges, inputs, outputs, where)
    if len(commands) > threads:
        commands = [partial(_run_all, commands[i::threads]) for i in range(threads)]
    return Launch(commands, keep=(inputs, outputs), device=where)


def _fair_turns(dim: int, threads: int, most: int, least: int) -> int:
    """Return how many ranges each thread takes if all take equally many."""
    if threads == 1:
        return 1
    return max(1, min(most, dim // (threads * least)))


def _run_all(commands: SequenceOf[Command]) -> None:
    for command in commands:
        command()


def record_copy(source: wp.array, target: wp.array, *, begin: int = 0) -> Launch:
    """Record that values are copied, as many as the target has, from `begin` on; both are on one device."""
    copy = partial(wp.copy, target, source, src_offset=begin, count=len(target))
    return Launch([copy], keep=(source, target), device=target.device)


def record_zero(target: wp.array) -> Launch:
    """Record that an array is filled with zeros."""
    return Launch([target.zero_], keep=target, device=target.device)


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


class _Barrier:
    """A dissemination barrier of `size` threads: in round r, thread i signals thread i + 2^r and waits for i - 2^r.

    (The dissemination barrier of Hensgen, Finkel and Manber 1988.) The locks are binary semaphores. There are two sets in
    turn: a thread may come to the next barrier before another has left this one.
    """

    def __init__(self, size: int) -> None:
        locks: list[list[list[threading.Lock]]] = []
        reach = [2**r for r in range((size - 1).bit_length())]
        for _ in range(2):
            locks.append([[_closed_lock() for _ in range(size)] for _ in reach])
        self._rounds = [
            [[(of[(i + d) % size].release, of[i].acquire) for d, of in zip(reach, turn, strict=True)] for turn in locks]
            for i in range(size)
        ]
        self._turn = [0] * size
        self._locks = [lock for turn in locks for of in turn for lock in of]

    def wait(self, i: int) -> None:
        turn = self._turn[i]
        self._turn[i] = 1 - turn
        for signal, wait in self._rounds[i][turn]:
            signal()
            wait()

    def open(self) -> None:
        """Open the barrier for good."""
        for lock in self._locks:
            _open(lock)


def _closed_lock() -> threading.Lock:
    lock = threading.Lock()
    lock.acquire()
    return lock


def _open(lock: threading.Lock) -> None:
    with contextlib.suppress(RuntimeError):  # it was open
        lock.release()


class _Job:
    """Phases of commands, one per thread, and the first error."""

    def __init__(self, phases: SequenceOf[SequenceOf[Command]], barrier: _Barrier) -> None:
        self.phases = phases
        self.barrier = barrier
        self.error: BaseException | None = None
        self.abandoned = False

    def take_part(self, i: int) -> None:
        """Take part as thread i. After an error only the barriers go on, so that no thread waits for ever."""
        wait = self.barrier.wait
        for commands in self.phases:
            if i < len(commands) and self.error is None:
                try:
                    commands[i]()
                except BaseException as error:
                    self.error = error
            wait(i)
            if self.abandoned:
                return


class _Pool:
    """Threads that wait for jobs; the caller is thread 0. They are daemons and die with the process."""

    def __init__(self, size: int) -> None:
        self.size = size
        self.busy = threading.Lock()
        self.closed = False
        self._job: _Job | None = None
        self._start = [_closed_lock() for _ in range(size)]
        self._barriers: dict[int, _Barrier] = {}
        for i in range(1, size):
            threading.Thread(target=self._serve, args=(i,), name=f"warpflat-{i}", daemon=True).start()

    def _serve(self, i: int) -> None:
        start = self._start[i]
        while True:
            start.acquire()
            if self.closed:
                return
            if self._job is not None:
                try:
                    self._job.take_part(i)
                except RuntimeError:  # the barrier's locks were opened for good, under its feet
                    if not self.closed:
                        raise

    def run(self, phases: SequenceOf[SequenceOf[Command]], threads: int) -> None:
        """Run the phases on the pool's threads. The caller holds the lock `busy`."""
        barrier = self._barriers.get(threads) or self._barriers.setdefault(threads, _Barrier(threads))
        job = self._job = _Job(phases, barrier)
        try:
            for i in range(1, threads):
                self._start[i].release()
            job.take_part(0)
        except BaseException:  # an interrupt while waiting: nobody knows any more who is where
            self.close()
            raise
        if job.error is not None:
            raise job.error

    def close(self) -> None:
        """End the threads; the pool cannot be used afterwards."""
        global _pool
        if self.closed:
            return
        self.closed = True
        if self._job is not None:
            self._job.abandoned = True
        if _pool is self:
            _pool = None
        for lock in self._start:
            _open(lock)
        for barrier in self._barriers.values():
            barrier.open()


_pool: _Pool | None = None
_pool_making = threading.Lock()


def _pool_of(size: int) -> _Pool:
    """Return the pool with at least this many threads."""
    global _pool
    with _pool_making:
        if _pool is None or _pool.size < size:
            old, _pool = _pool, _Pool(size)
            if old is not None and old.busy.acquire(blocking=False):
                old.close()
                old.busy.release()
        return _pool


def _forget_pool() -> None:
    """Drop the pool in a forked process, which has none of its parent's threads."""
    global _pool, _pool_making
    _pool, _pool_making = None, threading.Lock()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget_pool)


def _run(phases: SequenceOf[SequenceOf[Command]]) -> None:
    threads = max((len(commands) for commands in phases), default=1)
    if threads > 1:
        pool = _pool_of(threads)
        # Another thread of the caller's may be using it, or a kernel's launch be inside one: then these run in order.
        if pool.busy.acquire(blocking=False):
            try:
                if not pool.closed:
                    pool.run(phases, threads)
                    return
            finally:
                pool.busy.release()
                if pool is not _pool:  # a larger one has taken its place meanwhile
                    pool.close()
    for commands in phases:
        for command in commands:
            command()
