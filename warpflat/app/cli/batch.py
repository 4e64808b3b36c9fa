"""`warpflat batch`: many scenes in one command, in this process or on Dask workers."""

from __future__ import annotations

import sys
import time
from collections import Counter
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import click

from warpflat.app.cli.options import DONE, EXIT_CODES, FAULTY, ComputingCommand, out_option, tell

__all__ = ["batch"]

_FILES = """\b
What comes out, in DIR:
  KEY/             the files of a run, and task.json: what the task was
  KEY.error.json   instead of them: why the task failed; remove it to try the task again
  index.html       a table of all tasks with pictures; a click on a heading sorts
  index.csv        the same for programs
  batch.json       digests of these files, by which the next run knows them
  bodies.csv, bodies.png
                   of several bodies: measures of the patterns over girths, and which bodies no size fits"""
_MOST_ERRORS = 10
# Where no terminal is, a line after each such share of the tasks, and at least so often [s].
_LINES, _SILENCE = 10, 60.0
_BAR = "{desc}: {n_fmt}/{total_fmt} tasks |{bar:20}| [{elapsed}, {remaining} left]"


@click.command(cls=ComputingCommand, epilog=f"{_FILES}\n\n{EXIT_CODES}")
@click.argument("file", metavar="BATCH.toml", type=click.Path(path_type=Path))
@out_option("Folder.  [default: out/NAME]")
@click.option(
    "--workers", type=click.IntRange(1, 1000), default=1, metavar="N", help="Processes on this machine.  [default: 1]"
)
@click.option("--scheduler", metavar="ADDRESS", help="Of a Dask scheduler, as tcp://HOST:8786, instead of --workers.")
@click.option("--quiet", "-q", is_flag=True, help="Print nothing but mistakes and errors of tasks.")
def batch(file: Path, out: Path | None, workers: int, scheduler: str | None, quiet: bool) -> int:
    """Run many scenes: bodies, fabrics and overrides of a batch file.

    A task whose result is there is not run again. Ctrl-C keeps what is done, and the same command goes on from there.
    A task that fails ends none of the others; the exit code is 1 then, and where a task is not at rest.

    Several workers and a scheduler need Dask: pip install ".[batch]" in a checkout.

    \b
    Examples:
      warpflat batch scenes/batch_sizes.toml --workers 4
      warpflat batch scenes/batch_sizes.toml --out /shared/sizes --scheduler tcp://head:8786
    """
    from warpflat.app.batch.plan import load_batch
    from warpflat.app.batch.run import run_batch
    from warpflat.app.batch.task import NOT_AT_REST
    from warpflat.app.cli.run import start_warp_silently
    from warpflat.core import InputError, one_line

    tasks = load_batch(file)
    if find_spec("distributed") is None:
        if scheduler is not None:
            raise InputError('--scheduler needs Dask: pip install ".[batch]" in a checkout, or leave it out')
        if workers > 1 and not quiet:
            tell('note: --workers needs Dask (pip install ".[batch]" in a checkout); the tasks run one after the other')
        workers = 1
    start_warp_silently()
    folder = out if out is not None else Path("out") / file.stem
    with _Bar(file.stem, len(tasks), quiet=quiet) as bar:
        rows = run_batch(
            tasks,
            folder,
            workers=workers,
            scheduler=scheduler,
            on_progress=bar.show,
            on_note=lambda note: None if quiet else bar.note(note),
        )
    failed = [row for row in rows if row.message]
    for row in failed[:_MOST_ERRORS]:
        tell(one_line(f"{row.task.key}: {row.message}"))
    if len(failed) > _MOST_ERRORS:
        tell(f"{len(failed) - _MOST_ERRORS} more errors; see {folder / 'index.html'}")
    counts = Counter(row.status for row in rows)
    if not quiet:
        totals = ", ".join(f"{count} {status}" for status, count in counts.items())
        click.echo(f"{len(rows)} tasks: {totals}; see {folder / 'index.html'}")
    return FAULTY if failed or NOT_AT_REST in counts else DONE


class _Bar:
    """The number of tasks done and the time left on stderr: a bar on a terminal, a line now and then elsewhere."""

    def __init__(self, name: str, total: int, *, quiet: bool) -> None:
        """Prepare the bar of a batch with `total` tasks."""
        self._name, self._total, self._quiet = name, total, quiet
        self._bar: Any = None
        self._began = self._told = time.monotonic()
        self._told_share = 0

    def __enter__(self) -> _Bar:
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.close()

    def show(self, done: int, before: int) -> None:
        """Show the number of tasks done; those done before say nothing of the pace."""
        if self._quiet:
            return
        if not sys.stderr.isatty():
            now, share = time.monotonic(), _LINES * done // max(self._total, 1)
            if share > self._told_share or now - self._told > _SILENCE:
                self._told, self._told_share = now, share
                left = (now - self._began) * (self._total - done) / max(done - before, 1)
                more = f", about {left / 60.0:.0f} min left" if done < self._total and done > before else ""
                click.echo(f"{self._name}: {done} of {self._total} tasks{more}", err=True)
            return
        from tqdm import tqdm

        if self._bar is None:
            self._bar = tqdm(
                desc=self._name, total=self._total, initial=before, file=sys.stderr, smoothing=0.05, bar_format=_BAR
            )
        self._bar.update(done - self._bar.n)

    def note(self, text: str) -> None:
        """Print a note above the bar."""
        if self._bar is not None:
            self._bar.clear()
        tell(f"note: {text}")
