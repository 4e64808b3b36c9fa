"""Girths: what a tape reads around the body, around the form, and along the pattern with its darts and seams closed."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from warpflat.core.arrays import FloatArray
from warpflat.garment.constraints import KeptGirth
from warpflat.mannequin.layout import RING_LEVELS
from warpflat.mannequin.pieces import is_part_of
from warpflat.mannequin.profiles import convex_girth

if TYPE_CHECKING:
    from warpflat.mannequin.forms import FormResult
    from warpflat.mannequin.mannequin import Mannequin

__all__ = ["girth_constraints", "pattern_girths", "wearer_fit"]


def girth_constraints(form: FormResult) -> list[KeptGirth]:
    """Return constraints that keep the girth of every level with ease, in a form with darts.

    Cloth would rather lose some of it to strain. Darts give it its shape at a price of few millijoules; without them the
    strain would only go elsewhere.
    """
    if not form.darts:
        return []
    found = []
    for level in (level for level, ease in form.ease.items() if ease != 0.0):
        for name, piece in form.pieces.items():
            lines = tuple(line for line in piece.surface.lines if is_part_of(line, level))
            if lines:
                found.append(KeptGirth(piece=name, level=level, lines=lines))
    return found


def pattern_girths(
    mannequin: Mannequin, form: FormResult, positions: Mapping[str, FloatArray]
) -> dict[str, dict[str, float]]:
    """Return the entry `girths` of `metrics.json` for every closed level of the trunk that the pieces go around.

    The pattern's girth is the length of the level's line in the pieces: a dart on the way adds nothing, nor does a seam. Where
    two pieces meet along the level it is the mean of both. A half piece counts twice. Where the line slopes on the form, as at
    the bust under a lowered armhole, each of its edges counts by its level share, as the tapes around body and form are level.

    Args:
        mannequin: the body.
        form: on it.
        positions: by piece, #V by 2 [m].
    """
    layout = mannequin.layout
    rows = {level: layout.rings[layout.level_row[level]] for level in RING_LEVELS}
    lengths = _edge_lengths(form, positions, {int(v) for row in rows.values() for v in row})
    found: dict[str, dict[str, float]] = {}
    for level in reversed(RING_LEVELS):
        row = rows[level]
        ring = [*row.tolist(), int(row[0])]
        own = [_length(lengths, a, b) or _length(lengths, *layout.mirror[[a, b]]) for a, b in itertools.pairwise(ring)]
        if not all(own):
            continue
        sides = np.diff(form.vertices[ring], axis=0)
        level_share = np.linalg.norm(sides[:, [0, 2]], axis=1) / np.linalg.norm(sides, axis=1)
        body, pattern = convex_girth(mannequin.vertices[row]), float(np.dot(own, level_share))
        found[level] = {
            "body_m": body,
            "form_m": convex_girth(form.vertices[row]),
            "pattern_m": pattern,
            "ease_m": pattern - body,
        }
        if level in form.ease:
            found[level]["ease_wanted_m"] = 0.01 * form.ease[level]
    return found


def wearer_fit(girths: Mapping[str, Mapping[str, float]], limit: float) -> dict[str, Any]:
    """Return how a garment fits the body itself, level by level: the entry `wearer` of `wear` in `metrics.json`.

    Where the cloth is larger than the body it hangs, with ease and without strain. Where it is smaller it touches, and is
    stretched to the body's girth.

    Args:
        girths: the entry `girths`.
        limit: the least strain limit of its cloths.
    """
    levels = {
        level: {"ease_m": girth["ease_m"], "strain": max(0.0, girth["body_m"] / girth["pattern_m"] - 1.0)}
        for level, girth in girths.items()
    }
    return {"fits": all(level["strain"] <= limit for level in levels.values()), "levels": levels}


def _edge_lengths(
    form: FormResult, positions: Mapping[str, FloatArray], wanted: set[int]
) -> dict[tuple[int, int], list[float]]:
    """Return the lengths in the pieces of the mannequin's edges between wanted vertices, one per piece and side."""
    found: dict[tuple[int, int], list[float]] = {}
    ids = np.array(sorted(wanted))
    for name, piece in form.pieces.items():
        corners = piece.surface.faces
        ends = np.sort(np.stack([corners, np.roll(corners, -1, axis=1)], -1).reshape(-1, 2), axis=1)
        ends = np.unique(ends, axis=0)
        grid = np.sort(piece.grid_vertices[ends], axis=1)
        own = np.isin(grid, ids).all(axis=1)
        length = np.linalg.norm(positions[name][ends[own, 0]] - positions[name][ends[own, 1]], axis=1)
        for (a, b), each in zip(grid[own].tolist(), length.tolist(), strict=True):
            found.setdefault((a, b), []).append(each)
    return found


def _length(lengths: Mapping[tuple[int, int], list[float]], a: int, b: int) -> float:
    """Return the mean length of an edge; 0 where no piece has it."""
    own = lengths.get((min(a, b), max(a, b)), [])
    return sum(own) / len(own) if own else 0.0
