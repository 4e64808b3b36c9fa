"""Lays by rule: on cloth that is folded lengthwise, and on stripes and checks that meet at seams.

Pieces are turned into cells, as in `warpflat.pattern.drafting.tile_nesting`, and laid one by one where they end first along the cloth. A
cell is a whole part of the repeat, so that a piece whose place is bound to the repeat is tried at every place that it may take.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from warpflat.core import FloatArray, InputError, nearest
from warpflat.pattern.drafting.drafted import DraftedGarment, DraftedPiece
from warpflat.pattern.drafting.tile_nesting import CELL, Mask, Places, first_free, orders, touched_cells

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

    def check_seams(self, garment: DraftedGarment) -> None:
        """Check that a garment has the seams at which they meet.

        Raises:
            InputError: it lacks one; gives the nearest.
        """
        known = [seam.name for seam in garment.pattern.seams]
        for name in self.seams:
            if name not in known:
                raise InputError(f"match: no seam {name!r}; {nearest(name, known)}")


@dataclass(frozen=True, kw_only=True, eq=False)
class Laid:
    """A copy of a piece to be laid.

    Attributes:
        piece: drafted.
        mirrored: cut turned over.
        linear: 2 by 2, from the drafted piece to the directions of the cloth, warp along x.
        outline: #P by 2 [m], what is cut, in the drafted piece.
        at_fold: whether it lies against the fold of the cloth, along y = 0.
    """

    piece: DraftedPiece
    mirrored: bool
    linear: FloatArray
    outline: FloatArray
    at_fold: bool = False


def lay_by_rule(
    copies: Sequence[Laid], width: float, gap: float, stripes: Stripes, garment: DraftedGarment
) -> list[FloatArray]:
    """Return where the drafted pieces' origins lie on cloth of a usable width [m], a gap [m] apart; the shortest of some orders.

    The garment is that of whole pieces, of which copies may be halves on the fold. Half of the gap is kept to the ends and selvedges.

    Raises:
        InputError: a seam to be matched does not exist, or a piece is too wide.
    """
    import shapely

    stripes.check_seams(garment)
    repeat = stripes.repeat
    cell = np.where(repeat > 0.0, repeat / np.maximum(1, np.ceil(repeat / CELL)), CELL)
    phases = _phases(copies, _matched_points(copies, stripes.seams, garment))
    masks, lows = [], []
    for copy, phase in zip(copies, phases, strict=True):
        # The cells that a copy touches, grown by half of the gap, x in rows and y in columns; and where they begin in it [m].
        outline = copy.outline @ copy.linear.T
        corner = outline.min(axis=0)
        # A bound copy begins as far into a cell as its phase says.
        own = np.where(repeat > 0.0, phase, np.nan)
        bound = np.mod(np.nan_to_num(own) + corner, cell)
        bound += cell * np.maximum(0.0, np.ceil((0.5 * gap - bound) / cell - 1e-9))
        into = np.where(np.isfinite(own), bound, 0.5 * gap)
        if copy.at_fold:
            into[1] = 0.0
        grown = shapely.Polygon(outline - corner + into).buffer(0.5 * gap)
        if copy.at_fold:
            grown = grown.intersection(shapely.box(-1.0, 0.0, 100.0, 100.0))
        high = np.array(grown.bounds[2:])
        tall, wide = np.maximum(1, np.ceil(high / cell - 1e-9)).astype(int)
        # Rows run downwards there.
        turned = shapely.transform(grown, lambda points: points[:, ::-1] * [1.0, -1.0])
        cells = touched_cells(turned, np.zeros(2), cell[::-1], (int(tall), int(wide)))
        masks.append(Mask(cells=cells, quarters=0, extent=high))
        lows.append(corner - into)
    across = int(np.floor(width / cell[1]))
    for copy, mask in zip(copies, masks, strict=True):
        if mask.cells.shape[1] > across:
            raise InputError(
                f"piece {copy.piece.name!r} is too wide for {1e3 * width:.0f} mm of cloth; give wider cloth, or lay it flat"
            )
    steps = np.where(repeat > 0.0, np.round(repeat / cell), 1).astype(int)
    # The rows and columns at which each copy may begin.
    allowed = []
    for copy, phase, low in zip(copies, phases, lows, strict=True):
        bound = np.isfinite(phase) & (repeat > 0)
        first = np.where(bound, np.round((np.nan_to_num(phase) + low) / cell), 0).astype(int) % steps
        rows, columns = (
            slice(int(at), None, int(step)) for at, step in zip(first, np.where(bound, steps, 1), strict=True)
        )
        allowed.append((rows, slice(0, 1) if copy.at_fold else columns))
    places = Places((sum(mask.cells.shape[0] + int(steps[0]) for mask in masks), across))
    best: tuple[int, dict[int, FloatArray]] | None = None
    for order in orders([[mask] for mask in masks]):
        places.clear()
        length, found = 0, dict[int, FloatArray]()
        for k in order:
            free = places.free(masks[k])
            may = np.zeros_like(free)
            may[allowed[k]] = free[allowed[k]]
            if not may.any():
                raise InputError(
                    f"piece {copies[k].piece.name!r} finds no place at which its stripes match; give wider cloth"
                )
            row, column = first_free(may)
            places.take(masks[k], row, column)
            length, found[k] = max(length, row + len(masks[k].cells)), np.array([row, column]) * cell - lows[k]
        if best is None or length < best[0]:
            best = length, found
    assert best is not None
    return [best[1][k] for k in range(len(copies))]


def _matched_points(
    copies: Sequence[Laid], seams: Sequence[str], garment: DraftedGarment
) -> list[dict[int, FloatArray]]:
    """Return for each seam at whose place stripes meet the copies that it joins, each with that place, as the cloth is directed [m]."""
    known = {seam.name: seam for seam in garment.pattern.seams}
    points = []
    for name in seams:
        joined: dict[int, FloatArray] = {}
        for side in (row[0] for row in known[name].sides):
            for k, copy in enumerate(copies):
                if copy.piece.name == side.piece:
                    whole = next(piece for piece in garment.pieces[copy.piece.size] if piece.name == side.piece)
                    notches = [notch for notch in whole.notches if notch.seam == name]
                    line = whole.edge(side.edge).line
                    at = min(notches, key=lambda n: n.length).at if notches else line[-1 if side.reversed else 0]
                    if whole is not copy.piece:
                        # Both sides of a half lie upon each other, beside the fold along x = 0.
                        low, high = whole.cut_line.min(axis=0), whole.cut_line.max(axis=0)
                        half = copy.piece.cut_line
                        away = abs(at[0] - (low[0] + high[0]) / 2) * np.sign(half[:, 0].mean())
                        at = np.array([away, at[1] - low[1] + half[:, 1].min()])
                    joined.setdefault(k, copy.linear @ at)
        points.append(joined)
    return points


def _phases(copies: Sequence[Laid], points: Sequence[Mapping[int, FloatArray]]) -> list[FloatArray]:
    """Return for each copy where its origin lies in the repeat [m], not a number where it is not bound: the first of all joined at 0."""
    phases: list[FloatArray] = [np.full(2, np.nan) for _ in copies]
    for start in range(len(copies)):
        if np.isfinite(phases[start]).all() or not any(start in joined for joined in points):
            continue
        phases[start], queue = np.zeros(2), [start]
        while queue:
            here = queue.pop()
            for joined in (joined for joined in points if here in joined):
                for k, at in joined.items():
                    if not np.isfinite(phases[k]).all():
                        phases[k] = phases[here] + joined[here] - at
                        queue.append(k)
    return phases
