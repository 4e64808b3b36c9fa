"""Is there a lower minimum? Pieces are flattened from many starts, and the least admissible energy is compared with that of `flatten`.

    OMP_NUM_THREADS=1 python benchmarks/minima.py [FILES] [--only TEXT] [--fabric isotropic] [--model membrane]

A layout is admissible if it is at rest, mirrors no face, lies nowhere over itself and keeps the chord of its datum upright. Starts: the
development, the least-squares conformal map (with libigl), a harmonic map onto a disk, as-rigid iterations from these, and the layout of
`flatten` shaken smoothly, bent to either side, or swirled either way, each where it mirrors no face. Without files: 40 meshes, of the
folder WARPFLAT_DATA (or ../shared/data), patches of its bodies, torn garments, forms, split grids, and `overlap_family`.
"""

from __future__ import annotations

import argparse
import contextlib
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import warp as wp
from energy import LayoutEnergy
from overlap_family import FAMILY
from peers import Problem, lscm
from real import default_files

import warpflat
from warpflat.core.arrays import FloatArray, IntArray
from warpflat.core.errors import InputError
from warpflat.flat.flattening.develop import develop
from warpflat.flat.flattening.harmonic_layout import harmonic_layout
from warpflat.flat.flattening.result import Flattening
from warpflat.flat.surface.cells import make_cells
from warpflat.flat.surface.connectivity import components, non_manifold_vertices
from warpflat.flat.surface.io.read import read_scan, read_surface
from warpflat.flat.surface.laplacian import laplacian_of
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.repair.validate import make_surface
from warpflat.flat.surface.shapes import make_shape
from warpflat.flat.surface.triangles import triangulate
from warpflat.garment.mannequin.mannequin import Mannequin

_LOWER = 0.005
_BODIES = ("body_child", "body_female", "body_male", "body_male_heavy")
_FORMS = (("basic_block", "EU 36"), ("basic_block", "EU 44"), ("princess_dress", "EU 38"))


def part_of(vertices: FloatArray, faces: IntArray, name: str) -> Surface:
    """Return the largest connected part of some faces, without bow ties."""
    while True:
        part = components(faces)
        faces = faces[part == np.bincount(part).argmax()]
        tied = non_manifold_vertices(faces)
        if not len(tied):
            break
        faces = faces[~np.isin(faces, tied).any(axis=1)]
    used, faces_used = np.unique(faces), faces >= 0
    number = np.full(len(vertices) + 1, -1)
    number[used[used >= 0]] = np.arange((used >= 0).sum())
    return make_surface(vertices[used[used >= 0]], np.where(faces_used, number[faces], -1), name=name)


def _patch(file: Path, height: float, radius: float) -> Surface:
    """Return the faces of a body around its front at a share of its height."""
    points, faces = read_scan(file)
    low, high = points.min(axis=0), points.max(axis=0)
    at = np.array([0.5 * (low[0] + high[0]), low[1] + height * (high[1] - low[1]), high[2]])
    seed = int(np.linalg.norm((points - at) * [1.0, 1.0, 0.3], axis=1).argmin())
    near = np.linalg.norm(points - points[seed], axis=1) < radius
    return part_of(points, faces[near[faces].all(axis=1)], "patch")


def _torn(surface: Surface, seed: int, name: str) -> Surface:
    """Return a surface without the faces around some vertices: holes, and a torn border."""
    random = np.random.default_rng(seed)
    places = surface.vertices[random.choice(len(surface.vertices), 8, replace=False)]
    middle = surface.vertices[surface.faces[:, :3]].mean(axis=1)
    size = np.linalg.norm(np.ptp(surface.vertices, axis=0))
    near = np.linalg.norm(middle[:, None] - places, axis=2) < size * random.uniform(0.01, 0.05, 8)
    return part_of(surface.vertices, surface.faces[~near.any(axis=1)], name)


def meshes() -> Iterator[tuple[str, Callable[[], Surface]]]:
    """Yield 40 meshes by name."""
    files = {file.stem: file for file in default_files()}
    for stem, file in files.items():
        yield stem, lambda file=file: read_surface(file, units="m")
    for seed in range(2):
        for stem, file in list(files.items()):
            yield (
                f"{stem}, torn {seed}",
                lambda file=file, seed=seed: _torn(read_surface(file, units="m"), seed, "torn"),
            )
    folder = next(iter(files.values())).parent if files else Path()
    for body, height, radius in zip(_BODIES, (0.75, 0.72, 0.6, 0.55), (0.1, 0.12, 0.15, 0.2), strict=True):
        file = folder / f"{body}.obj"
        if file.is_file():
            yield (
                f"{body}, patch",
                lambda f=file, h=height, r=radius: _patch(f, h, r),
            )
    for form, size in _FORMS:
        pieces = Mannequin.from_size(size, resolution_mm=15.0).form(form).pieces
        for name in list(pieces)[:2]:
            yield f"{form} {size}, {name}", lambda piece=pieces[name]: piece.surface
    for other in (False, True):
        whole = make_shape("bodice", resolution=41)
        faces = triangulate(whole.faces, other_diagonal=other)[0]
        yield f"bodice, split {other}", lambda v=whole.vertices, f=faces: make_surface(v, f, name="split")
    back = make_shape("bodice", resolution=41)
    yield "bodice, wound back", lambda: make_surface(back.vertices, back.faces[:, ::-1].copy(), name="back")
    yield "saddle", lambda: make_shape("saddle", resolution=33, triangles=True)
    yield "hemisphere", lambda: make_shape("hemisphere", resolution=25, triangles=True)
    yield from FAMILY.items()


