"""Speed on other people's meshes: `flatten` beside LSCM, and ARAP and SLIM with it as their start, each mesh in a process of its own.

    python benchmarks/real.py [FILES or FOLDER] [--units m] [--fabric isotropic] [--repeats 3] [--json FILE]
        [--bff PROGRAM] [--blender PYTHON]

Without files: the meshes of WARPFLAT_DATA (or ../shared/data), a bodice's grid, wound the other way and split along either diagonal, and
front bodices of two sizes. Of a USD file whose texture is its sewn pattern every panel is a mesh; `--public` takes the twelve pieces of
WARPFLAT_DATA, three meshes and the panels of two such files. Seconds of `flatten` from a surface in memory, datum and checks included,
until the energy is within 0.1 % of where it ends, until no vertex is 0.1 mm from where it ends, and to the end. ARAP and SLIM start from
LSCM, which is in their seconds, and end when their own energy changes by less than 1e-4. `--bff` is a program that is called as
boundary-first-flattening's `bff-command-line IN.obj OUT.obj`, `--blender` a Python with `bpy` (its minimum stretch, 50 iterations); xatlas
is run where it is installed, and cuts pieces into charts. Layouts without a size are scaled to the surface's area. Length error (of all
edges, and at 95 % of them), strain energy of the fabric, flipped faces and overlap are those of the last layouts; a ratio is a peer's
seconds over those of `flatten` to the end. Peers that are not installed are left out.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp
from energy import LayoutEnergy
from peers import Clock, Problem, Solver, arap, bff, blender, choose_clock, lscm, now, slim, turn_upright, xatlas

import warpflat
from warpflat.core.arrays import FloatArray
from warpflat.flat.flattening.progress import Progress
from warpflat.flat.flattening.result import Flattening
from warpflat.flat.model.strain import layout_errors, strain_energy
from warpflat.flat.solver.options import RelaxOptions
from warpflat.flat.solver.steps import Relaxation
from warpflat.flat.surface.half_edges import half_edges_of
from warpflat.flat.surface.injective import overlap_area
from warpflat.flat.surface.io.read import read_surface
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.repair.validate import make_surface
from warpflat.flat.surface.shapes import bodice
from warpflat.flat.surface.triangles import triangulate
from warpflat.garment.construction.sewn_panels import read_sewn_panels
from warpflat.garment.mannequin.mannequin import Mannequin

_NEAR_ENERGY, _NEAR_OUTLINE = 1e-3, 1e-4
_SIZES = ("EU 36", "EU 44")
_SECONDS = 120.0


def _conformal(problem: Problem, start: FloatArray, clock: Clock) -> None:
    """Leave the start, LSCM, as it is."""
    clock.look(start)


_PEERS: dict[str, Solver] = {"LSCM": _conformal, "ARAP": arap, "SLIM": slim}


def _grid(change: Callable[[Surface], Any]) -> Surface:
    whole = bodice(resolution=101)
    return make_surface(whole.vertices, change(whole), lines=dict(whole.lines), name="bodice")


def _wound_back(surface: Surface) -> Any:
    return np.ascontiguousarray(surface.faces[:, ::-1])


#: Surfaces that need no file, by name.
MADE: dict[str, Callable[[], Surface]] = {
    "bodice grid": lambda: _grid(lambda whole: whole.faces),
    "bodice grid, wound back": lambda: _grid(_wound_back),
    "bodice split 0-2": lambda: _grid(lambda whole: triangulate(whole.faces)[0]),
    "bodice split 1-3": lambda: _grid(lambda whole: triangulate(whole.faces, other_diagonal=True)[0]),
} | {
    f"front bodice {size}": lambda size=size: (
        Mannequin.from_size(size, resolution_mm=10.0).form("basic_block").pieces["front_bodice"].surface
    )
    for size in _SIZES
}


def data_folder() -> Path:
    """Return the folder of real meshes."""
    return Path(os.environ.get("WARPFLAT_DATA", Path(__file__).parents[2] / "shared" / "data"))


def default_files(folder: Path | None = None) -> list[Path]:
    """Return the garment meshes of a folder, the data folder if not given; bodies are closed, and no pieces."""
    return sorted(file for file in (folder or data_folder()).glob("*.obj") if not file.stem.startswith("body_"))


def meshes_of(given: Path) -> list[str]:
    """Return a file or one panel of a USD file (FILE#PANEL), all panels of such a file, or the meshes of a folder."""
    if given.is_dir():
        return [*map(str, default_files(given))]
    if given.suffix.startswith(".usd") and "#" not in given.name:
        return [f"{given}#{panel.surface.name}" for panel in read_sewn_panels(given)]
    return [str(given)]


def public_pieces() -> list[str]:
    """Return the twelve pieces of the data folder that others have published: three meshes, five panels of a T-shirt, four of a skirt."""
    folder = data_folder()
    worn = [folder / "garments" / name for name in ("Female_T_Shirt.usd", "Women_Skirt.usd")]
    return [mesh for each in (folder, *worn) for mesh in meshes_of(each)]


def _surface(mesh: str, units: str) -> Surface:
    if mesh in MADE:
        return MADE[mesh]()
    file, _, panel = mesh.partition("#")
    if not panel:
        return read_surface(mesh, units=units)
    return next(each.surface for each in read_sewn_panels(Path(file)) if each.surface.name == panel)


def _fresh(surface: Surface) -> Surface:
    """Return the surface as if it had just been read: nothing is known of it yet."""
    return replace(surface, vertices=surface.vertices.copy(), faces=surface.faces.copy(), of_faces={})


def _ours(surface: Surface, fabric: str, repeats: int) -> tuple[dict[str, Any], Flattening]:
    """Time `flatten`; the run that is watched is another one, whose clock stands while it is looked at."""
    warpflat.flatten(_fresh(surface), fabric=fabric, device="cpu")
    taken = []
    for _ in range(repeats):
        fresh, begun = _fresh(surface), now()
        result = warpflat.flatten(fresh, fabric=fabric, device="cpu")
        taken.append(now() - begun)
    looks: list[tuple[float, FloatArray]] = []
    paused = 0.0

    def look(at: Progress) -> None:
        nonlocal paused
        arrived = now()
        looks.append((arrived - begun - paused, at.positions()))
        paused += now() - arrived

    fresh, begun = _fresh(surface), now()
    watched = warpflat.flatten(fresh, fabric=fabric, device="cpu", callback=look)
    total = now() - begun - paused
    looks.append((total, watched.positions))
    state = Relaxation(watched.network, RelaxOptions(), start=watched.positions)

    def energy(positions: FloatArray) -> float:
        state.position.assign(positions)
        value = float(state.energies().potential)
        return value if math.isfinite(value) else math.inf

    end = energy(watched.positions)

    def within(near: Callable[[FloatArray], bool]) -> float:
        """Return when it came near to stay, in seconds of the fastest run."""
        since = total
        for seconds, positions in reversed(looks):
            if not near(positions):
                break
            since = seconds
        return since * min(taken) / total

    def moved(positions: FloatArray) -> float:
        way = positions - watched.positions
        return float(np.linalg.norm(way - way.mean(axis=0), axis=1).max())

    row = _measures(watched, watched.positions) | {
        "solver": "flatten",
        "start": watched.start,
        "near_energy_s": within(lambda positions: energy(positions) <= (1.0 + _NEAR_ENERGY) * end),
        "near_outline_s": within(lambda positions: moved(positions) <= _NEAR_OUTLINE),
        "seconds": min(taken),
        "model_energy_j": end,
        "converged": result.converged,
        "stages": [stage.as_dict() for stage in watched.stages],
    }
    return row, watched


def _measures(result: Flattening, positions: FloatArray) -> dict[str, Any]:
    """Measure a layout as cloth of the result's network."""
    surface = result.network.surface
    errors = layout_errors(surface, result.network, positions)
    ends = half_edges_of(surface).edges.T
    flat, worn = (np.linalg.norm(at[ends[1]] - at[ends[0]], axis=1) for at in (positions, surface.vertices))
    return {
        "length_error": errors.length_error,
        "length_error_95": float(np.percentile(np.abs(flat / worn - 1.0), 95)),
        "strain_energy_j": strain_energy(result.network, positions),
        "flips": errors.flipped_faces,
        "overlap_mm2": 1e6 * overlap_area(result.network.surface, positions, np.empty(0, dtype=np.int32)),
    }


def _problem(result: Flattening) -> Problem:
    surface = result.network.surface
    return Problem(
        vertices=surface.vertices,
        triangles=triangulate(surface.faces)[0],
        corner=result.network.cell_arrays.corner,
        energy=LayoutEnergy(result.network),
    )


def _peer(name: str, result: Flattening, repeats: int) -> dict[str, Any]:
    problem, taken = _problem(result), []
    for _ in range(repeats):
        begun = now()
        start = lscm(problem)
        starting = now() - begun
        clock = Clock(problem=problem, limit=_SECONDS, stall=10_000).run(_PEERS[name], start)
        taken.append(starting + clock.seconds)
    if clock.last is None:
        return {"solver": name, "failure": clock.failure}
    row = _measures(result, turn_upright(clock.last, result.datum))
    return row | {"solver": name, "start": "LSCM", "seconds": min(taken), "failure": clock.failure}


def _program(name: str, result: Flattening, run: Callable[[Problem], tuple[FloatArray, float]]) -> dict[str, Any]:
    """Measure the layout of a program that shows no iterate."""
    try:
        layout, seconds = run(_problem(result))
    except (OSError, RuntimeError, subprocess.CalledProcessError) as error:
        told = getattr(error, "stderr", b"") or str(error).encode()
        return {"solver": name, "failure": told.decode(errors="replace").strip().splitlines()[-1]}
    return _measures(result, turn_upright(layout, result.datum)) | {"solver": name, "start": "", "seconds": seconds}


def _charts(result: Flattening) -> dict[str, Any]:
    """Measure xatlas, which cuts a piece into charts: the lengths of their triangles' sides, and no more."""
    try:
        charts, worn, flat, seconds = xatlas(_problem(result))
    except ImportError:
        return {"solver": "xatlas", "failure": "xatlas is not installed"}
    change = np.abs(flat - worn)
    return {
        "solver": "xatlas",
        "start": f"{charts} charts",
        "seconds": seconds,
        "charts": charts,
        "length_error": float(change.sum() / worn.sum()),
        "length_error_95": float(np.percentile(change / worn, 95)),
    }


def measure(mesh: str, chosen: argparse.Namespace) -> list[dict[str, Any]]:
    """Measure a mesh, a name of `MADE`, a file or a panel of one, in this process."""
    surface = _surface(mesh, chosen.units)
    row, result = _ours(surface, chosen.fabric, chosen.repeats)
    rows = [row]
    for name in _PEERS:
        try:
            rows.append(_peer(name, result, chosen.repeats))
        except ImportError:
            rows.append({"solver": name, "failure": "libigl is not installed"})
    if chosen.bff:
        rows.append(_program("BFF", result, lambda problem: bff(problem, chosen.bff)))
    if chosen.blender:
        rows.append(_program("Blender", result, lambda problem: blender(problem, chosen.blender)))
    rows.append(_charts(result))
    return [{"mesh": Path(mesh).name.rpartition("#")[2], "vertices": len(surface.vertices), **each} for each in rows]


def _line(row: dict[str, Any], ours: float) -> str:
    head = f"{row['mesh'][:26]:26} {row['vertices']:7,} {row['solver']:8}"
    if "seconds" not in row:
        return f"{head} {row['failure']}"
    near = [f"{row[key]:8.3f}" if key in row else f"{'':8}" for key in ("near_energy_s", "near_outline_s")]
    if "flips" in row:
        cloth = f"{1e3 * row['strain_energy_j']:10.2f} {row['flips']:6d} {row['overlap_mm2']:9.3g}"
    else:
        cloth = f"{'':10} {'':6} {'':9}"
    return (
        f"{head} {' '.join(near)} {row['seconds']:8.3f} {100 * row['length_error']:8.2f} {100 * row['length_error_95']:8.2f} "
        f"{cloth} {row['seconds'] / ours:7.2f}  {row['start']}"
    )


def main() -> None:
    """Print the table, mesh by mesh."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("meshes", nargs="*", metavar="FILE or FOLDER", help="mesh files, or folders of OBJ files")
    parser.add_argument("--units", default="m", help="of files that carry none")
    parser.add_argument("--fabric", default="isotropic")
    parser.add_argument("--repeats", type=int, default=3, help="the fastest counts")
    parser.add_argument("--clock", choices=["wall", "cpu"], default="wall", help="cpu: for a machine that is not idle")
    parser.add_argument("--json", type=Path, metavar="FILE", help="the same figures, and the stages, as data")
    parser.add_argument("--public", action="store_true", help="the twelve public pieces of WARPFLAT_DATA")
    parser.add_argument("--bff", metavar="PROGRAM", help="boundary first flattening")
    parser.add_argument("--blender", metavar="PYTHON", help="a Python with bpy")
    parser.add_argument("--one", metavar="MESH", help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    choose_clock(chosen.clock)
    if chosen.one:
        wp.config.quiet = True
        print(json.dumps(measure(chosen.one, chosen)))
        return
    meshes = [mesh for given in chosen.meshes for mesh in meshes_of(Path(given))]
    meshes += public_pieces() if chosen.public else []
    meshes = meshes or [*meshes_of(data_folder()), *MADE]
    print(
        f"{'mesh':26} {'verts':>7} {'solver':8} {'0.1 % s':>8} {'0.1 mm s':>8} {'end s':>8} {'length %':>8} {'at 95 %':>8} "
        f"{'strain mJ':>10} {'flips':>6} {'over mm2':>9} {'ratio':>7}  start"
    )
    found, begun = [], time.perf_counter()
    options = [
        "--units",
        chosen.units,
        "--fabric",
        chosen.fabric,
        "--repeats",
        str(chosen.repeats),
        "--clock",
        chosen.clock,
    ]
    for name in ("bff", "blender"):
        options += [f"--{name}", value] if (value := getattr(chosen, name)) else []
    for mesh in meshes:
        run = subprocess.run([sys.executable, __file__, "--one", mesh, *options], capture_output=True, text=True)
        if run.returncode:
            print(f"{Path(mesh).name[:26]:26} failed: {run.stderr.strip().splitlines()[-1]}", flush=True)
            continue
        rows = json.loads(run.stdout.splitlines()[-1])
        found += rows
        for row in rows:
            print(_line(row, rows[0]["seconds"]), flush=True)
        if chosen.json:
            chosen.json.write_text(json.dumps(found, indent=1), encoding="utf-8")
    ratios = [
        row["seconds"] / ours["seconds"]
        for ours in found
        if ours["solver"] == "flatten"
        for row in found
        if row["mesh"] == ours["mesh"] and row["solver"] == "ARAP" and "seconds" in row
    ]
    if ratios:
        behind = sum(ratio < 1.0 for ratio in ratios)
        print(
            f"ARAP with its start over flatten: {min(ratios):.2f} to {max(ratios):.2f}; below 1 on {behind} of {len(ratios)} meshes"
        )
    print(f"{time.perf_counter() - begun:.0f} s")


if __name__ == "__main__":
    main()
