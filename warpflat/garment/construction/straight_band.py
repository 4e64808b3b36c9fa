"""Straight bands: a long strip of even width, such as a neck band or a binding, is cut straight and worn as a ring.

Laid flat as it is worn, a band around a neck is an arc. A tailor cuts a straight strip instead, as long as its shorter edge is worn (cloth
would pucker if it were longer there) or shorter still, and stretches the other edge as it is sewn.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from warpflat.core import IntArray, arc_lengths, polyline_length, resample
from warpflat.flat import (
    NARROW_BAND,
    Flattening,
    Relaxation,
    border_loops,
    flat_areas,
    harmonic_layout,
    laid_stage,
    signed_cell_areas,
    triangulate,
)

__all__ = ["Band", "cut_straight", "find_band"]

# Its outline turns by more than this at its four corners [rad], seen over this share of its width on both sides.
_CORNER, _BESIDE_CORNER = np.radians(40.0), 0.4
# Its width is the same everywhere within this share, and so are its ends.
_EVEN, _END = 0.25, 0.6
# Its longer side is at most so much longer than the other one, or no cloth could be stretched to it: a yoke, a flounce.
_STRETCHED = 0.35
# Places along its sides at which it is measured.
_PLACES = 100


@dataclass(frozen=True, kw_only=True, eq=False)
class Band:
    """A strip of even width.

    Attributes:
        sides: vertices along its two long sides, in one direction, from the one end to the other.
        lengths: of the sides as worn [m].
        width: [m].
    """

    sides: tuple[IntArray, IntArray]
    lengths: tuple[float, float]
    width: float

    @property
    def slenderness(self) -> float:
        """Its length over its width."""
        return 0.5 * sum(self.lengths) / self.width


def find_band(piece: Flattening) -> Band | None:
    """Return the sides of a piece that is a strip of even width; None where it is none, or cut.

    Args:
        piece: relaxed; in its layout the corners show.
    """
    loops = border_loops(piece.faces, piece.network.surface.vertices)
    if len(loops) != 1 or piece.cuts:
        return None
    loop, worn = loops[0], piece.network.surface.vertices
    arc = arc_lengths(piece.positions[loop], closed=True)
    triangles = triangulate(piece.faces)[0]
    half, area = 0.5 * arc[-1], abs(float(signed_cell_areas(triangles, piece.positions).sum()))
    # Sides of a rectangle with this outline and area.
    inside = half**2 - 4.0 * area
    width = 0.5 * (half - np.sqrt(inside)) if inside > 0.0 else half
    if half - width < NARROW_BAND * width:
        return None
    here = piece.positions[loop]
    shares, aside = arc[:-1] / arc[-1], _BESIDE_CORNER * width / arc[-1]
    back = here - resample(here, shares - aside, closed=True)
    ahead = resample(here, shares + aside, closed=True) - here
    turn = np.abs(np.arctan2(back[:, 0] * ahead[:, 1] - back[:, 1] * ahead[:, 0], np.einsum("va,va->v", back, ahead)))
    corners: list[int] = []
    for vertex in np.argsort(-turn, kind="stable").tolist():
        apart = [abs((arc[vertex] - arc[other] + half) % (2.0 * half) - half) for other in corners]
        if turn[vertex] > _CORNER and min(apart, default=half) > 0.5 * width:
            corners.append(vertex)
    if len(corners) != 4:
        return None
    corners.sort()
    turned = np.roll(loop, -corners[0])
    stops = [*(corner - corners[0] for corner in corners), len(loop)]
    runs = [np.append(turned, turned[0])[a : b + 1] for a, b in pairwise(stops)]
    lengths = [polyline_length(worn[run]) for run in runs]
    first = 0 if lengths[0] + lengths[2] > lengths[1] + lengths[3] else 1
    if max(abs(lengths[k] / width - 1.0) for k in (1 - first, 3 - first)) > _END:
        return None
    if max(lengths[first] / lengths[first + 2], lengths[first + 2] / lengths[first]) > 1.0 + _STRETCHED:
        return None
    sides = runs[first], runs[first + 2][::-1]
    one, other = (resample(worn[side], np.linspace(0.0, 1.0, _PLACES)) for side in sides)
    across = np.linalg.norm(other - one, axis=1)
    if np.ptp(across) > _EVEN * across.mean():
        return None
    area = float(flat_areas(worn, triangles).sum())
    long = lengths[first], lengths[first + 2]
    return Band(sides=sides, lengths=long, width=2.0 * area / (long[0] + long[1]))


def cut_straight(piece: Flattening, band: Band, *, shorter: float = 0.0) -> Flattening | None:
    """Return a band as a straight strip, as long as its shorter side is worn; None where its mesh cannot be laid so.

    Args:
        piece: the band as it is worn.
        band: its sides.
        shorter: the share by which it is cut shorter still, from 0 to below 1.
    """
    surface = piece.network.surface
    length = (1.0 - shorter) * min(band.lengths)
    place = np.full((len(piece.positions), 2), np.nan)
    for side, across in zip(band.sides, (0.0, band.width), strict=True):
        along = arc_lengths(surface.vertices[side])
        place[side] = np.column_stack([np.full(len(side), across), length * along / along[-1]])
    loop = border_loops(surface.faces, surface.vertices)[0]
    for end in (0, -1):
        # The vertices between two corners, from the one side to the other.
        at = [int(np.flatnonzero(loop == side[end])[0]) for side in band.sides]
        a, b = min(at), max(at)
        row = loop[a : b + 1] if np.isnan(place[loop[a + 1 : b], 0]).all() else np.append(loop[b:], loop[: a + 1])
        share = arc_lengths(surface.vertices[row])
        ends = place[row[[0, -1]]]
        place[row] = ends[0] + (share / share[-1])[:, None] * (ends[1] - ends[0])
    laid = harmonic_layout(surface, border=place[loop])
    cells = triangulate(piece.faces)[0]
    if signed_cell_areas(cells, laid).sum() * signed_cell_areas(cells, piece.positions).sum() < 0.0:
        laid[:, 0] *= -1.0
    # The datum points up as before, whether it runs along the band or across.
    chord = laid[piece.datum[-1]] - laid[piece.datum[0]]
    if abs(chord[0]) > abs(chord[1]):
        laid = laid[:, ::-1] * [-1.0, 1.0]
        chord = np.array([-chord[1], chord[0]])
    laid = laid * np.sign(chord[1] or 1.0)
    laid += piece.positions.mean(axis=0) - laid.mean(axis=0)
    if not (piece.network.cell_arrays.least_shares(laid) > 0.0).all():
        return None
    energies = Relaxation(piece.network, piece.options, start=laid).energies()
    stage = laid_stage("straight", piece.network, laid, energies, converged=piece.converged)
    longer = max(band.lengths) / length - 1.0
    note = f"cut straight, {1e3 * length:.0f} x {1e3 * band.width:.0f} mm, and worn stretched by up to {100 * longer:.0f} %"
    limit = piece.fabric.strain_limit
    if longer > limit:
        note += f", where {piece.fabric.name} gives {100 * limit:.0f} %: cut it of a knit or on the bias"
    return replace(
        piece,
        positions=laid,
        stages=(*piece.stages, stage),
        unsewn=piece.unsewn or piece,
        notes=(*piece.notes, f"{note}; --bands 'as worn' cuts it curved"),
    )