def starts(result: Flattening) -> Iterator[tuple[str, FloatArray]]:
    """Yield layouts to be relaxed from; some may mirror faces."""
    surface, own = result.surface, result.positions
    first = [("development", develop(surface, result.datum).positions), ("harmonic", harmonic_layout(surface))]
    problem = Problem(
        vertices=surface.vertices,
        triangles=triangulate(surface.faces)[0],
        corner=make_cells(surface).corner,
        energy=LayoutEnergy(result.network),
    )
    with contextlib.suppress(ImportError):
        first.append(("LSCM", lscm(problem)))
    yield from first
    if len(surface.vertices) <= 20_000:
        for name, layout in first:
            for _ in range(4):
                layout = laplacian_of(surface).as_rigid_step(layout)
            yield f"{name}, as-rigid", layout
    middle, size = own.mean(axis=0), float(np.linalg.norm(np.ptp(own, axis=0)))
    x, y = ((own - middle) / size).T
    random = np.random.default_rng(0)
    for number in range(2):
        wave, phase = random.normal(scale=6.0, size=(4, 2)), random.uniform(0.0, 2.0 * np.pi, (4, 2))
        shake = sum(np.sin(wave[k, 0] * x + wave[k, 1] * y)[:, None] * np.cos(phase[k]) for k in range(4))
        yield f"shaken {number}", own + 0.02 * size * shake
    for angle in (-1.5, 1.5):
        yield (
            f"bent {angle:+}",
            size * np.column_stack([(1 / angle + x) * np.cos(angle * y), (1 / angle + x) * np.sin(angle * y)]),
        )
        turn = angle * np.exp(-4.0 * (x**2 + y**2))
        yield (
            f"swirled {angle:+}",
            size * np.column_stack([x * np.cos(turn) - y * np.sin(turn), x * np.sin(turn) + y * np.cos(turn)]),
        )


def is_admissible(piece: Flattening) -> bool:
    """Return whether a layout is at rest, mirrors no face, lies nowhere over itself, and keeps its chord upright."""
    chord = piece.positions[piece.datum[-1]] - piece.positions[piece.datum[0]]
    upright = chord[1] > 0.0 and abs(chord[0]) <= 1e-3 * chord[1]
    return bool(piece.converged and not piece.flipped_faces and not piece.overlap and upright)


def search(surface: Surface, chosen: argparse.Namespace) -> tuple[Flattening, str, float, int]:
    """Return what `flatten` gives, the start of the lowest layout, its energy [J], and how many starts came to admissible ones."""
    options = {"fabric": chosen.fabric, "model": chosen.model, "device": "cpu"}
    result = warpflat.flatten(surface, **options)
    best, least, count = "flatten", result.stages[-1].model_energy_j, 0
    cells = make_cells(surface)
    for name, layout in starts(result):
        if not np.isfinite(layout).all() or cells.least_shares(layout).min() <= 0.0:
            continue
        try:
            other = warpflat.flatten(surface, datum=result.datum, start=layout, **options)
        except InputError:
            continue
        if not is_admissible(other):
            continue
        count += 1
        energy = other.stages[-1].model_energy_j
        if chosen.each:
            print(f"    {name:28} {1e3 * energy:12.6g} mJ", flush=True)
        if energy < least:
            best, least = name, energy
    return result, best, least, count


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="*", metavar="FILES")
    parser.add_argument("--units", default="m", help="of files that carry none")
    parser.add_argument("--only", default="", metavar="TEXT", help="meshes whose name contains it")
    parser.add_argument("--fabric", default="isotropic")
    parser.add_argument("--model", choices=["auto", "springs", "membrane"], default="auto")
    parser.add_argument("--each", action="store_true", help="also print the energy from each start")
    chosen = parser.parse_args()
    wp.config.quiet = True
    given = [(Path(f).stem, lambda f=f: read_surface(f, units=chosen.units)) for f in chosen.files]
    print(f"{'mesh':34} {'verts':>6} {'mJ':>11} {'least mJ':>11} {'lower %':>8} {'starts':>6} {'seconds':>8}  from")
    lower, total, worst, wrong = 0, 0, 0.0, 0
    for name, make in given or meshes():
        if chosen.only not in name:
            continue
        begun = time.process_time()
        try:
            surface = make()
            result, best, least, count = search(replace(surface, name="piece"), chosen)
        except InputError as error:
            print(f"{name[:34]:34} {error}", flush=True)
            continue
        energy = result.stages[-1].model_energy_j
        # Pieces that lie flat store rounding errors only.
        share = (energy - least) / energy if energy > 1e-9 else 0.0
        total, lower, worst = total + 1, lower + (share > _LOWER), max(worst, share)
        wrong += not is_admissible(result)
        print(
            f"{name[:34]:34} {len(surface.vertices):6,} {1e3 * energy:11.5g} {1e3 * least:11.5g} {100 * share:8.3f} {count:6d} "
            f"{time.process_time() - begun:8.1f}  {best}{'' if is_admissible(result) else '; flatten is not admissible'}",
            flush=True,
        )
    print(
        f"{total} meshes: {lower} with a lower minimum by more than {100 * _LOWER:g} %, at most {100 * worst:.2f} %; "
        f"{wrong} not admissible as flattened"
    )


if __name__ == "__main__":
    main()
