"""Girths: what a tape reads around the body, around the form, and along the pattern with its darts and seams closed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.garment.constraints import KeptGirth
from warpflat.mannequin.layout import RING_LEVELS
from warpflat.mannequin.profiles import convex_girth
from warpflat.surface.half_edges import half_edges_of

if TYPE_CHECKING:
    from warpflat.mannequin.forms import FormResult
    from warpflat.mannequin.layout import Layout
    from warpflat.mannequin.mannequin import Mannequin

__all__ = ["girth_constraints", "pattern_girths", "wearer_fit"]


def girth_constraints(mannequin: Mannequin, form: FormResult, positions: Mapping[str, FloatArray]) -> list[KeptGirth]:
    """Return constraints that give every level of the trunk the ease that a form asks for.

    Cloth at rest loses some of it to strain, or has more elsewhere.

    Args:
        mannequin: the body.
        form: on it.
        positions: by piece, #V by 2, sewn without these constraints [m].
    """
    found = []
    for level, girth in pattern_girths(mannequin, form, positions).items():
        if "ease_wanted_m" not in girth:
            continue
        factor = (girth["body_m"] + girth["ease_wanted_m"]) / girth["pattern_m"]
        edges = _level_edges(mannequin, form, level)
        found.append(
            KeptGirth(
                level=level,
                edges={name: own for name, (own, _) in edges.items()},
                shares={name: shares for name, (_, shares) in edges.items()},
                lengths={name: factor * _lengths(positions[name], own) for name, (own, _) in edges.items()},
            )
        )
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
    found: dict[str, dict[str, float]] = {}
    for level in reversed(RING_LEVELS):
        edges = _level_edges(mannequin, form, level)
        if not edges:
            continue
        row = layout.rings[layout.level_row[level]]
        pattern = sum(float(_lengths(positions[name], own) @ shares) for name, (own, shares) in edges.items())
        body = convex_girth(mannequin.vertices[row])
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


def _level_edges(mannequin: Mannequin, form: FormResult, level: str) -> dict[str, tuple[IntArray, FloatArray]]:
    """Return by piece the edges along a level (#E by 2, vertices) and the share by which each counts in its girth.

    Empty where the pieces do not go all around.
    """
    layout = mannequin.layout
    row = layout.rings[layout.level_row[level]]
    ring = np.column_stack([row, np.roll(row, -1)])
    side = form.vertices[ring[:, 1]] - form.vertices[ring[:, 0]]
    level_share = np.linalg.norm(side[:, [0, 2]], axis=1) / np.linalg.norm(side, axis=1)
    ends = {name: half_edges_of(piece.surface).edges for name, piece in form.pieces.items()}
    keys = {name: _edge_keys(layout, form.pieces[name].grid_vertices[own]) for name, own in ends.items()}
    shares = {name: np.zeros(len(own)) for name, own in ends.items()}
    for own_key, image_key, share in zip(
        _edge_keys(layout, ring).tolist(), _edge_keys(layout, layout.mirror[ring]).tolist(), level_share, strict=True
    ):
        places = {name: np.flatnonzero(row == own_key) for name, row in keys.items()}
        # The right half of a half piece is its left one.
        if not any(len(at) for at in places.values()):
            places = {name: np.flatnonzero(row == image_key) for name, row in keys.items()}
        copies = sum(len(at) for at in places.values())
        if copies == 0:
            return {}
        for name, at in places.items():
            shares[name][at] += share / copies
    return {name: (ends[name][own > 0.0], own[own > 0.0]) for name, own in shares.items() if own.any()}


def _edge_keys(layout: Layout, edges: IntArray) -> NDArray[np.int64]:
    """Return one number for each edge of the grid (#E by 2), whichever way it runs."""
    low, high = np.sort(edges.astype(np.int64), axis=1).T
    return np.asarray(low * layout.vertex_count + high)


def _lengths(positions: FloatArray, edges: IntArray) -> FloatArray:
    """Return the lengths of edges (#E by 2) [m]."""
    return np.asarray(np.linalg.norm(positions[edges[:, 0]] - positions[edges[:, 1]], axis=1))
