"""Girths: what a tape reads around the body, around the form, and along the pattern with its darts and seams closed.

Around trunk, arms and legs tapes are level; at the neck, around an armhole and along a hem they follow the line.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from warpflat.core import FloatArray, IntArray, polyline_length, without_side
from warpflat.flat import TOO_LARGE
from warpflat.garment.construction.constraints import KeptGirth
from warpflat.garment.construction.tapes import ALONG, PieceEdges, RowEdges, stretch_tape
from warpflat.garment.construction.wearer import body_rows
from warpflat.garment.mannequin.layout import ARM_LEVELS, LEG_LEVELS, RING_LEVELS
from warpflat.garment.mannequin.profiles import convex_girth

if TYPE_CHECKING:
    from warpflat.garment.mannequin.forms import FormResult
    from warpflat.garment.mannequin.layout import Layout
    from warpflat.garment.mannequin.mannequin import Mannequin

__all__ = ["drawn_in", "girth_constraints", "loose_armholes", "pattern_girths"]


def girth_constraints(mannequin: Mannequin, form: FormResult, positions: Mapping[str, FloatArray]) -> list[KeptGirth]:
    """Return constraints that give every level the ease that a form asks for, and armholes with sleeves their drafted length.

    Cloth at rest loses some of the ease to strain, or has more elsewhere. An armhole gives way to the longer cap that is
    eased into it.

    Args:
        mannequin: the body.
        form: on it.
        positions: by piece, #V by 2, at rest without these constraints [m].
    """
    layout, piece_edges = mannequin.layout, PieceEdges(mannequin.layout, form)
    sleeves = np.concatenate([np.empty(0), *(form.pieces[cap].grid_vertices for cap in _caps(layout, form))])
    limbs = {name: (row, axis) for (name, _), row, _, axis in body_rows(mannequin)}
    lines = _lines(layout, form)
    found = []
    for level, girth in pattern_girths(mannequin, form, positions).items():
        if "ease_wanted_m" in girth:
            edges = piece_edges.cut_along(*([_row(layout, level)] if level in RING_LEVELS else limbs[level]))
            found.append(
                _kept(level, edges, (girth["body_m"] + girth["ease_wanted_m"]) / girth["pattern_m"], positions)
            )
        elif level in lines and np.isin(lines[level][0], sleeves).all():
            found.append(_kept(level, lines[level][1], girth["form_m"] / girth["pattern_m"], positions))
    return found


def loose_armholes(mannequin: Mannequin, form: FormResult, positions: Mapping[str, FloatArray]) -> list[KeptGirth]:
    """Return constraints that take in the armholes which came out too large, to half of what is too large.

    Args:
        mannequin: the body.
        form: on it.
        positions: by piece, #V by 2, sewn [m].
    """
    girths = pattern_girths(mannequin, form, positions)
    found = []
    for level, (_, edges) in _lines(mannequin.layout, form).items():
        longer = girths[level]["pattern_m"] / girths[level]["form_m"]
        if level != "neck" and longer > 1.0 + 0.9 * TOO_LARGE:
            found.append(_kept(level, edges, (1.0 + 0.5 * TOO_LARGE) / longer, positions))
    return found


def _kept(level: str, edges: RowEdges | None, factor: float, positions: Mapping[str, FloatArray]) -> KeptGirth:
    """Return the constraint that a level has its length in the pattern times a factor."""
    assert edges is not None
    lengths = {name: factor * row for name, row in edges.lengths_of_pieces(positions).items()}
    return KeptGirth(level=level, edges=edges.ends, shares=edges.shares, lengths=lengths)


def pattern_girths(
    mannequin: Mannequin, form: FormResult, positions: Mapping[str, FloatArray]
) -> dict[str, dict[str, float]]:
    """Return the entry `girths` of `metrics.json`: levels of trunk, arms and legs, neck and armholes that the pieces go around.

    The pattern's girth is the length of the level's line in the pieces: a dart on the way adds nothing, nor does a seam. Where
    two pieces meet along the level it is the mean of both. A half piece counts twice. Where the line slopes on the form, as at
    the bust under a lowered armhole, each of its edges counts by its level share, as the tapes around body and form are level; a hem
    is as long as it is cut.

    Args:
        mannequin: the body.
        form: on it.
        positions: by piece, #V by 2 [m].
    """
    layout = mannequin.layout
    piece_edges = PieceEdges(layout, form)
    found: dict[str, dict[str, float]] = {}

    def measure(name: str, row: IntArray, edges: RowEdges, tape: Callable[[FloatArray], float]) -> None:
        pattern = float(edges.lengths(positions, len(row)).sum())
        body = tape(mannequin.vertices[row])
        designed = polyline_length(form.vertices[row], closed=True) if edges.is_hem else tape(form.vertices[row])
        found[name] = {"body_m": body, "form_m": designed, "pattern_m": pattern, "ease_m": pattern - body}

    for level in reversed(RING_LEVELS):
        row = _row(layout, level)
        edges = piece_edges.cut_along(row)
        if edges is not None:
            measure(level, row, edges, convex_girth)
            if level in form.ease:
                found[level]["ease_wanted_m"] = 0.01 * form.ease[level]
    for name, (row, edges) in _lines(layout, form).items():
        measure(name, row, edges, partial(polyline_length, closed=True))
    # Of limbs what the recipe asks for, but between ruled levels, where cloth hangs.
    limbs, asked = [*ARM_LEVELS, *LEG_LEVELS], form.recipe.ease
    spans = [sorted(map(limbs.index, pair)) for pair in form.recipe.ruled if set(pair) <= set(limbs)]
    for (name, _), row, _, axis in body_rows(mannequin):
        limb = without_side(name)
        edges = piece_edges.cut_along(row, axis) if limb != name else None
        if edges is None:
            continue

        def tape(points: FloatArray, axis: FloatArray = axis) -> float:
            return stretch_tape(points, axis).girth

        measure(name, row, edges, tape)
        level = limb if limb in ARM_LEVELS else f"leg_{limb}"
        if level in asked and not any(low < limbs.index(level) < high for low, high in spans):
            found[name]["ease_wanted_m"] = 0.01 * asked[level]
    return found


def drawn_in(girths: Mapping[str, Mapping[str, float]], bands: Mapping[str, float]) -> dict[str, Mapping[str, float]]:
    """Return girths of a garment that cuffs and bands draw in, by line how long these are [m].

    The ease that was asked for is that of the cloth, not of a band.
    """
    found = dict(girths)
    for level, girth in girths.items():
        if (band := bands.get(without_side(level))) is not None:
            body, form = girth["body_m"], girth["form_m"]
            found[level] = {"body_m": body, "form_m": form, "pattern_m": band, "ease_m": band - body}
    return found


def _caps(layout: Layout, form: FormResult) -> set[str]:
    """Return the pieces that cover an arm beyond its armhole."""
    beyond = np.concatenate([arm[1:].ravel() for arm in layout.arms.values()])
    return {name for name, piece in form.pieces.items() if np.isin(piece.grid_vertices, beyond).any()}


def _lines(layout: Layout, form: FormResult) -> dict[str, tuple[IntArray, RowEdges]]:
    """Return the lines around neck and armholes, where pieces of the trunk go around: the grid's vertices, the edges."""
    caps = _caps(layout, form)
    if len(caps) == len(form.pieces):
        return {}
    trunk = PieceEdges(layout, replace(form, pieces={n: piece for n, piece in form.pieces.items() if n not in caps}))
    lines = {"neck": layout.lines["neck"][:-1], **{f"armhole {side}": arm[0] for side, arm in layout.arms.items()}}
    found = {name: (row, trunk.along(row, ALONG)) for name, row in lines.items()}
    return {name: (row, edges) for name, (row, edges) in found.items() if edges is not None}


def _row(layout: Layout, level: str) -> IntArray:
    """Return the grid's vertices around a level."""
    return np.asarray(layout.rings[layout.level_row[level]])
