"""From a flattened garment to a pattern: the edges of its pieces with their kinds, its seams, its labels.

Which edge is a seam, a hem or the fold follows from the form alone, so that a wrong name in a scene is found before
anything is relaxed (:func:`plan_form`); the flat layouts give the shapes (:func:`pattern_of_garment`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.garment.edge_rules import EdgeRules, unused
from warpflat.garment.form_plan import (
    EdgePlan,
    check_fold_grain,
    folds_of,
    plan_form,
)
from warpflat.garment.mirror_pieces import find_mirror_pairs, sew_mirror_pairs
from warpflat.pattern.from_mesh import inner_stretches
from warpflat.pattern.label import default_grain
from warpflat.pattern.pieces import FOLD_STRAIGHT, Edge, Garment, Piece, Seam, SeamSide

if TYPE_CHECKING:
    from warpflat.flattening.result import Flattening
    from warpflat.garment.garment import Garment as FlatGarment
    from warpflat.mannequin.pieces import FormPiece

__all__ = ["grain_of", "pattern_of_garment"]


#: A datum that strays from the grain by no more than this [m] carries the grain line.
ON_DATUM = 1e-3


def pattern_of_garment(
    garments: Mapping[str, FlatGarment], *, name: str, rules: EdgeRules | None = None, sample_size: str | None = None
) -> tuple[Garment, tuple[str, ...]]:
    """The pattern of a garment in one or more sizes.

    Of two pieces that are each other's mirror images in every size the first is drawn, to be cut twice. A half piece whose
    centre did not come out straight cannot lie on the fold: it is cut twice, in every size, with a seam in the centre. Notes
    say so.

    Args:
        garments: flattened, by size; "" where there is none.
        name: of the pattern.
        rules: exceptions for edges.
        sample_size: see :class:`Garment`.

    Returns:
        The pattern, and what was chosen on the way, one sentence each.

    Raises:
        InputError: the rules name an edge that does not exist, the grain is oblique to a fold, a piece's outline crosses itself,
            or the sizes differ in their edges.
    """
    rules = rules or EdgeRules()
    plans = {size: plan_form(garment.form, rules) for size, garment in garments.items()}
    bent = _bent_folds(garments)
    form, plan = next(iter(garments.values())).form, next(iter(plans.values()))
    folds = {name: edge for name, edge in folds_of(form, plan).items() if name not in bent}
    opened = {name: piece.fold for name, piece in form.pieces.items() if piece.fold and name not in folds}
    for flat in (garment.pieces[name] for garment in garments.values() for name in folds):
        check_fold_grain(folds, flat.grain_angle)
    pieces = {
        size: tuple(
            _piece(
                flat, garment.form.pieces[piece], plans[size].edges[piece], rules=rules, size=size,
                quantity=2 if piece in opened else plan.quantities[piece], open_fold=piece in opened,
            )
            for piece, flat in garment.pieces.items()
        )
        for size, garment in garments.items()
    }  # fmt: skip
    seams = plan.seams
    for piece, edge in opened.items():
        side = (SeamSide(piece=piece, edge=edge),)
        seams = (*seams, Seam(name=unused(edge, {seam.name for seam in seams}), sides=(side, side)))
    twins = find_mirror_pairs(garments, pieces, seams)
    seams = sew_mirror_pairs(seams, twins)
    drawn = {twin.of for twin in twins}
    pieces = {
        size: tuple(
            replace(piece, quantity=2 * piece.quantity) if piece.name in drawn else piece
            for piece in row
            if piece.name not in {twin.name for twin in twins}
        )
        for size, row in pieces.items()
    }
    notes = tuple(f"{twin.of}: cut twice, once mirrored, it serves for {twin.name} too" for twin in twins)
    notes += tuple(
        f"{piece}: {opened[piece]} bends by {stray * 1000:.1f} mm and cannot lie on the fold: cut twice, with a seam there"
        for piece, stray in bent.items()
    )
    return Garment(name=name, pieces=pieces, seams=seams, sample_size=sample_size), notes


def grain_of(outline: FloatArray, flat: Flattening, datum: FloatArray | None = None) -> FloatArray:
    """2 by 2 [m], along the warp: on the datum (#P by 2 [m]) where that is straight, else through the widest place."""
    from warpflat.fabric.fabric import grain_axes

    x, y = grain_axes(flat.grain_angle)[0]
    turn = np.array([[y, -x], [x, y]])
    if datum is not None:
        along = datum @ turn.T
        if np.ptp(along[:, 0]) <= ON_DATUM:
            low, high = float(along[:, 1].min()), float(along[:, 1].max())
            ends = np.array([low + (high - low) / 6, high - (high - low) / 6])
            return np.column_stack([np.full(2, along[:, 0].mean()), ends]) @ turn
    return default_grain(outline @ turn.T) @ turn


def _inner_lines(lines: Mapping[str, Any], border: Sequence[IntArray], flat: FloatArray) -> dict[str, FloatArray]:
    """Return the stretches of feature lines inside a piece, #P by 2 [m]; a second stretch of a line is "NAME 2".

    Args:
        lines: vertex indices by name.
        border: vertex indices along every edge, both ends included.
        flat: #V by 2 [m].
    """
    edges = {(min(a, b), max(a, b)) for ids in border for a, b in pairwise(np.asarray(ids).tolist())}
    found: dict[str, FloatArray] = {}
    for name, line in lines.items():
        for stretch in inner_stretches(np.asarray(line), edges):
            found[unused(name, found)] = flat[stretch]
    return found


def _bent_folds(garments: Mapping[str, FlatGarment]) -> dict[str, float]:
    """Half pieces whose fold strays from straight in some size, and by how much [m] at most."""
    bent: dict[str, float] = {}
    for garment in garments.values():
        for name, flat in garment.pieces.items():
            piece = garment.form.pieces[name]
            if piece.fold is None:
                continue
            points = flat.positions[piece.edges[piece.fold]]
            span, away = points[-1] - points[0], points - points[0]
            length = max(float(np.linalg.norm(span)), 1e-12)
            stray = float(np.abs(away[:, 0] * span[1] - away[:, 1] * span[0]).max()) / length
            if stray > max(FOLD_STRAIGHT, bent.get(name, 0.0)):
                bent[name] = stray
    return bent


def _piece(
    flat: Flattening,
    piece: FormPiece,
    plan: Sequence[EdgePlan],
    *,
    rules: EdgeRules,
    size: str,
    quantity: int,
    open_fold: bool,
) -> Piece:
    name = piece.surface.name
    edges = []
    for part in plan:
        vertices = np.asarray(piece.edges[part.source])[part.first : part.last + 1]
        kind = "seam" if open_fold and part.kind == "fold" else part.kind
        allowance = rules.allowance(name, part.name, kind)
        points = flat.positions[vertices]
        edges.append(Edge(name=part.name, points=points, kind=kind, allowance=allowance, vertices=vertices))
    border = list(piece.edges.values())
    along = _inner_lines({piece.datum: piece.surface.lines[piece.datum]}, border, flat.positions)
    return Piece(
        name=name,
        size=size,
        fabric=flat.fabric.name,
        quantity=quantity,
        edges=edges,
        internal_lines=_inner_lines(piece.surface.lines, border, flat.positions),
        grain=grain_of(
            np.concatenate([edge.points[:-1] for edge in edges]),
            flat,
            max(along.values(), key=len, default=None),
        ),
    )
