"""A batch is run: what is done is not done again, and the index is kept current."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from contextlib import closing
from pathlib import Path

from warpflat.app.batch.body_statistics import bodies_table, read_body_patterns
from warpflat.app.batch.index import BatchIndex
from warpflat.app.batch.plan import Task
from warpflat.app.batch.task import Row, forget_starts, read_row, run_task
from warpflat.pattern import atomic_path, optional_file, output_folder

__all__ = ["run_batch"]


def run_batch(
    tasks: Sequence[Task],
    out: str | Path,
    *,
    workers: int = 1,
    scheduler: str | None = None,
    on_progress: Callable[[int, int], object] = lambda done, before: None,
    on_note: Callable[[str], object] = lambda note: None,
) -> list[Row]:
    """Run the tasks of a batch whose results are not in `out` yet; return a row for each, in their order.

    Files: `KEY/` as of a run or `KEY.error.json` per task, `index.csv` and `index.html`; of several bodies `bodies.csv` and
    `bodies.png`; `batch.json` lists them with their digests. An interruption keeps what is done.

    Args:
        tasks: of :func:`warpflat.app.batch.plan.load_batch`.
        out: folder, made if need be; workers on other machines must have it under the same path.
        workers: processes on this machine; 1 runs the tasks in this one.
        scheduler: address of a Dask scheduler, instead of `workers`.
        on_progress: called with the number of tasks done, and how many of them were done before.
        on_note: called with what the user should know meanwhile.

    Raises:
        InputError: `out` cannot be written, a file there would be replaced that is not as warpflat wrote it, the scheduler cannot be
            reached, or a worker cannot use `out`.
        ImportError: workers or a scheduler are asked for, and Dask is not installed.
    """
    folder = Path(out).absolute()
    index = BatchIndex(folder, tasks)
    todo = []
    for task in tasks:
        row = read_row(task, folder)
        if row is None:
            todo.append(task)
        else:
            index.add(row)
    done = before = len(tasks) - len(todo)
    if todo and scheduler is not None:
        from warpflat.app.batch.workers import connect

        connect(scheduler).close()  # before anything is written
    try:
        index.write()
        on_progress(done, before)
        with closing(_results(todo, folder, workers, scheduler, on_note)) as results:
            for row in results:
                done += 1
                index.add(row)
                index.write_if_due()
                on_progress(done, before)
    except BaseException:
        for task in todo:  # what workers have finished meanwhile
            index.add(read_row(task, folder) or Row(task=task))
            forget_starts(task, folder)
        raise
    finally:
        index.write()
    patterns = read_body_patterns(index.rows, folder)
    if len({tuple(pattern.girths.values()) for pattern in patterns}) > 1:
        from warpflat.app.batch.body_picture import write_body_picture

        with output_folder(folder, ["bodies.csv", "bodies.png"], guard=True):
            with atomic_path(folder / "bodies.csv") as temporary:
                temporary.write_text(bodies_table(patterns), encoding="utf-8", newline="")
            drawn = list[str]()
            with optional_file(folder / "bodies.png", drawn) as path:
                write_body_picture(path, patterns)
            index.write(bodies=bool(drawn))
    return index.rows


def _results(
    todo: Sequence[Task], out: Path, workers: int, scheduler: str | None, on_note: Callable[[str], object]
) -> Generator[Row, None, None]:
    if not todo:
        return
    if scheduler is None and min(workers, len(todo)) == 1:
        for task in todo:
            yield run_task(task, out)
        return
    from warpflat.app.batch.workers import run_on_cluster, run_on_workers

    if scheduler is None:
        yield from run_on_workers(todo, out, min(workers, len(todo)))
    else:
        yield from run_on_cluster(todo, out, scheduler, on_note=on_note)
