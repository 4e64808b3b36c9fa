"""Patterns recovered from draped shapes: a sheet hung at three points and a circle skirt, draped on one mesh, found on another.

    python benchmarks/drape_inverse.py [--newton]

The second mesh is given the draped shape and a wrong pattern: 3 % too wide, 2 % too short, sheared by 3 %. With `--newton` the sheet
is draped by NVIDIA Newton, too (extra `referee`). Millimetres; the pattern after the best rigid motion, and where the found one
comes to rest from the given shape. Asked for: the pattern within 0.5 mm on the mean.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import warp as wp
from drape_referee import newton_drape
from scipy.interpolate import RegularGridInterpolator

from warpflat.flat.fabric.library import find_fabric
from warpflat.garment.draping.options import DrapeOptions
from warpflat.garment.draping.recover_pattern import recover_cloth
from warpflat.garment.draping.relax_drape import relax_drape
from warpflat.garment.draping.sewn_cloth import SewnCloth

OPTIONS = DrapeOptions(tolerance=2e-3, max_steps=8000)
Place = Callable[[np.ndarray, np.ndarray], np.ndarray]


def cloth_of(flat: Place, space: Place, rows: int, columns: int, closed: bool) -> SewnCloth:
    """A grid over the unit square, its first and last column sewn together if it is closed."""
    v, u = (each.ravel() for each in np.meshgrid(np.linspace(0, 1, rows), np.linspace(0, 1, columns), indexing="ij"))
    i = np.arange(rows * columns, dtype=np.int32).reshape(rows, columns)
    faces = np.stack([i[:-1, :-1], i[:-1, 1:], i[1:, 1:], i[1:, :-1]], axis=-1).reshape(-1, 4)
    sewn = i.copy()
    if closed:
        sewn[:, -1] = sewn[:, 0]
    _, first, welded = np.unique(sewn.ravel(), return_index=True, return_inverse=True)
    welded = welded.astype(np.int32)
    return SewnCloth(
        fabric=find_fabric("woven"), designed=space(u, v)[first], faces=welded[faces], flat_faces=faces, flat=flat(u, v),
        welded=welded, warp=np.tile([0.0, 1.0], (len(faces), 1)), weft=np.tile([1.0, 0.0], (len(faces), 1)),
        piece_faces={"piece": slice(0, len(faces))}, piece_vertices={"piece": slice(0, rows * columns)}, lines={},
    )  # fmt: skip


def apart(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Distances [mm] after the best rigid motion."""
    p, q = p - p.mean(axis=0), q - q.mean(axis=0)
    u, _, v = np.linalg.svd(p.T @ q)
    return 1e3 * np.linalg.norm(p @ (u @ v) - q, axis=1)


def recover(
    name: str,
    flat: Place,
    space: Place,
    holds: Place,
    sizes: list[tuple[int, int]],
    *,
    closed: bool,
    newton: bool = False,
) -> None:
    began = time.process_time()
    cloths = [cloth_of(flat, space, *size, closed) for size in sizes]
    held = [holds(*np.array(space_uv(*size, closed)).T) for size in sizes]
    # Style3D is as stiff under compression as under tension.
    options = replace(OPTIONS, compression=1.0) if newton else OPTIONS
    given = relax_drape(cloths[0], None, held=held[0], options=options)
    places = newton_drape(cloths[0], None, steps=1200, held=held[0]) if newton else given.positions
    axes = [np.linspace(0, 1, n) for n in sizes[0]]
    shape = RegularGridInterpolator(axes, places[cloths[0].welded].reshape(*sizes[0], 3), method="cubic")
    second = cloth_of(flat, lambda u, v: shape(np.column_stack([v, u])), *sizes[1], closed)
    wrong = second.flat * [1.03, 0.98] + 0.03 * second.flat[:, 1:] * [1.0, 0.0]
    draped = time.process_time()
    found = recover_cloth(replace(second, flat=wrong), held[1], options=options)
    ended = time.process_time()
    worn = relax_drape(found.cloth, None, held=held[1], options=options)
    before, after = (apart(each, second.flat) for each in (wrong, found.cloth.flat))
    off = 1e3 * np.linalg.norm(worn.positions - second.designed, axis=1)
    rest = "" if worn.converged and given.converged and found.converged else "  NOT AT REST"
    print(
        f"{name:12} {' to '.join(f'{a} by {b}' for a, b in sizes):24} pattern {before.mean():.3f} mean {before.max():.3f} max, "
        f"found {after.mean():.3f} {after.max():.3f}, worn {off.mean():.3f} {off.max():.3f} off; {len(found.strains)} steps, "
        f"{draped - began:.1f} s draped, {ended - draped:.1f} s recovered{rest}", flush=True,
    )  # fmt: skip


def space_uv(rows: int, columns: int, closed: bool) -> list[tuple[float, float]]:
    """The places in the unit square of the sewn vertices."""
    last = columns - 1 if closed else columns
    return [(k / (columns - 1), j / (rows - 1)) for j in range(rows) for k in range(last)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--newton", action="store_true", help="drape a sheet in NVIDIA Newton, too")
    given = parser.parse_args()
    wp.config.log_level = wp.LOG_ERROR
    side, inner, outer = 0.4, 0.11, 0.45
    for newton in (False, True) if given.newton else (False,):
        recover(
            "sheet, Newton" if newton else "sheet",
            lambda u, v: side * np.column_stack([u, v]),
            lambda u, v: side * np.column_stack([0.95 * u, v, 0.075 * np.sin(np.pi * u)]),
            lambda u, v: (v == 1.0) & np.isin(u, (0.0, 0.5, 1.0)),
            [(33, 33), (25, 25)],
            closed=False,
            newton=newton,
        )

    def ring(u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return 2 * np.pi * u, outer + (inner - outer) * v

    def folds(u: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Hanging in eight folds."""
        angle, r = ring(u, v)
        down = r - inner
        radius = inner + 0.35 * down * (1 + 0.5 * np.cos(8 * angle))
        return np.column_stack([radius * np.cos(angle), -0.85 * down, radius * np.sin(angle)])

    def annulus(u: np.ndarray, v: np.ndarray) -> np.ndarray:
        angle, r = ring(u, v)
        return np.column_stack([r * np.cos(angle), r * np.sin(angle)])

    for sizes in ([(37, 161), (33, 145)], [(49, 209), (53, 225)], [(61, 257), (57, 241)], [(61, 257), (49, 209)]):
        recover("circle skirt", annulus, folds, lambda u, v: v == 1.0, sizes, closed=True)


if __name__ == "__main__":
    main()
