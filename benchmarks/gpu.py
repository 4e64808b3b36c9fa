"""The same work on the CPU and on a GPU: kernels' tests, then seconds and energies of pieces, steps, blocks, seams and a drape.

    python benchmarks/gpu.py [--device cuda:0] [--sizes 40000 160000 1000000] [--blocks 1 32 256] [--skip-tests] [--skip-drape]
                             [--profile FOLDER] [--limit SECONDS] [--json FILE]

Every job runs small once on each device, as the first launch compiles, and is then timed in wall-clock seconds. A difference of energies is
relative to the CPU's; above 1e-4 it ends with 1. Of a drape it is the mean distance to the designed surface [m], as far as the cloth's rest
tells it: two CPUs of different make are a thousandth apart, and more than a hundredth ends with 1. `block` is the basic block of EU 38:
flattened and sewn; several are made at once, each by one of as many processes as there are cores, of one thread each, that share the
device. One is draped; `evaluated` is its energy where it was designed, 100 times. `200 steps` are the paper's, without what comes before
and after. What no kernel does stays on the host on any device: reading, development, the factor and its solutions (SciPy), topology,
drafting and files; `--profile` shows it, by a run of its own.
"""

from __future__ import annotations

import argparse
import cProfile
import io
import json
import multiprocessing
import os
import pstats
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import warp as wp
from meshes import KINDS, Mesh

import warpflat
from warpflat.core.compile import start_warp
from warpflat.flat.fabric.library import find_fabric
from warpflat.flat.flattening.develop import develop
from warpflat.flat.model.network import SpringNetwork
from warpflat.flat.solver.options import RelaxOptions
from warpflat.flat.solver.steps import Relaxation
from warpflat.garment.draping.body import Body
from warpflat.garment.draping.drape_energy import DrapeEnergy
from warpflat.garment.draping.options import DrapeOptions
from warpflat.garment.draping.sewn_cloth import sew_cloth

TOLERANCE, DRAPE_TOLERANCE = 1e-4, 1e-2
SMALL = 2_000


class Done(NamedTuple):
    """Seconds of a job, and its energy [J]."""

    seconds: float
    energy_j: float


class Job(NamedTuple):
    """What does a job on a device; whether to run it twice, as nothing smaller has run before; how many garments it makes; how far apart
    the energies may be."""

    name: str
    run: Callable[[str], Done]
    twice: bool = False
    garments: int = 0
    tolerance: float = TOLERANCE


def timed(work: Callable[[], float]) -> Done:
    """Do what returns an energy."""
    begun = time.perf_counter()
    energy = work()
    wp.synchronize()
    return Done(time.perf_counter() - begun, energy)


def flatten(mesh: Mesh, device: str) -> Done:
    """Flatten a mesh as if it were read anew: what was computed for a surface is not computed again."""
    surface = replace(mesh.surface, faces=mesh.surface.faces.copy())
    return timed(
        lambda: warpflat.flatten(surface, fabric="woven", datum=mesh.datum, device=device).stages[-1].model_energy_j
    )


def take_steps(mesh: Mesh, device: str) -> Done:
    """Take 200 of the paper's steps from the development."""
    assert mesh.datum is not None
    start = develop(mesh.surface, mesh.datum).positions
    network = SpringNetwork.build(mesh.surface, find_fabric("woven"), start, device=device)
    state = Relaxation(network, RelaxOptions(), start=start)

    def steps() -> float:
        for _ in range(200):
            state.step()
        return state.energies().potential

    steps()  # launches are recorded, and become graphs
    state.place(start)
    state.velocity.zero_()
    return timed(steps)


@cache
def basic_block() -> tuple[warpflat.Mannequin, Any]:
    """Return the body and its form, made once."""
    body = warpflat.Mannequin.from_size("EU 38", resolution_mm=10.0)
    return body, body.form("basic_block")


def block(device: str) -> float:
    """Flatten and sew one, and return its energy [J]."""
    body, form = basic_block()
    garment = warpflat.flatten_form(body, form, fabric="woven", device=device)
    return sum(piece.stages[-1].model_energy_j for piece in garment.pieces.values())


@cache
def garment_to_drape() -> warpflat.Garment:
    """Return one that was made on the CPU."""
    body, form = basic_block()
    return warpflat.flatten_form(body, form, fabric="woven", device="cpu")


def drape(device: str) -> Done:
    """Drape it."""
    return timed(lambda: warpflat.drape(garment_to_drape(), device=device).measures()["distance_m"]["mean"])


def evaluate_drape(device: str) -> Done:
    """Evaluate the energy and the forces of the drape 100 times where the cloth was designed."""
    cloth = sew_cloth(garment_to_drape())
    body = Body(cloth.designed, cloth.faces, device=wp.get_device(device))
    energy = DrapeEnergy(cloth, body, DrapeOptions(), np.zeros(len(cloth.designed), dtype=bool))
    energy.at(cloth.designed)
    return timed(lambda: [energy.at(cloth.designed).energy for _ in range(100)][-1])


def _begin(device: str, barrier: Any) -> None:
    """Make one block before the clock runs, in each process."""
    start_warp()
    block(device)
    barrier.wait()


