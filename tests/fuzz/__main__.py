"""Fuzzing by hand: `python -m tests.fuzz --cases 5000`, or `--list` for the faults once found, one by one."""

from __future__ import annotations

import json
import sys
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from itertools import count, islice
from pathlib import Path
from queue import SimpleQueue
from random import Random

import click
from tqdm import tqdm

from .folders import packed
from .kinds import FILE_KINDS, KINDS, random_case
from .known_faults import known_faults
from .promise import Case, Verdict, Worker

FOUND = Path(__file__).with_name("found")


def _judged(cases: Iterator[Case], *, workers: int, seconds: float | None) -> Iterator[tuple[Case, Verdict]]:
    """Every case with its verdict, in the order in which they were drawn, until the time is over."""
    free: SimpleQueue[Worker] = SimpleQueue()
    end = time.monotonic() + (seconds or float("inf"))

    def judge(case: Case) -> Verdict:
        worker = free.get()
        try:
            return worker.run(case)
        finally:
            free.put(worker)

    started = [Worker() for _ in range(workers)]
    for worker in started:
        free.put(worker)
    try:
        with ThreadPoolExecutor(workers) as pool:
            while time.monotonic() < end and (batch := list(islice(cases, 10 * workers))):
                yield from zip(batch, pool.map(judge, batch), strict=True)
    finally:
        for worker in started:
            worker.__exit__(None, None, None)


def _save(case: Case, number: int) -> Path:
    """Leaves the odd file of a case, or its command line, where it can be run again and moved to tests/regressions."""
    FOUND.mkdir(exist_ok=True)
    if case.kind == "arguments":
        ending, content = ".arguments.json", json.dumps(case.arguments).encode()
    elif case.kind == "studio":
        ending, content = ".studio.json", case.files["attack.json"]
    elif case.kind in FILE_KINDS:
        ending, content = FILE_KINDS[case.kind], [*case.files.values()][-1]
    else:
        ending, content = ".folder.json", packed(case)
    file = FOUND / f"{number}{ending}"
    file.write_bytes(content)
    return file


def _fuzz(cases: Iterator[tuple[Case, Verdict]], total: int | None) -> int:
    """Judge the cases, print a table per kind and each cause with its smallest file; return how many broke the promise."""
    table: Counter[tuple[str, str]] = Counter()
    causes: dict[str, list[tuple[Path, Verdict]]] = {}
    with tqdm(total=total, unit="case", disable=None) as bar:
        for number, (case, verdict) in enumerate(cases):
            bar.update()
            table[case.kind, "cases"] += 1
            table[case.kind, "violations" if verdict.broken else "refused" if verdict.code == 2 else "accepted"] += 1
            if verdict.broken:
                causes.setdefault(f"{case.kind}: {verdict.cause}", []).append((_save(case, number), verdict))
                bar.set_postfix(causes=len(causes))
    columns = ("cases", "accepted", "refused", "violations")
    click.echo("".join(f"{word:>12}" for word in ("format", *columns)))
    kinds = sorted({kind for kind, _ in table})
    for kind in kinds:
        click.echo("".join(f"{word:>12}" for word in (kind, *(table[kind, column] for column in columns))))
    sums = [sum(table[kind, column] for kind in kinds) for column in columns]
    click.echo("".join(f"{word:>12}" for word in ("all", *sums)))
    for cause, found in sorted(causes.items(), key=lambda item: -len(item[1])):
        file, verdict = min(found, key=lambda item: item[0].stat().st_size)
        click.echo(f"\n{len(found)} x {cause}\n  {file} ({file.stat().st_size} bytes)")
        click.echo("\n".join(f"  | {line[:200]}" for line in verdict.stderr.splitlines()[-4:]))
    return sums[-1]


def _list_faults(workers: int, only: set[str]) -> int:
    """Run the faults once found; print whether the promise holds now, and return how often it does not."""
    cases = [case for case in known_faults() if not only or case.kind in only]
    broken = 0
    for case, verdict in _judged(iter(cases), workers=workers, seconds=None):
        broken += bool(verdict.broken)
        click.echo(f"{'BROKEN' if verdict.broken else 'held':<8}{case.name:<58}{verdict.cause[:200]}")
    click.echo(f"{len(cases) - broken} of {len(cases)} held, {broken} broken")
    return broken


@click.command()
@click.option("--cases", type=int, default=5000, show_default=True, help="How many mutations.")
@click.option("--seconds", type=float, help="Stop after this time.")
@click.option("--seed", type=int, default=0, show_default=True, help="The same seed gives the same cases.")
@click.option("--only", default="", help=f"Kinds, separated by commas: {', '.join(KINDS)}.")
@click.option("--workers", type=int, default=2, show_default=True)
@click.option("--list", "listed", is_flag=True, help="Run the faults once found instead.")
@click.option("--again", type=click.Path(exists=True, path_type=Path), multiple=True, help="Run these files instead.")
def main(
    cases: int, seconds: float | None, seed: int, only: str, workers: int, listed: bool, again: tuple[Path, ...]
) -> None:
    """Check the promise of the command line on damaged files; what breaks it is left in tests/fuzz/found."""
    chosen = {kind for kind in only.split(",") if kind}
    if listed:
        sys.exit(_list_faults(workers, chosen) > 0)
    if again:
        from .regressions import cases_of

        drawn = iter([case for file in again for case in cases_of(file)])
        sys.exit(_fuzz(_judged(drawn, workers=workers, seconds=seconds), None) > 0)
    if unknown := chosen - KINDS.keys():
        raise click.BadParameter(f"{', '.join(unknown)}: choose from {', '.join(KINDS)}", param_hint="--only")
    shares = {name: kind.share for name, kind in KINDS.items() if not chosen or name in chosen}
    randoms = (Random(f"{seed} {number}") for number in count())
    drawn = (random_case(random.choices(list(shares), list(shares.values()))[0], random) for random in randoms)
    sys.exit(_fuzz(_judged(islice(drawn, cases), workers=workers, seconds=seconds), cases) > 0)


if __name__ == "__main__":
    main(prog_name="python -m tests.fuzz")
