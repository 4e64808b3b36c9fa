"""Lays by rule: on cloth that is folded lengthwise, and on stripes and checks that meet at seams.

Pieces are turned into cells, as in `warpflat.pattern.drafting.tile_nesting`, and laid one by one where they end first along the cloth. A
cell is a whole part of the repeat, so that a piece whose place is bound to the repeat is tried at every place that it may take.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from warpflat.core import BoolArray, FloatArray, InputError, nearest
from warpflat.pattern.drafting.drafted import DraftedGarment, DraftedPiece
from warpflat.pattern.drafting.tile_nesting import CELL, Mask, Places, orders

__all__ = ["Laid", "Stripes", "lay_by_rule"]


@dataclass(frozen=True, kw_only=True)
class Stripes:
    """Stripes or checks of a cloth, and the seams at which they meet.

    Attributes:
        warp, weft: their repeat along warp and weft [m]; 0 where there is none.
        seams: at whose first notch (or beginning) both sides lie on the same stripe.
    """

    warp: float = 0.0
    weft: float = 0.0
    seams: tuple[str, ...] = ()

    @property
    def repeat(self) -> FloatArray:
        """Repeats along and across the cloth [m]."""
        return np.array([self.warp, self.weft])


@dataclass(frozen=True, kw_only=True, eq=False)
class Laid:
    """A copy of a piece to be laid, and its place.

    Attributes:
        piece: drafted.
        mirrored: cut turned over.
        linear: 2 by 2, from the drafted piece to the directions of the cloth, warp along x.
        outline: #P by 2 [m], what is cut, in the drafted piece.
        at_fold: whether it lies against the fold of the cloth, along y = 0.
        shift: where the drafted piece's origin lies on the cloth [m].
    """

    piece: DraftedPiece
    mirrored: bool
    linear: FloatArray
    outline: FloatArray
    at_fold: bool = False
    shift: tuple[float, float] = (0.0, 0.0)


def lay_by_rule(
    copies: Sequence[Laid], width: float, gap: float, stripes: Stripes, garment: DraftedGarment
) -> list[Laid]:
    """Return copies with their places on cloth of a usable width [m], a gap [m] apart; the shortest of some orders.

    Raises:
        InputError: a seam to be matched does not exist, or a piece is too wide.
    """
    import shapely

    repeat = stripes.repeat
    cell = np.where(repeat > 0.0, repeat / np.maximum(1, np.ceil(repeat / CELL)), CELL)
    # For each copy where its origin lies in the repeat [m]; not a number where it is not bound.
    known = {seam.name: seam for seam in garment.garment.seams}
    points: dict[str, list[tuple[int, FloatArray]]] = {}
    for name in stripes.seams:
        if name not in known:
            raise InputError(f"match: no seam {name!r}; {nearest(name, known)}")
        for side in (row[0] for row in known[name].sides):
            for k, copy in enumerate(copies):
                if copy.piece.name != side.piece:
                    continue
                notches = [notch for notch in copy.piece.notches if notch.seam == name]
                line = copy.piece.edge(side.edge).line
                at = min(notches, key=lambda n: n.length).at if notches else line[-1 if side.reversed else 0]
                if all(k != other for other, _ in points.get(name, ())):
                    points.setdefault(name, []).append((k, copy.linear @ at))
    phases: list[FloatArray] = [np.full(2, np.nan) for _ in copies]
    for start in range(len(copies)):
        if np.isfinite(phases[start]).all() or all(k != start for joined in points.values() for k, _ in joined):
            continue
        phases[start], queue = np.zeros(2), [start]
        while queue:
            here = queue.pop()
            for joined in points.values():
                mine = next((at for k, at in joined if k == here), None)
                if mine is None:
                    continue
                for k, at in joined:
                    if not np.isfinite(phases[k]).all():
                        phases[k] = phases[here] + mine - at
                        queue.append(k)
    masks, lows = [], []
    for copy, phase in zip(copies, phases, strict=True):
        outline = copy.outline @ copy.linear.T
        low = outline.min(axis=0)
        # A bound piece begins this far into its cell.
        into = np.where(np.isfinite(phase) & (repeat > 0), np.mod(np.nan_to_num(phase) + low, cell), 0.5 * gap)
        if copy.at_fold:
            into[1] = 0.0
        # The cells that an outline touches, grown by half of the gap; x in rows, y in columns, from the origin.
        grown = shapely.Polygon(outline - low + into).buffer(0.5 * gap)
        if copy.at_fold:
            grown = grown.intersection(shapely.box(-1.0, 0.0, 100.0, 100.0))
        high = np.array(grown.bounds[2:])
        tall, wide = np.maximum(1, np.ceil(high / cell - 1e-9)).astype(int)
        shapely.prepare(grown)
        x, y = cell[0] * np.arange(tall)[:, None], cell[1] * np.arange(wide)[None, :]
        cells: BoolArray = shapely.intersects(grown, shapely.box(x, y, x + cell[0], y + cell[1]))
        masks.append(Mask(cells=cells, quarters=0, extent=high))
        lows.append(low - into)
    across = int(np.floor(width / cell[1]))
    for copy, mask in zip(copies, masks, strict=True):
        if mask.cells.shape[1] > across:
            raise InputError(
                f"piece {copy.piece.name!r} is too wide for {1e3 * width:.0f} mm of cloth; give wider cloth, or lay it flat"
            )
    steps = np.where(repeat > 0.0, np.round(repeat / cell), 1).astype(int)
    starts = [
        tuple(
            int(v)
            for v in np.where(np.isfinite(p) & (repeat > 0), np.round((np.nan_to_num(p) + low) / cell), 0) % steps
        )
        for p, low in zip(phases, lows, strict=True)
    ]
    bound = [np.isfinite(p) & (repeat > 0) for p in phases]
    longest = sum(mask.cells.shape[0] + int(steps[0]) for mask in masks)
    places, best = Places((longest, across)), None
    for order in orders([[mask] for mask in masks]):
        places.clear()
        found: dict[int, tuple[int, int]] = {}
        for k in order:
            free = places.free(masks[k])
            allowed = np.zeros_like(free)
            rows = slice(starts[k][0], None, int(steps[0])) if bound[k][0] else slice(None)
            columns = slice(starts[k][1], None, int(steps[1])) if bound[k][1] else slice(None)
            allowed[rows, slice(0, 1) if copies[k].at_fold else columns] = True
            free &= allowed
            if not free.any():
                raise InputError(
                    f"piece {copies[k].piece.name!r} finds no place at which its stripes match; give wider cloth"
                )
            row = int(np.argmax(free.any(axis=1)))
            found[k] = row, int(np.argmax(free[row]))
            places.take(masks[k], *found[k])
        length = max(row + masks[k].cells.shape[0] for k, (row, _) in found.items())
        if best is None or length < best[0]:
            best = length, found
    assert best is not None
    laid = []
    for k, copy in enumerate(copies):
        shift = np.array(best[1][k]) * cell - lows[k]
        laid.append(
            Laid(
                piece=copy.piece, mirrored=copy.mirrored, linear=copy.linear, outline=copy.outline, at_fold=copy.at_fold,
                shift=(float(shift[0]), float(shift[1])),
            )
        )  # fmt: skip
    return laid
