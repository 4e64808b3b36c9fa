"""Speed against the peers that install from a package index, in one process, on the same meshes, to the same energy.

    python benchmarks/speed.py [--sizes 2500 10000] [--shapes dome bodice] [--kinds grid irregular crack real] [--json FILE]

The energy is ours, springs and guard; the target is 0.1 % above the least that anybody reached without a mirrored cell. A row
says how long a solver took to that (`-`: never got there), with the energy, the length error and the mirrored cells of
its last iterate, and its best unfolded one where it folds later. benchmarks/README.md explains how to read it.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import platform
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp
from energy import LayoutEnergy
from machine import buffer_bytes, copy_speed, memory_of_flatten, step_bytes
from meshes import KINDS, Mesh, real_meshes
from numpy.typing import NDArray
from peers import (
    Clock,
    Problem,
    Solver,
    arap,
    choose_clock,
    fastest_factor,
    lbfgs,
    lscm,
    majorize_with,
    now,
    slim,
    turn_upright,
)

import warpflat
from warpflat.flat.flattening.progress import Progress
from warpflat.flat.flattening.result import Flattening
from warpflat.flat.model.strain import layout_errors
from warpflat.flat.surface.triangles import triangulate

FloatArray = NDArray[np.float64]

ALLOWANCE = 1.001
# Isotropic (G = K / 2 / (1 + nu)), so that no direction matters.
CLOTH = warpflat.Fabric(
    name="isotropic cloth",
    stiffness_warp=1000.0,
    stiffness_weft=1000.0,
    shear_stiffness=375.0,
    poisson_ratio=1.0 / 3.0,
    areal_density=0.15,
)
# Our solvers by name: what `warpflat.flatten` is called with beside the surface, the fabric and the datum.
OURS: dict[str, dict[str, Any]] = {
    "warpflat": {},
    "warpflat plain": {"relax": warpflat.RelaxOptions(solver="paper", max_steps=1_000_000)},
}
# Peers get no slower than this to be waited for, above which sizes.
_MOST_VERTICES = {"L-BFGS": 200_000, "SLIM": 200_000, "LSCM": 200_000, "warpflat plain": 50_000}


# A Warp device, and threads of the CPU if that is it.
Place = tuple[str, int | None]
# Energy [J], seconds since the beginning, and work units, as the callback sees them.
Look = tuple[float, float, float]


@dataclass(kw_only=True)
class Row:
    """A solver on a mesh.

    Attributes:
        start: what it starts from.
        start_seconds: what that took; 0 for us, whose own seconds hold it, and for our development when peers get it.
        seconds: to 0.1 % of the least energy; infinite if it did not get there.
        total_seconds: until it stopped.
        develop_seconds: ours. work_units: ours, to 0.1 %.
        energy, length_error, area_error, flips: at its best unfolded iterate if it has one, else at its last.
        folds: whether its last iterate has mirrored cells.
    """

    mesh: str
    vertices: int
    solver: str
    start: str = ""
    start_seconds: float = 0.0
    seconds: float = math.inf
    total_seconds: float = math.inf
    develop_seconds: float | None = None
    work_units: float | None = None
    energy: float = math.inf
    length_error: float = math.nan
    area_error: float = math.nan
    flips: int = -1
    folds: bool = False
    device: str = "cpu"
    threads: int | None = None
    memory_bytes: float | None = None
    bytes_per_second: float | None = None
    failure: str = ""

    @property
    def place(self) -> Place:
        """Where ours ran."""
        return self.device, self.threads


@dataclass(kw_only=True)
class Runner:
    """All solvers on one mesh."""

    mesh: Mesh
    repeats: int
    limit: float
    places: Sequence[Place]

    def rows(self, peers: Sequence[str], ours: Sequence[str]) -> list[Row]:
        """One for each solver and start, with the seconds to the common target."""
        size = len(self.mesh.surface.vertices)
        rows, flat = [], None
        for name in ours:
            for place in self.places:
                if size <= _MOST_VERTICES.get(name, 10**9):
                    row, flat = self._ours(name, place)
                    rows.append(row)
        if flat is None:
            flat = _developed_only(self.mesh)
        network = flat.network
        triangles, _ = triangulate(self.mesh.surface.faces)
        problem = Problem(
            vertices=self.mesh.surface.vertices,
            triangles=triangles,
            corner=network.cell_arrays.corner,
            energy=LayoutEnergy(network),
        )
        for row in rows:
            # One measure for everybody: our own energies were of the networks as built for each run.
            row.energy = problem.energy.value(self._layouts[row.solver, row.place])
        runs = self._peers(problem, flat, peers)
        target = ALLOWANCE * min(
            [row.energy for row in rows if row.flips == 0] + [clock.best_energy for _, clock in runs], default=math.inf
        )
        for row in rows:
            looks = self._looks[row.solver, row.place]
            # Its own energies may be of springs measured in another layout; what counts is its last, by the common measure.
            scale = row.energy / looks[-1][0]
            reached = [look for look in looks if scale * look[0] <= target]
            if row.flips == 0 and reached:
                _, row.seconds, row.work_units = reached[0]
        for row, clock in runs:
            row.seconds = clock.reached(target)
            rows.append(row)
        return rows

    def _ours(self, name: str, place: Place) -> tuple[Row, Flattening]:
        device, threads = place
        if threads is not None:
            os.environ["WARPFLAT_THREADS"] = str(threads)
        best: tuple[float, Flattening, list[Look]] | None = None
        for _ in range(self.repeats):
            looks: list[Look] = []
            # A surface of its own each time: nothing that the run before has worked out of it is given.
            surface = replace(self.mesh.surface, faces=self.mesh.surface.faces.copy())
            begun = now()

            def look(at: Progress, begun: float = begun, looks: list[Look] = looks) -> None:
                looks.append((at.model_energy_j, now() - begun, at.work_units))

            flat = warpflat.flatten(
                surface, fabric=CLOTH, datum=self.mesh.datum, device=device, callback=look, **OURS[name]
            )
            seconds = now() - begun
            if best is None or seconds < best[0]:
                best = seconds, flat, looks
        assert best is not None
        seconds, flat, looks = best
        last = flat.stages[-1]
        self._looks[name, place] = [*looks, (last.model_energy_j, seconds, last.work_units)]
        self._layouts[name, place] = flat.positions
        errors = layout_errors(flat.network.surface, flat.network, flat.positions)
        relaxing = sum(stage.seconds for stage in flat.stages if stage.name != "develop")
        units = sum(stage.work_units for stage in flat.stages)
        return (
            Row(
                mesh=self.mesh.name,
                vertices=len(self.mesh.surface.vertices),
                solver=name,
                start=flat.development.method,
                total_seconds=seconds,
                develop_seconds=sum(stage.seconds for stage in flat.stages if stage.name == "develop"),
                work_units=units,
                length_error=errors.length_error,
                area_error=errors.area_error,
                flips=errors.flipped_faces,
                folds=errors.flipped_faces > 0,
                device=device,
                threads=threads,
                memory_bytes=buffer_bytes(flat.network),
                bytes_per_second=step_bytes(flat.network) * units / max(relaxing, 1e-9),
                failure="" if flat.converged else "step limit",
            ),
            flat,
        )

    def _peers(self, problem: Problem, flat: Flattening, names: Sequence[str]) -> list[tuple[Row, Clock]]:
        size = problem.energy.count
        ours = flat.development.positions
        starts: dict[str, tuple[float, FloatArray]] = {"our development": (0.0, ours)}
        if size <= _MOST_VERTICES["LSCM"]:
            begun = now()
            try:
                conformal = lscm(problem)
                # Long quads are sheared along directions in the plane: it is to lie as ours does.
                starts["LSCM"] = (now() - begun, turn_upright(conformal, self.mesh.datum))
            except ImportError:
                pass
        runs = []
        for name in names:
            if size > _MOST_VERTICES.get(name, 10**9):
                continue
            solver, label = _PEERS[name], name
            if name == "majorize":
                factor = fastest_factor(problem)
                solver, label = majorize_with(factor), f"majorize ({factor})"
            for start, (seconds, layout) in starts.items():
                # A barrier cannot begin beyond it; the others may.
                if name in ("SLIM", "L-BFGS") and problem.mirrored(layout):
                    continue
                clock = self._best_of(solver, problem, layout, stall=200 if name == "L-BFGS" else 30)
                if clock.failure.startswith(("ImportError", "ModuleNotFoundError")):
                    continue
                runs.append((self._peer_row(label, start, seconds, clock, flat), clock))
        return runs

    def _best_of(self, solver: Solver, problem: Problem, start: FloatArray, stall: int) -> Clock:
        clocks = []
        for _ in range(self.repeats):
            clocks.append(Clock(problem=problem, limit=self.limit, stall=stall).run(solver, start))
            if clocks[-1].seconds > self.limit / 4:
                break
        return min(clocks, key=lambda clock: clock.seconds)

    def _peer_row(self, name: str, start: str, seconds: float, clock: Clock, flat: Flattening) -> Row:
        row = Row(
            mesh=self.mesh.name,
            vertices=len(self.mesh.surface.vertices),
            solver=name,
            start=start,
            start_seconds=seconds,
            total_seconds=clock.seconds,
            failure=clock.failure,
        )
        layout = clock.best if clock.best is not None else clock.last
        if layout is not None:
            errors = layout_errors(flat.network.surface, flat.network, layout)
            row.energy, row.folds = clock.best_energy, clock.history[-1][2] > 0
            row.length_error, row.area_error, row.flips = errors.length_error, errors.area_error, errors.flipped_faces
        return row

    def __post_init__(self) -> None:
        self._layouts: dict[tuple[str, Place], FloatArray] = {}
        self._looks: dict[tuple[str, Place], list[Look]] = {}


_PEERS: dict[str, Solver] = {"majorize": majorize_with("SuperLU"), "ARAP": arap, "SLIM": slim, "L-BFGS": lbfgs}


def _developed_only(mesh: Mesh) -> Flattening:
    """One step only: the network and the development for the peers where none of ours is run."""
    options = warpflat.RelaxOptions(max_steps=1)
    return warpflat.flatten(mesh.surface, fabric=CLOTH, datum=mesh.datum, device="cpu", relax=options)


def print_rows(rows: Sequence[Row]) -> None:
    """The rows of one mesh as a table; ratios are to the fastest of ours."""
    ours = min((row.seconds for row in rows if row.solver in OURS), default=math.inf)
    print(f"\n{rows[0].mesh}, {rows[0].vertices:,} vertices")
    head = (
        "solver",
        "start",
        "start s",
        "to 0.1 % s",
        "ratio",
        "+ start",
        "all s",
        "energy J",
        "length",
        "area",
        "flips",
    )
    print(
        f"{head[0]:22s} {head[1]:16s} {head[2]:>8s} {head[3]:>10s} {head[4]:>7s} {head[5]:>7s} {head[6]:>8s} "
        f"{head[7]:>11s} {head[8]:>7s} {head[9]:>7s} {head[10]:>6s}  notes"
    )
    for row in rows:
        name = row.solver
        if name in OURS:
            name += f", {row.device}" if row.threads is None else f", {row.threads} thr."
        notes = [row.failure] if row.failure else []
        if row.folds:
            notes.append("folds later" if row.flips == 0 else "folds")
        if row.work_units is not None:
            notes.append(f"{row.work_units:,.0f} work units, development {row.develop_seconds:.3f} s")
            notes.append(f"{1e9 * row.total_seconds / row.vertices:,.0f} ns a vertex")
            if row.bytes_per_second:
                notes.append(f"{row.bytes_per_second / 1e9:.1f} GB/s")
        ratio, whole = row.seconds / ours, (row.seconds + row.start_seconds) / ours
        print(
            f"{name:22s} {row.start:16s} {_seconds(row.start_seconds) if row.start_seconds else '':>8s} "
            f"{_seconds(row.seconds):>10s} {_times(ratio):>7s} {_times(whole):>7s} {_seconds(row.total_seconds):>8s} "
            f"{row.energy:11.5g} {100 * row.length_error:6.2f}% {100 * row.area_error:6.2f}% {row.flips:6d}  "
            + "; ".join(notes),
            flush=True,
        )


def _seconds(value: float) -> str:
    return f"{value:.3g}" if math.isfinite(value) else "-"


def _times(value: float) -> str:
    return f"{value:.2f}x" if math.isfinite(value) else "-"


def main(arguments: Sequence[str] | None = None) -> None:
    """Run what is asked for and print it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", type=int, nargs="+", default=[2_500, 10_000], metavar="VERTICES")
    parser.add_argument("--full", action="store_true", help="2,500 to 1,000,000 vertices")
    parser.add_argument("--shapes", nargs="+", choices=["dome", "bodice"], default=["dome", "bodice"])
    parser.add_argument("--kinds", nargs="+", choices=[*KINDS, "real"], default=[*KINDS, "real"])
    parser.add_argument("--solvers", nargs="*", choices=list(OURS), default=list(OURS), help="of ours")
    parser.add_argument("--peers", nargs="*", choices=list(_PEERS), default=list(_PEERS))
    parser.add_argument("--threads", type=int, nargs="+", default=None, help="numbers of threads to run ours with")
    parser.add_argument("--devices", nargs="+", default=["cpu"], help="of Warp, to run ours on, such as cpu cuda:0")
    parser.add_argument("--repeats", type=int, default=3, help="the fastest counts")
    parser.add_argument("--limit", type=float, default=60.0, help="seconds that a peer may take")
    parser.add_argument(
        "--clock", choices=["wall", "cpu"], default="wall", help="cpu: of all threads, on a busy machine"
    )
    parser.add_argument(
        "--memory", action="store_true", help="measure the peak memory of ours in processes of their own"
    )
    parser.add_argument("--json", type=Path, metavar="FILE")
    chosen = parser.parse_args(arguments)
    sizes = [2_500, 10_000, 40_000, 160_000, 640_000, 1_000_000] if chosen.full else chosen.sizes
    threads = chosen.threads or [len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()]

    choose_clock(chosen.clock)
    wp.config.quiet = True
    wp.init()
    speed = {count: copy_speed(count) for count in sorted({1, *threads})}
    print(
        f"{platform.processor() or platform.machine()}, {os.cpu_count()} cores; copy "
        + ", ".join(f"{value / 1e9:.1f} GB/s on {count} thread(s)" for count, value in speed.items())
    )
    makers: list[Callable[[], Mesh]] = [
        lambda shape=shape, kind=kind, size=size: KINDS[kind](shape, size)
        for size in sizes
        for kind in chosen.kinds
        if kind != "real"
        for shape in chosen.shapes
    ]
    if "real" in chosen.kinds:
        makers += [lambda mesh=mesh: mesh for mesh in real_meshes()]
    places: list[Place] = []
    for device in chosen.devices:
        places += [(device, count) for count in threads] if device == "cpu" else [(device, None)]
        if device != "cpu":
            print(f"{device}: {wp.get_device(device).name}")
    # Kernels are compiled and loaded before anything is timed.
    for warm in (KINDS[kind]("dome", 200) for kind in KINDS):
        for name in chosen.solvers:
            for device in chosen.devices:
                warpflat.flatten(warm.surface, fabric=CLOTH, datum=warm.datum, device=device, **OURS[name])
    every: list[Row] = []
    for make in makers:
        mesh = make()
        rows = Runner(mesh=mesh, repeats=chosen.repeats, limit=chosen.limit, places=places).rows(
            chosen.peers, chosen.solvers
        )
        if chosen.memory:
            for row in rows:
                if row.solver in OURS:
                    row.memory_bytes = memory_of_flatten(mesh, row.solver)
                    print(f"{row.solver}: {row.memory_bytes / row.vertices:,.0f} bytes a vertex at its peak")
        print_rows(rows)
        every += rows
        if chosen.json:
            result = {"copy_bytes_per_second": speed, "rows": [asdict(row) for row in every]}
            chosen.json.write_text(json.dumps(result, indent=1, default=float))


if __name__ == "__main__":
    main()
