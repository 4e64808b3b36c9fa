"""The tasks of a batch on Dask workers: processes on this machine, or those of a scheduler."""

from __future__ import annotations

import asyncio
import concurrent.futures
import logging
import os
import platform
import threading
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from urllib.parse import urlsplit

import dask
from distributed import Client, Future, KilledWorker, LocalCluster, TimeoutError, wait
from distributed.comm import CommClosedError
from distributed.system import MEMORY_LIMIT

from warpflat._version import __version__
from warpflat.app.batch.plan import Task
from warpflat.app.batch.task import SET_ASIDE, Row, has_killed, run_task, set_aside
from warpflat.core import InputError, control_in, quote_value

__all__ = ["connect", "run_on_cluster", "run_on_workers"]

# A task that waits while so many workers die is given up for this time, though it never got as far as its start.
_MOST_BLAMES = 20
_NOT_BEGUN = f"{_MOST_BLAMES} times all workers that had it died before it began: see why they die, and run the batch again to try it"
# How long a scheduler is waited for [s].
_PATIENCE = 60.0
# How often the number of workers is asked for [s].
_LOOK = 1.0
# Each worker is one process with one thread: tasks beside each other use the cores better than threads of one task.
_ONE_THREAD = dict.fromkeys(
    ("WARPFLAT_THREADS", "PXR_WORK_THREAD_LIMIT", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1"
)
# By default Dask looks at a task's stack every 10 ms, and has its workers give each freed block above 64 KiB back to the system, which the
# next array asks for again. Without both a block takes a tenth less. The thresholds are those that the C library comes to by itself.
_UNWATCHED = {
    "distributed.worker.profile.enabled": False,
    "distributed.nanny.pre-spawn-environ.MALLOC_MMAP_THRESHOLD_": 32 << 20,
    "distributed.nanny.pre-spawn-environ.MALLOC_TRIM_THRESHOLD_": 64 << 20,
}
# What the client raises when the scheduler has gone.
_LOST = CommClosedError, concurrent.futures.CancelledError, asyncio.CancelledError
# A scheduler's workers may have several threads; matplotlib allows one task at a time.
_one_task = threading.Lock()


def run_on_workers(tasks: Sequence[Task], out: Path, count: int) -> Iterator[Row]:
    """Run tasks on processes of this machine; yield a row for each that is done.

    Each worker has one thread and its share of the memory; one that dies is started again.

    Raises:
        InputError: a result cannot be written.
    """
    from warpflat.core import compile_all_modules

    compile_all_modules()
    with (
        dask.config.set(_UNWATCHED),
        LocalCluster(
            n_workers=count,
            threads_per_worker=1,
            processes=True,
            memory_limit=MEMORY_LIMIT // count,
            dashboard_address="127.0.0.1:0",
            silence_logs=logging.CRITICAL,
            env=_ONE_THREAD,
        ) as cluster,
        Client(cluster) as client,
    ):
        yield from _run_round(client, {task.key: task for task in tasks}, out)


def run_on_cluster(
    tasks: Sequence[Task], out: Path, address: str, *, on_note: Callable[[str], object]
) -> Iterator[Row]:
    """Run tasks on the workers of a Dask scheduler; yield a row for each that is done.

    If the scheduler is lost, it is waited for, and what is not done is submitted again.

    Raises:
        InputError: the scheduler cannot be reached for a minute, or a worker does not see `out` or has another version.
    """
    todo = {task.key: task for task in tasks}
    while todo:
        try:
            with connect(address) as client:
                if not client.nthreads():
                    on_note(f"the scheduler {address} has no workers yet; waiting for them")
                yield from _run_round(client, todo, out)
        except _LOST:
            on_note(f"the scheduler {address} is lost; waiting for it")


def connect(address: str) -> Client:
    """Return a client of the scheduler of an address.

    Raises:
        InputError: it is no address, or no scheduler answers there for a minute.
    """
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    try:
        parts = urlsplit(address if "://" in address else f"tcp://{address}")
        is_address = bool(parts.hostname and parts.port) and not any(map(control_in, address))
    except ValueError:
        is_address = False
    if not is_address:
        raise InputError(
            f"--scheduler: {quote_value(address)} is no address of a scheduler; give it as tcp://HOST:8786"
        )
    try:
        return Client(address, timeout=_PATIENCE)
    except Exception as error:  # each kind of connection has its own
        raise InputError(
            f"no Dask scheduler answers at {address} ({type(error).__name__}); start one with `dask scheduler`, and give its address "
            "as tcp://HOST:8786. What is done is kept: the same command goes on from there"
        ) from None


def _run_round(client: Client, todo: dict[str, Task], out: Path) -> Iterator[Row]:
    """Run tasks on the workers that a client has, and take each from `todo` when it is done.

    No more tasks are submitted than there are workers: when a worker dies, Dask blames all tasks that it had been given. A task that Dask
    gives up is tried again, unless the count of its own starts says that it has killed its workers itself. Where worker after worker dies
    before it begins, it is no fault of the task: nothing is recorded, and the same command tries it again.
    """
    blames = Counter[str]()
    waiting = list(todo.values())
    going: dict[Future, Task] = {}
    while waiting or going:
        free = max(1, len(client.nthreads())) - len(going)
        for task in waiting[: max(0, free)]:
            waiting.remove(task)
            going[client.submit(_work, task, out, __version__, key=("warpflat", task.key), pure=False)] = task
        try:
            done = wait(list(going), timeout=_LOOK, return_when="FIRST_COMPLETED").done
        except TimeoutError:
            continue
        for future in done:
            task = going[future]
            try:
                row: Row = future.result()
            except KilledWorker:
                blames[task.key] += 1
                if has_killed(task, out):
                    row = set_aside(task, out)
                elif blames[task.key] < _MOST_BLAMES:
                    future.retry()
                    continue
                else:
                    row = Row(task=task, status=SET_ASIDE, message=_NOT_BEGUN)
            del going[future], todo[task.key]
            yield row


def _work(task: Task, out: Path, version: str) -> Row:
    """Run a task on a worker.

    Raises:
        InputError: the worker does not see `out`, has another version, or cannot write the result.
    """
    # The libraries read these when they are imported.
    for name, value in _ONE_THREAD.items():
        os.environ.setdefault(name, value)
    import warp

    from warpflat.core import native_errors, start_warp

    # Warp starts without its greeting; what it says on standard error is no error of the task.
    warp.config.log_level = warp.LOG_ERROR
    with native_errors():
        start_warp()
    if version != __version__:
        raise InputError(f"a worker on {platform.node()} has warpflat {__version__}, not {version}: install the same")
    if not out.is_dir():
        raise InputError(f"a worker on {platform.node()} does not see {out}; --out must be a folder that all share")
    with _one_task:
        return run_task(task, out)
