"""A batch whose workers, scheduler and command are killed at random moments, beside the same batch in one process.

    python benchmarks/batches_killed.py [--tasks 200] [--kills 10] [--undisturbed] [--files]

Bodices in a coarse mesh, on ten bodies and in twenty fabrics. Scheduler, two workers and the command are processes of their own. The
moments are drawn by the number of tasks done. Each killed worker loses the task that it runs; the scheduler is killed once, and the command
once; both are started again. Checked: all tasks are done, no result is written twice, and every file is that of the serial batch, times
apart (seconds, memory, the time in a DXF, and what contains or hashes them). `--undisturbed` runs the batch without kills, too, and
`--files` with pattern files and pictures, which take most of the time.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import psutil

from warpflat.app.batch.plan import Task, load_batch
from warpflat.app.batch.run import run_batch
from warpflat.app.batch.task import Row, read_row
from warpflat.app.cli.run import start_warp_silently

_FABRICS = (
    "woven", "denim", "trousers", "tablecloth", "jacket", "interlock", "rib", "swim", "ponte", "paper",
    "wool-plain", "wool-suiting", "cotton", "stretch-twill", "linen", "silk", "satin", "power-net", "neoprene", "leather",
)  # fmt: skip
_LIGHT = "mannequin = { resolution_mm = 40 }, output = { frames = 0, picture = false }, pattern = { formats = [] }"
_WITH_FILES = "mannequin = { resolution_mm = 40 }, output = { frames = 0 }"
# Values that depend on the clock, the machine's load, or a file with such values.
_TIMES = {"seconds", "memory_mb", "files"}


def main() -> None:
    """Print times, kills and differences."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tasks", type=int, default=40)
    parser.add_argument("--kills", type=int, default=10)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--undisturbed", action="store_true")
    parser.add_argument("--files", action="store_true")
    given = parser.parse_args()
    start_warp_silently()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        tasks = _write_batch(folder, given.tasks, _WITH_FILES if given.files else _LIGHT)
        begun, cpu = time.perf_counter(), time.process_time()
        rows = run_batch(tasks, folder / "serial")
        alone = time.perf_counter() - begun
        print(f"serial: {alone:.1f} s, cpu {time.process_time() - cpu:.1f} s, {_memory(rows)}", flush=True)
        _show_errors(rows)
        runs = {"undisturbed": 0} if given.undisturbed else {}
        for words, kills in {**runs, "killed": given.kills}.items():
            cluster = Cluster(folder / "b.toml", folder / words, len(tasks))
            seconds = cluster.run(_moments(len(tasks), kills, given.seed))
            rows = [read_row(task, folder / words) or Row(task=task) for task in tasks]
            faster = f"{alone / seconds:.2f} times as fast as serial"
            print(f"2 workers, {words}: {seconds:.1f} s, {faster}; cpu {cluster.processor_seconds:.1f} s", flush=True)
            print(f"  {cluster.told()}; {_memory(rows)}, {cluster.memory / 1e6:.0f} MB the largest process of a worker")
            different = [
                f"{task.key}/{path.name}"
                for task in tasks
                for path in sorted((folder / "serial" / task.key).iterdir())
                if _content(path) != _content(folder / words / task.key / path.name)
            ]
            done = sum(row.status == "at rest" for row in rows)
            twice = sum(len(times) > 1 for times in cluster.seen.values())
            print(f"  at rest {done} of {len(tasks)}; results written more than once: {twice}")
            print(f"  files that differ from serial: {different or 'none'}", flush=True)
            _show_errors(rows)


