"""The stop of a relaxation: what it says is left, beside what a run ten times as long still finds, and the time that it took too long.

    OMP_NUM_THREADS=1 python benchmarks/stopping.py [FILES] [--units m] [--fabrics isotropic cotton wool-plain] [--repeats 2]

Without files: forms of two sizes in six fabrics, split and irregular grids, a crack, discs of the bodies in WARPFLAT_DATA. None of them
served to choose the estimate's factors.

`left` is what the last stage of `flatten` says in `metrics.json`. `found` is what the same run, ten times as long, still releases of the
energy, and how far it moves the outline; directions of springs are measured anew all the while. `over` tells which of both was not bounded.
`ratio` is the processor time of `flatten` over that after which energy and outline were within their tolerances for good. Pieces that
multigrid has relaxed have no estimate and are left out.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import chain
from pathlib import Path

import numpy as np
import warp as wp
from meshes import KINDS
from peers import choose_clock, now
from real import default_files

import warpflat
from warpflat.core.arrays import FloatArray
from warpflat.flat.flattening.progress import Progress
from warpflat.flat.solver.options import RelaxOptions
from warpflat.flat.solver.steps import Relaxation
from warpflat.flat.surface.connectivity import border_of, components
from warpflat.flat.surface.io.read import read_scan, read_surface
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.repair.validate import make_surface
from warpflat.flat.surface.shapes import make_shape
from warpflat.flat.surface.triangles import triangulate
from warpflat.garment.mannequin.mannequin import Mannequin

_FABRICS = ("isotropic", "cotton", "ponte", "satin", "wool-suiting", "silk")
_LONGER = 10
_RADIUS = 0.13


def forms() -> Iterator[tuple[str, Surface, str]]:
    """Return pieces of forms, some as quads and some split, each in one of the fabrics in turn."""
    sized = [
        (Mannequin.from_size(size, resolution_mm=8.5), form)
        for size in ("EU 44", "UK 10")
        for form in ("dress", "skirt")
    ]
    sized += [
        (Mannequin.from_size("US 12", resolution_mm=10.0), "bodice"),
        (Mannequin.from_size("men 48", resolution_mm=12.0), "trousers"),
    ]
    number = 0
    for mannequin, form in sized:
        for name, piece in mannequin.form(form).pieces.items():
            whole = piece.surface
            split = make_surface(whole.vertices, triangulate(whole.faces)[0], name=whole.name)
            yield f"{form} {name}", split if number % 2 else whole, _FABRICS[number % len(_FABRICS)]
            number += 1


def others(fabrics: tuple[str, ...]) -> Iterator[tuple[str, Surface, str]]:
    """Return split and irregular grids, cracks, and discs of bodies."""
    for fabric in fabrics:
        saddle = make_shape("saddle", resolution=53)
        yield "saddle, split", make_surface(saddle.vertices, triangulate(saddle.faces)[0], name="saddle"), fabric
        for kind, shape, size in (
            ("irregular", "dome", 3_000),
            ("irregular", "bodice", 3_800),
            ("crack", "bodice", 2_400),
        ):
            whole = KINDS[kind](shape, size).surface
            split = make_surface(whole.vertices, triangulate(whole.faces)[0], name=whole.name)
            yield f"{shape}, {kind}", split, fabric
        for file in sorted(default_files()[0].parent.glob("body_*.obj")):
            yield file.stem, disc(file), fabric


def disc(file: Path) -> Surface:
    """Return the part of a body around the point of its trunk that lies farthest to the front."""
    vertices, faces = read_scan(file)
    vertices = 1.7 * vertices / np.ptp(vertices[:, 1])
    height = (vertices[:, 1] - vertices[:, 1].min()) / 1.7
    middle = np.flatnonzero((height > 0.55) & (height < 0.8) & (np.abs(vertices[:, 0] - vertices[:, 0].mean()) < 0.12))
    centre = vertices[middle[np.argmax(vertices[middle, 2])]]
    near = np.linalg.norm(vertices - centre, axis=1) < _RADIUS
    kept = faces[near[faces].all(axis=1)]
    label = components(kept)
    kept = kept[label == np.bincount(label).argmax()]
    own, corners = np.unique(kept, return_inverse=True)
    return make_surface(vertices[own], corners.reshape(kept.shape), name=file.stem)


def _fresh(surface: Surface) -> Surface:
    return replace(surface, vertices=surface.vertices.copy(), faces=surface.faces.copy(), of_faces={})


def _later(surface: Surface, fabric: str, work_units: float) -> tuple[Relaxation, FloatArray]:
    """Return the layout of the same run after so much work, and a relaxation that measures energies of layouts with its network."""
    options = RelaxOptions(
        energy_left=0.0, energy_tolerance=0.0, residual_tolerance=1e-12, max_steps=int(work_units), gap_mm=0.0
    )
    result = warpflat.flatten(_fresh(surface), fabric=fabric, device="cpu", relax=options)
    return Relaxation(result.network, options, start=result.positions), result.positions


def measure(name: str, surface: Surface, fabric: str, repeats: int) -> tuple[bool, float] | None:
    """Print a row; return whether the estimate bounds what was found, and the ratio of the times."""
    looks: list[tuple[float, FloatArray]] = []
    seconds, paused, result = math.inf, 0.0, warpflat.flatten(_fresh(surface), fabric=fabric, device="cpu")
    for _ in range(repeats):
        fresh, begun = _fresh(surface), now()
        result = warpflat.flatten(fresh, fabric=fabric, device="cpu")
        seconds = min(seconds, now() - begun)

    def look(at: Progress) -> None:
        nonlocal paused
        arrived = now()
        looks.append((arrived - begun - paused, at.positions()))
        paused += now() - arrived

    fresh, begun = _fresh(surface), now()
    warpflat.flatten(fresh, fabric=fabric, device="cpu", callback=look)
    total, stage = now() - begun - paused, next(stage for stage in result.stages if stage.name == "relax")
    if stage.left is None:
        return None
    looks.append((total, result.positions))
    state, end = _later(surface, fabric, _LONGER * max(stage.work_units, 70.0))
    border, options = border_of(surface), RelaxOptions()

    def energy(positions: FloatArray) -> float:
        state.position.assign(positions)
        value = float(state.energies().potential)
        return value if math.isfinite(value) else math.inf

    def moved(positions: FloatArray) -> float:
        way = positions[border] - end[border]
        return 1e3 * float(np.linalg.norm(way - way.mean(axis=0), axis=1).max())

    least, since = energy(end), math.inf
    for at, positions in reversed(looks):
        if energy(positions) > (1.0 + options.energy_left) * least or moved(positions) > options.outline_left_mm:
            break
        since = at
    found = energy(result.positions) / least - 1.0, moved(result.positions)
    over = ("energy " * (found[0] > stage.left.energy_share) + "outline" * (found[1] > stage.left.outline_mm)).strip()
    ratio = total / since
    print(
        f"{name[:26]:26} {fabric:10} {len(surface.vertices):7,} {100 * stage.left.energy_share:8.3f} {100 * found[0]:8.4f} "
        f"{stage.left.outline_mm:8.3f} {found[1]:8.3f} {seconds:8.3f} {stage.steps:6d} {ratio:6.2f}  {over}",
        flush=True,
    )
    return not over, ratio


def main() -> None:
    """Print the table, and the sums."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="*", type=Path, metavar="FILE")
    parser.add_argument("--units", default="m", help="of files that carry none")
    parser.add_argument("--fabrics", nargs="+", default=["isotropic", "cotton", "wool-plain"])
    parser.add_argument("--repeats", type=int, default=2, help="the fastest counts")
    chosen = parser.parse_args()
    choose_clock("cpu")
    wp.config.quiet = True
    print(
        f"{'mesh':26} {'fabric':10} {'verts':>7} {'left %':>8} {'found %':>8} {'left mm':>8} {'found mm':>8} {'end s':>8} {'steps':>6} "
        f"{'ratio':>6}  over"
    )
    given = (
        (file.name, read_surface(file, units=chosen.units), fabric)
        for file in chosen.files
        for fabric in chosen.fabrics
    )
    rows = [
        measure(*mesh, chosen.repeats)
        for mesh in (given if chosen.files else chain(forms(), others(tuple(chosen.fabrics))))
    ]
    found = [row for row in rows if row is not None]
    ratios = np.array([ratio for _, ratio in found if math.isfinite(ratio)])
    print(
        f"{sum(bound for bound, _ in found)} of {len(found)} bounded; ratio of the times {np.median(ratios):.2f} in the median, at most "
        f"{ratios.max():.2f}, above 1.3 on {(ratios > 1.3).sum()}"
    )


if __name__ == "__main__":
    main()
