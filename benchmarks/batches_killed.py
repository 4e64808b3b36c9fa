"""A batch whose workers are killed at random moments, beside the same batch in one process.

Forty small garments on two workers. Checked: all are done, no result is written twice, and every file is that of the serial batch, times
apart (seconds, memory, the time in a DXF, and what contains or hashes them).

    python benchmarks/batches_killed.py --kills 6
"""

from __future__ import annotations

import argparse
import json
import os
import random
import signal
import tempfile
import threading
import time
from pathlib import Path
from typing import Any

import psutil

from warpflat.batch.plan import Task, load_batch
from warpflat.batch.run import run_batch
from warpflat.batch.task import Row
from warpflat.cli.run import start_warp_silently

_PLAN = """
forms = ["bodice"]
fabrics = ["woven", "denim", "jersey", "interlock"]
overrides = [{ mannequin = { resolution_mm = 25 }, output = { frames = 0 } }]
"""
_SIZES = ("EU 36", "EU 38", "EU 40", "EU 42", "EU 44", "UK 8", "UK 10", "UK 12", "UK 14", "UK 16")
# Values that depend on the clock, the machine's load, or a file with such values.
_TIMES = {"seconds", "memory_mb", "files"}


def main() -> None:
    """Print times, kills and differences."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tasks", type=int, default=40)
    parser.add_argument("--kills", type=int, default=6)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    start_warp_silently()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        bodies = "".join(f'[[bodies]]\nsize = "{size}"\n' for size in _SIZES)
        (folder / "b.toml").write_text(_PLAN + bodies)
        tasks = load_batch(folder / "b.toml")[: given.tasks]
        alone, rows, _, _ = _timed(tasks, folder / "serial", workers=1, kills=0, seed=0)
        print(f"serial: {alone:.1f} s, peak {max(row.memory_mb or 0 for row in rows):.0f} MB", flush=True)
        whole, _, _, _ = _timed(tasks, folder / "whole", workers=2, kills=0, seed=0)
        print(f"2 workers: {whole:.1f} s, {alone / whole:.2f} times as fast", flush=True)
        seconds, rows, kills, written = _timed(tasks, folder / "out", workers=2, kills=given.kills, seed=given.seed)
        done = sum(row.status == "at rest" for row in rows)
        different = [
            f"{task.key}/{path.name}"
            for task in tasks
            for path in sorted((folder / "serial" / task.key).iterdir())
            if _content(path) != _content(folder / "out" / task.key / path.name)
        ]
        print(f"2 workers, {kills} killed: {seconds:.1f} s, peak {max(row.memory_mb or 0 for row in rows):.0f} MB")
        print(f"at rest {done} of {len(tasks)}; written more than once {sum(n > 1 for n in written.values())}")
        print(f"files that differ from serial: {different or 'none'}")
        for row in rows:
            if row.message:
                print(f"{row.task.key}: {row.status}: {row.message}")


def _timed(
    tasks: list[Task], out: Path, *, workers: int, kills: int, seed: int
) -> tuple[float, list[Row], int, dict[str, int]]:
    """Run a batch; return seconds, rows, kills, and by key how often its result was seen to be new."""
    killed, ended = list[int](), threading.Event()
    seen = dict[str, set[int]]()

    def watch() -> None:
        rng, due = random.Random(seed), time.monotonic()
        due += rng.uniform(10, 25)
        while not ended.wait(0.05):
            for path in out.glob("*/metrics.json"):
                seen.setdefault(path.parent.name, set()).add(path.stat().st_mtime_ns)
            if len(killed) < kills and time.monotonic() > due:
                due = time.monotonic() + rng.uniform(3, 15)
                processes = psutil.Process().children(recursive=True)
                found = [each.pid for each in processes if "spawn_main" in str(each.cmdline())]
                if found:
                    killed.append(rng.choice(found))
                    os.kill(killed[-1], signal.SIGKILL)

    thread = threading.Thread(target=watch)
    thread.start()
    begun = time.perf_counter()
    try:
        rows = run_batch(tasks, out, workers=workers)
    finally:
        ended.set()
        thread.join()
    return time.perf_counter() - begun, rows, len(killed), {key: len(times) for key, times in seen.items()}


def _content(path: Path) -> Any:
    if not path.exists():
        return None
    if path.suffix == ".json":
        return _without_times(json.loads(path.read_text()))
    if path.suffix == ".dxf":
        return [line for line in path.read_text().splitlines() if not line.startswith("CREATION TIME")]
    return path.name if path.name == "review.html" else path.read_bytes()


def _without_times(data: Any) -> Any:
    if isinstance(data, dict):
        return {key: _without_times(value) for key, value in data.items() if key not in _TIMES}
    return [_without_times(value) for value in data] if isinstance(data, list) else data


if __name__ == "__main__":
    main()
