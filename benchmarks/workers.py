"""Many garments: a batch of basic blocks in one process and on workers; what a task waits for, and garments an hour.

    OMP_NUM_THREADS=1 python benchmarks/workers.py [--tasks 8] [--workers 1 2] [--film] [--json FILE]

Each batch runs in a process of its own, with compiled kernels: sizes EU 36 to 44 of `scenes/basic_block.toml` in up to eight fabrics, all
files but the film, as `scenes/batch_sizes.toml` has them. `start` is the time until the first task begins: imports of program and
Dask, processes of the workers, and their imports. `between` is the mean time from one task's end, as the batch sees it, to the beginning of
the next on the same worker, the first tasks left out. Garments an hour are those of the steady state, from the first task's beginning on.
Before that, the same sparse factors and loops of Python are run by one process, and by as many at once as there are workers: cores that
share caches, memory or a core's own units are slower beside each other, and no batch gains more than they leave.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

SCENE = Path(__file__).parents[1] / "scenes" / "basic_block.toml"
_SIZES = (36, 38, 40, 42, 44)
_FABRICS = ["woven", "denim", "cotton", "linen", "satin", "wool-plain", "silk", "jacket"]


# Some seconds of what a block does: sparse factors, small arrays, Python.
_WORK = """
import time, numpy as np
from scipy.sparse import diags_array, eye_array, kron
from scipy.sparse.linalg import splu
line = diags_array([-1.0, 2.01, -1.0], offsets=[-1, 0, 1], shape=(90, 90))
matrix = (kron(line, eye_array(90)) + kron(eye_array(90), line)).tocsc()
right, begun = np.ones(8100), time.process_time()
for _ in range(20):
    factor = splu(matrix, permc_spec="MMD_AT_PLUS_A")
    for _ in range(20):
        factor.solve(right)
    sum(float(np.dot(np.ones(50), np.full(50, number))) for number in range(10_000))
print(time.process_time() - begun)
"""


def slower_beside(count: int) -> float:
    """Return how much more processor time a process takes while others do the same, `count` in all."""

    def seconds(beside: int) -> float:
        started = [
            subprocess.Popen([sys.executable, "-c", _WORK], stdout=subprocess.PIPE, text=True) for _ in range(beside)
        ]
        return sum(float(each.communicate()[0]) for each in started) / beside

    alone = seconds(1)
    return seconds(count) / alone


def child(begun: float, tasks: int, workers: int, film: bool) -> dict[str, Any]:
    """Run a batch in this process; return when its tasks began and ended, in seconds since `begun`."""
    from warpflat.app.batch.plan import load_batch
    from warpflat.app.batch.run import run_batch
    from warpflat.app.cli.run import start_warp_silently

    fabrics = _FABRICS[: -(-tasks // len(_SIZES))]
    with tempfile.TemporaryDirectory() as name:
        file = Path(name) / "blocks.toml"
        bodies = "\n".join(f'[[bodies]]\nsize = "EU {size}"' for size in _SIZES)
        override = "" if film else "[[overrides]]\noutput = { frames = 0 }\n"
        file.write_text(f"scenes = [{json.dumps(str(SCENE))}]\nfabrics = {json.dumps(fabrics)}\n{override}{bodies}\n")
        start_warp_silently()
        ends: list[float] = []

        def note(done: int, before: int) -> None:
            if done > before:
                ends.append(time.time() - begun)

        rows = run_batch(load_batch(file)[:tasks], Path(name) / "out", workers=workers, on_progress=note)
        # In the order in which they ended.
        records = sorted(Path(name).glob("out/*/task.json"), key=lambda record: record.stat().st_mtime)
        taken = [json.loads(record.read_text())["seconds"] for record in records]
    return {"ends": ends, "taken": taken, "statuses": [row.status for row in rows]}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tasks", type=int, default=8)
    parser.add_argument("--workers", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--film", action="store_true", help="with films and pages")
    parser.add_argument("--json", type=Path, metavar="FILE", help="the same figures as data")
    parser.add_argument("--child", nargs=2, metavar=("BEGUN", "WORKERS"), help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.child:
        print(json.dumps(child(float(given.child[0]), given.tasks, int(given.child[1]), given.film)))
        return
    results, alone = [], None
    for workers in given.workers:
        if workers > 1:
            slower = slower_beside(workers)
            print(
                f"machine: {workers} processes at once, each takes {slower:.2f} times as long: {workers / slower:.2f} times one"
            )
    print(
        f"{'workers':>7} {'tasks':>5} {'all s':>7} {'start s':>8} {'a task s':>9} {'between s':>10} {'an hour':>8} {'cpu s':>7}"
    )
    for workers in given.workers:
        command = [sys.executable, __file__, "--tasks", str(given.tasks), *(["--film"] if given.film else [])]
        before, begun = os.times(), time.time()
        done = subprocess.run(
            [*command, "--child", repr(begun), str(workers)], stdout=subprocess.PIPE, text=True, check=True
        )
        whole, after = time.time() - begun, os.times()
        found = json.loads(done.stdout.splitlines()[-1])
        begins = sorted(end - taken for end, taken in zip(found["ends"], found["taken"], strict=True))
        waits = [begin - end for begin, end in zip(begins[workers:], sorted(found["ends"]), strict=False)]
        steady = max(found["ends"]) - begins[0]
        row = {
            "workers": workers,
            "tasks": given.tasks,
            "seconds": whole,
            "start": begins[0],
            "task": sum(found["taken"]) / len(found["taken"]),
            "each": found["taken"],
            "between": sum(waits) / max(1, len(waits)),
            "an_hour": 3600 * given.tasks / steady,
            "cpu": after.children_user + after.children_system - before.children_user - before.children_system,
            "statuses": sorted(set(found["statuses"])),
        }
        results.append(row)
        alone = row if workers == 1 else alone
        faster = ""
        if alone is not None and workers > 1:
            faster = (
                f"  {alone['seconds'] / whole:.2f} times as fast, {row['an_hour'] / alone['an_hour']:.2f} once begun"
            )
        print(
            f"{workers:7} {given.tasks:5} {whole:7.1f} {row['start']:8.2f} {row['task']:9.2f} {row['between']:10.3f} "
            f"{row['an_hour']:8.0f} {row['cpu']:7.1f}  {', '.join(row['statuses'])}{faster}",
            flush=True,
        )
    if given.json:
        given.json.write_text(json.dumps(results, indent=1))


if __name__ == "__main__":
    main()