@cache
def crowd(device: str, processes: int) -> Any:
    """Return processes that have each made a block on a device."""
    os.environ |= {"WARPFLAT_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    context = multiprocessing.get_context("spawn")
    barrier = context.Barrier(processes + 1)
    pool = context.Pool(processes, _begin, (device, barrier))
    barrier.wait()
    return pool


def blocks(count: int, device: str) -> Done:
    """Make so many at once."""
    if count == 1:
        return timed(lambda: block(device))
    pool = crowd(device, min(count, len(os.sched_getaffinity(0))))
    return timed(lambda: sum(pool.imap_unordered(block, [device] * count)))


def jobs(sizes: list[int], counts: list[int], *, draped: bool) -> Iterator[Job]:
    """Return the jobs, those first that take less."""
    for size in sizes:
        for kind in ("grid", "irregular"):
            mesh = KINDS[kind]("bodice", size)
            name = f"{kind} {len(mesh.surface.vertices):,}"
            yield Job(f"flatten {name}", partial(flatten, mesh))
            yield Job(f"200 steps, {name}", partial(take_steps, mesh))
    for count in counts:
        yield Job(
            f"block, sewn, x {count}",
            partial(blocks, count),
            twice=count == 1,
            garments=count,
        )
    if draped:
        yield Job("block, drape evaluated", evaluate_drape)
        yield Job("block, draped: mean distance", drape, tolerance=DRAPE_TOLERANCE)


def _late(*_: object) -> None:
    raise TimeoutError


def run_job(job: Job, device: str, limit: int) -> Done | None:
    """Run a job, and return None where it takes longer than a limit [s]."""
    signal.alarm(limit)
    try:
        return (job.run(device), job.run(device))[1] if job.twice else job.run(device)
    except TimeoutError:
        return None
    finally:
        signal.alarm(0)


def profile(job: Job, device: str, folder: Path) -> None:
    """Write where the host spends the time of a job, Warp's calls and the waiting in them included, into a file."""
    profiler, text = cProfile.Profile(), io.StringIO()
    profiler.enable()
    done = job.run(device)
    profiler.disable()
    pstats.Stats(profiler, stream=text).sort_stats("tottime").print_stats(40)
    lines = [line for line in text.getvalue().splitlines() if line.strip()]
    name = "".join(each if each.isalnum() else "_" for each in job.name)
    (folder / f"{name}.txt").write_text(
        f"{job.name} on {device}: {done.seconds:.2f} s timed\n" + "\n".join(lines) + "\n"
    )


def main() -> int:
    """Run the tests, then the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", default="cuda:0", help="of Warp, beside the CPU")
    parser.add_argument("--sizes", type=int, nargs="*", default=[40_000, 160_000, 1_000_000])
    parser.add_argument("--blocks", type=int, nargs="*", default=[1, 32, 256])
    parser.add_argument("--skip-tests", action="store_true")
    parser.add_argument("--skip-drape", action="store_true")
    parser.add_argument("--profile", type=Path, help="folder for a profile of each job, run once more on the device")
    parser.add_argument("--limit", type=int, default=3600, help="seconds for a job on one device")
    parser.add_argument("--json", type=Path)
    chosen = parser.parse_args()
    wp.config.log_level = wp.LOG_WARNING
    start_warp()
    if chosen.device not in [str(device) for device in wp.get_devices()]:
        print(f"no device {chosen.device!r} here; there are {', '.join(map(str, wp.get_devices()))}", file=sys.stderr)
        return 2
    signal.signal(signal.SIGALRM, _late)
    root = Path(__file__).resolve().parent.parent
    commit = subprocess.run(["git", "describe", "--always", "--dirty"], cwd=root, capture_output=True, text=True)
    print(
        f"{wp.get_device(chosen.device).name}, {len(os.sched_getaffinity(0))} cores, Warp {wp.__version__}, "
        f"commit {commit.stdout.strip() or 'unknown'}"
    )
    failed = 0
    if not chosen.skip_tests:
        environment = os.environ | {"WARPFLAT_TEST_DEVICE": chosen.device}
        command = [sys.executable, "-m", "pytest", "-q", "-p", "no:xdist", "tests/kernels", "tests/flat/solver"]
        failed = subprocess.run(command, cwd=root, env=environment).returncode
    rows = []
    for device in ("cpu", chosen.device):
        for job in jobs([SMALL] if chosen.sizes else [], [], draped=False):
            job.run(device)
    print(f"{'':32} {'CPU [s]':>9} {'device [s]':>11} {'ratio':>6} {'energy [J]':>12} {'apart':>8} {'a minute':>9}")
    for job in jobs(chosen.sizes, chosen.blocks, draped=not chosen.skip_drape):
        on_cpu, on_device = (run_job(job, device, chosen.limit) for device in ("cpu", chosen.device))
        row: dict[str, Any] = {
            "job": job.name,
            "cpu": on_cpu and on_cpu._asdict(),
            "device": on_device and on_device._asdict(),
        }
        seconds = [f"{done.seconds:.2f}" if done else f"> {chosen.limit}" for done in (on_cpu, on_device)]
        line = f"{job.name:32} {seconds[0]:>9} {seconds[1]:>11}"
        if on_cpu and on_device:
            row["apart"] = apart = abs(on_device.energy_j / on_cpu.energy_j - 1.0)
            failed |= apart > job.tolerance
            line += f" {on_cpu.seconds / on_device.seconds:6.2f} {on_cpu.energy_j:12.6g} {apart:8.1e}"
        if job.garments and on_device:
            line += f" {60.0 * job.garments / on_device.seconds:9.1f}"
        print(line, flush=True)
        if chosen.profile and on_device and job.garments <= 1:
            chosen.profile.mkdir(parents=True, exist_ok=True)
            profile(job, chosen.device, chosen.profile)
        rows.append(row)
        if chosen.json:
            chosen.json.write_text(json.dumps(rows, indent=1) + "\n")
    return int(bool(failed))


if __name__ == "__main__":
    sys.exit(main())