def _write_batch(folder: Path, count: int, override: str) -> list[Task]:
    """Write a batch of ten bodies with measurements of their own, and return its tasks."""
    bodies = "".join(
        f'[[bodies]]\nname = "body {n}"\nmeasurements = {{ bust = {0.80 + 0.03 * n:.2f}, waist = {0.62 + 0.032 * n:.3f}, '
        f"hip = {0.88 + 0.026 * n:.3f}, stature = {1.58 + 0.02 * n:.2f} }}\n"
        for n in range(10)
    )
    # Every body comes in the first tasks of any number of them.
    fabrics = json.dumps(_FABRICS[: max(1, -(-count // 10))])
    (folder / "b.toml").write_text(
        f'forms = ["bodice"]\nfabrics = {fabrics}\noverrides = [{{ {override} }}]\n{bodies}', encoding="utf-8"
    )
    return load_batch(folder / "b.toml")


def _moments(tasks: int, kills: int, seed: int) -> list[tuple[int, str]]:
    """Draw what is killed after how many tasks: so many workers, and the scheduler and the command once if anything is."""
    rng = random.Random(seed)
    victims = ["worker"] * kills + (["scheduler", "command"] if kills else [])
    places = sorted(rng.choices(range(1, max(tasks - 2, 2)), k=len(victims)))
    rng.shuffle(victims)
    return list(zip(places, victims, strict=True))


class Cluster:
    """A scheduler, two workers and the command of a batch, each a process of its own, and started again when it ends.

    Attributes:
        seen: by key, the times of change of its `metrics.json` that were seen.
        memory: the most that a process of a worker took [bytes].
        processor_seconds: of all processes, started again or not.
        killed: what was killed, in that order.
    """

    def __init__(self, file: Path, out: Path, tasks: int) -> None:
        with socket.socket() as found:
            found.bind(("127.0.0.1", 0))
            port = found.getsockname()[1]
        address, python = f"tcp://127.0.0.1:{port}", sys.executable
        scheduler = (python, "-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", str(port))
        worker = (python, "-m", "distributed.cli.dask_worker", address, "--nthreads", "1", "--no-dashboard")
        self._commands = {
            "scheduler": (*scheduler, "--no-dashboard"),
            "worker 1": (*worker, "--local-directory", str(file.parent / "one")),
            "worker 2": (*worker, "--local-directory", str(file.parent / "two")),
            "command": (python, "-m", "warpflat", "batch", str(file), "--out", str(out), "--scheduler", address, "-q"),
        }
        self._running: dict[str, subprocess.Popen[bytes]] = {}
        self._out, self._tasks = out, tasks
        self.seen = dict[str, set[int]]()
        self.memory, self.killed, self.started = 0, list[str](), 0
        self.processor_seconds = 0.0

    def run(self, moments: list[tuple[int, str]]) -> float:
        """Run the batch to its end and return its seconds."""
        ended = threading.Event()
        watcher = threading.Thread(target=self._watch, args=(ended,))
        for name in ("scheduler", "worker 1", "worker 2"):
            self._start(name)
        begun, before = time.perf_counter(), os.times()
        self._start("command")
        watcher.start()
        rng, left = random.Random(len(moments)), list(moments)
        try:
            while True:
                time.sleep(0.05)
                if left and len(self.seen) >= left[0][0]:
                    time.sleep(rng.uniform(0.0, 2.0))
                    self._kill(left.pop(0)[1], rng)
                code = self._running["command"].poll()
                if code is not None and code >= 0:
                    return time.perf_counter() - begun
                for name, process in list(self._running.items()):
                    if process.poll() is not None:
                        self._start(name)
        finally:
            ended.set()
            watcher.join()
            for process in self._running.values():
                # Children first: who has waited for them tells their processor time.
                for each in reversed(_family(process.pid)):
                    with suppress(psutil.NoSuchProcess):
                        each.terminate()
                        each.wait(10)
                process.wait()
            after = os.times()
            self.processor_seconds = sum(after[2:4]) - sum(before[2:4])

    def told(self) -> str:
        """Return what was killed."""
        return f"killed: {', '.join(self.killed) or 'nothing'}; the command was started {self.started} times"

    def _start(self, name: str) -> None:
        self.started += name == "command"
        self._running[name] = subprocess.Popen(
            self._commands[name],
            stdout=subprocess.DEVNULL,
            stderr=None if name == "command" else subprocess.DEVNULL,
            env=os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
        )

    def _kill(self, what: str, rng: random.Random) -> None:
        if what != "worker":
            self._running[what].kill()
            self.killed.append(f"{what} after {len(self.seen)}")
            return
        # A worker's own process is started by its nurse.
        processes = [each for name in ("worker 1", "worker 2") for each in _workers(self._running[name].pid)]
        if processes:
            with suppress(psutil.NoSuchProcess):
                rng.choice(processes).send_signal(signal.SIGKILL)
                self.killed.append(f"worker after {len(self.seen)}")

    def _watch(self, ended: threading.Event) -> None:
        while not ended.wait(0.1):
            for path in self._out.glob("*/metrics.json"):
                with suppress(FileNotFoundError):
                    self.seen.setdefault(path.parent.name, set()).add(path.stat().st_mtime_ns)
            for name in ("worker 1", "worker 2"):
                for each in _workers(self._running[name].pid):
                    with suppress(psutil.NoSuchProcess):
                        self.memory = max(self.memory, each.memory_info().rss)


def _family(pid: int) -> list[psutil.Process]:
    try:
        process = psutil.Process(pid)
        return [process, *process.children(recursive=True)]
    except psutil.NoSuchProcess:
        return []


def _workers(pid: int) -> list[psutil.Process]:
    """Return the processes in which a worker runs its tasks."""
    found = []
    for each in _family(pid)[1:]:
        with suppress(psutil.NoSuchProcess):
            if "spawn_main" in str(each.cmdline()):
                found.append(each)
    return found


def _memory(rows: list[Row]) -> str:
    return f"peak {max((row.memory_mb or 0 for row in rows), default=0):.0f} MB"


def _show_errors(rows: list[Row]) -> None:
    for row in rows:
        if row.message:
            print(f"  {row.task.key}: {row.status}: {row.message}")


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
