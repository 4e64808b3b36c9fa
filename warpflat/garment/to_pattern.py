"""From a flattened garment to a pattern: the edges of its pieces with their kinds, its seams, its labels.

Which edge is a seam, a hem or the fold follows from the form alone (:func:`plan_form`), so that a wrong name in a scene
is found before anything is relaxed. The flat layouts give the shapes (:func:`pattern_of_garment`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.core.errors import InputError
from warpflat.core.text import find_unused_name
from warpflat.garment.darts import CLOSED, pleat_depths
from warpflat.garment.ease import measure_ease
from warpflat.garment.edge_rules import EdgeRules
from warpflat.garment.facings import STAND, Stand
from warpflat.garment.finishing import finish_edges
from warpflat.garment.form_plan import (
    EdgePlan,
    FormPlan,
    check_fold_grain,
    find_fold_lines,
    plan_form,
)
from warpflat.garment.mark_openings import mark_openings
from warpflat.garment.mirror_pieces import MirrorPair, find_mirror_pairs, sew_mirror_pairs
from warpflat.garment.openings import Opening, one_sided, place_opening
from warpflat.garment.pockets import add_pockets
from warpflat.mannequin.seam_names import name_seams
from warpflat.pattern.from_mesh import inner_stretches
from warpflat.pattern.label import default_grain
from warpflat.pattern.piece_parts import FOLD_STRAIGHT, Dart, Edge, Hole
from warpflat.pattern.pieces import Garment, Piece, Seam, SeamSide
from warpflat.surface.cut.dart_legs import are_curved, open_length

if TYPE_CHECKING:
    from warpflat.flattening.result import Flattening
    from warpflat.garment.garment import Garment as FlatGarment
    from warpflat.mannequin.forms import FormResult
    from warpflat.mannequin.pieces import FormPiece

__all__ = ["grain_of", "pattern_of_garment"]


#: A datum that strays from the grain by no more than this [m] carries the grain line.
ON_DATUM = 1e-3


def pattern_of_garment(
    garments: Mapping[str, FlatGarment], *, name: str, rules: EdgeRules | None = None, sample_size: str | None = None
) -> tuple[Garment, tuple[str, ...]]:
    """Make the pattern of a garment in one or more sizes.

    Of two pieces that are each other's mirror images in every size the first is drawn, to be cut twice. A half piece
    whose centre did not come out straight cannot lie on the fold: it is cut twice, in every size, with a seam in the
    centre. Notes say so.

    Args:
        garments: flattened, by size; "" where there is none.
        name: of the pattern.
        rules: exceptions for edges.
        sample_size: see :class:`Garment`.

    Returns:
        The pattern, and what was chosen on the way, one sentence each.

    Raises:
        InputError: the rules name an edge that does not exist, the grain is oblique to a fold, a piece's outline
            crosses itself, or the sizes differ in their edges.
    """
    rules = rules or EdgeRules()
    sample, forms = next(iter(garments.values())), {size: _form_of(garment) for size, garment in garments.items()}
    form = next(iter(forms.values()))
    if sample.wished is not None:
        ease, eased = measure_ease(form, sample.wished, sample.positions)
        rules = replace(rules, ease={**ease, **rules.ease, **{seam: ease[seam] for seam in eased}}, eased=eased)
    garments = _laid_upon_each_other(garments)
    plans = {size: plan_form(each, rules) for size, each in forms.items()}
    plan = next(iter(plans.values()))
    bent = _bent_folds(garments)
    folds = {piece: edge for piece, edge in find_fold_lines(form, plan).items() if piece not in bent}
    opened = {name: piece.fold for name, piece in form.pieces.items() if piece.fold and name not in folds}
    for flat in (garment.pieces[piece] for garment in garments.values() for piece in folds):
        check_fold_grain(folds, flat.grain_angle)
    pieces = {
        size: _pieces(garment, plans[size], rules, size=size, opened=set(opened), quantities=plan.quantities)
        for size, garment in garments.items()
    }
    seams = _with_opened_folds(plan.seams, opened)
    # One pattern cannot serve for both sides where just one of them has an opening.
    pairs = () if one_sided(sample.openings) else find_mirror_pairs(garments, pieces, seams)
    drawn = {size: _without_mirror_images(row, pairs) for size, row in pieces.items()}
    notes = tuple(f"{pair.of}: cut twice, once mirrored, it serves for {pair.name} too" for pair in pairs)
    notes += tuple(
        f"{piece}: {opened[piece]} bends by {stray * 1000:.1f} mm and cannot lie on the fold: cut twice, with a seam there"
        for piece, stray in bent.items()
    )
    pattern = Garment(name=name, pieces=drawn, seams=sew_mirror_pairs(seams, pairs), sample_size=sample_size)
    placed = {
        size: [place_opening(forms[size], opening, garment.positions) for opening in garment.openings]
        for size, garment in garments.items()
    }
    pattern = mark_openings(pattern, sample.openings, placed)
    zips = [
        row[0].seam for row, each in zip(placed[pattern.sample], sample.openings, strict=True) if each.opens_the_top
    ]
    pattern = finish_edges(pattern, sample.finishing, gaps=zips, stands=_stands(pattern, sample.openings))
    return add_pockets(pattern, sample.pockets), notes


def _form_of(garment: FlatGarment) -> FormResult:
    if garment.form is None:
        raise InputError(f"garment {garment.name!r} has no form; surface_files draws the pattern of a mesh")
    return garment.form


def _stands(pattern: Garment, openings: Sequence[Opening]) -> list[Stand]:
    """Return the outer edges of the button stands of a pattern, with their facings."""
    return [
        Stand(
            piece=piece.name, edge=edge.name, width=opening.buttons.facing_width,
            grown_on=opening.buttons.facing == "grown-on",
        )
        for opening in openings
        if opening.buttons is not None
        for piece in pattern.pieces[pattern.sample]
        for edge in piece.edges
        if edge.name == f"{opening.line} {STAND}"
    ]  # fmt: skip


def _laid_upon_each_other(garments: Mapping[str, FlatGarment]) -> dict[str, FlatGarment]:
    """Move the pieces of every size to where the lower end of their datum lies in the first size.

    Relaxation keeps a piece upright, but not in its place.
    """
    first = next(iter(garments.values()))
    moved = {}
    for size, garment in garments.items():
        pieces = {}
        for name, flat in garment.pieces.items():
            there = first.pieces[name]
            offset = there.positions[there.datum[0]] - flat.positions[flat.datum[0]]
            pieces[name] = replace(flat, positions=flat.positions + offset) if offset.any() else flat
        moved[size] = replace(garment, pieces=pieces)
    return moved


def _with_opened_folds(seams: tuple[Seam, ...], opened: Mapping[str, str]) -> tuple[Seam, ...]:
    """Add a seam in the centre of each piece that is cut twice instead of on the fold."""
    names = name_seams(list(opened.values()), [(piece, piece) for piece in opened])
    for name, (piece, edge) in zip(names, opened.items(), strict=True):
        side = (SeamSide(piece=piece, edge=edge),)
        seams = (*seams, Seam(name=find_unused_name(name, {seam.name for seam in seams}), sides=(side, side)))
    return seams


def _pieces(
    garment: FlatGarment,
    plan: FormPlan,
    rules: EdgeRules,
    *,
    size: str,
    opened: set[str],
    quantities: Mapping[str, int],
) -> tuple[Piece, ...]:
    """Return all pieces of one size; those in `opened` are halves that cannot lie on the fold and are cut twice."""
    form = _form_of(garment)
    pleats = pleat_depths(form)
    return tuple(
        _piece(
            flat,
            form.pieces[name],
            plan.edges[name],
            rules=rules,
            size=size,
            quantity=2 if name in opened else quantities[name],
            open_fold=name in opened,
            pleats={dart: depth for (piece, dart), depth in pleats.items() if piece == name},
        )
        for name, flat in garment.pieces.items()
    )


def _without_mirror_images(pieces: Sequence[Piece], pairs: Sequence[MirrorPair]) -> tuple[Piece, ...]:
    """Leave out the pieces that are cut by another one's pattern, which is cut twice as often."""
    drawn, left_out = {pair.of for pair in pairs}, {pair.name for pair in pairs}
    return tuple(
        replace(piece, quantity=2 * piece.quantity) if piece.name in drawn else piece
        for piece in pieces
        if piece.name not in left_out
    )


def grain_of(outline: FloatArray, flat: Flattening, datum: FloatArray | None = None) -> FloatArray:
    """Return the grain line along the warp (2 by 2 [m]), on the datum where that is straight.

    Elsewhere it runs through the widest place.

    Args:
        outline: #P by 2 [m].
        flat: the piece.
        datum: #P by 2 [m]; None if it does not lie inside the piece.
    """
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
            found[find_unused_name(name, found)] = flat[stretch]
    return found


def _bent_folds(garments: Mapping[str, FlatGarment]) -> dict[str, float]:
    """Return half pieces whose fold strays from straight in some size, and by how much [m] at most."""
    bent: dict[str, float] = {}
    for garment in garments.values():
        for name, flat in garment.pieces.items():
            piece = _form_of(garment).pieces[name]
            if piece.fold is None:
                continue
            points = flat.positions[piece.edges[piece.fold]]
            span, away = points[-1] - points[0], points - points[0]
            length = max(float(np.linalg.norm(span)), 1e-12)
            stray = float(np.abs(away[:, 0] * span[1] - away[:, 1] * span[0]).max()) / length
            if stray > max(FOLD_STRAIGHT, bent.get(name, 0.0)):
                bent[name] = stray
    return bent


def _clear_legs(edges: Sequence[Edge], darts: Mapping[str, tuple[str, str]], piece: str) -> list[Edge]:
    """Move the tip of a dart whose legs overlap by less than `CLOSED` short of it back to where they meet.

    Raises:
        InputError: the legs of a dart overlap from the border on, or by more.
    """
    by_name = {edge.name: edge for edge in edges}
    for dart, names in darts.items():
        left, right = (by_name[name] for name in names)
        count, overlap = open_length(left.points, right.points[::-1])
        if count == 0:
            raise InputError(
                f"piece {piece!r}: dart {dart!r} overlaps at its mouth: the cloth wants no dart there; leave it out, or give "
                "it a width, mouth_mm = 10"
            )
        if overlap > CLOSED:
            raise InputError(
                f"piece {piece!r}: the legs of dart {dart!r} overlap by {1e3 * overlap:.2g} mm: let it open wider, mouth_mm = 15, "
                "or make it shorter"
            )
        if count == len(left.points):
            continue
        kept = slice(0, count)
        tip = 0.5 * (left.points[count] + right.points[::-1][count])
        for leg, turn in ((left, 1), (right, -1)):
            points = np.vstack([leg.points[::turn][kept], tip])[::turn]
            ids = (
                None
                if leg.vertices is None
                else np.append(leg.vertices[::turn][kept], leg.vertices[::turn][-1])[::turn]
            )
            by_name[leg.name] = replace(leg, points=points, vertices=ids)
    return list(by_name.values())


def _piece(
    flat: Flattening,
    piece: FormPiece,
    plan: Sequence[EdgePlan],
    *,
    rules: EdgeRules,
    size: str,
    quantity: int,
    open_fold: bool,
    pleats: Mapping[str, float],
) -> Piece:
    """Return one piece of a garment with its edges, internal lines and grain."""
    name = piece.surface.name
    edges = []
    for part in plan:
        vertices = np.asarray(piece.edges[part.source])[part.first : part.last + 1]
        kind = "seam" if open_fold and part.kind == "fold" else part.kind
        # A leg's allowance is for a dart that is cut away, not folded.
        of_kind = "seam" if kind == "dart" else kind
        allowance = rules.allowance(name, part.name, of_kind, whole=part.whole)
        points = flat.positions[vertices]
        edges.append(Edge(name=part.name, points=points, kind=kind, allowance=allowance, vertices=vertices))
    edges = _clear_legs(edges, piece.darts, name)
    legs = {edge.name: edge.points for edge in edges if edge.kind == "dart"}
    darts = [
        Dart(
            name=dart,
            left=left,
            right=right,
            cut=are_curved(legs[left], legs[right]),
            pleat=pleats.get(dart),
        )
        for dart, (left, right) in piece.darts.items()
    ]
    holes = [
        Hole(name=dart, points=np.vstack([flat.positions[left], flat.positions[right[-2:0:-1]]])[::-1], kind="dart")
        for dart, (left, right) in piece.fisheyes.items()
    ]
    border = [*piece.edges.values(), *(leg for legs in piece.fisheyes.values() for leg in legs)]
    along = _inner_lines({piece.datum: piece.surface.lines[piece.datum]}, border, flat.positions)
    return Piece(
        name=name,
        size=size,
        fabric=flat.fabric.name,
        quantity=quantity,
        edges=edges,
        darts=darts,
        holes=holes,
        internal_lines=_inner_lines(piece.surface.lines, border, flat.positions),
        grain=grain_of(
            np.concatenate([edge.points[:-1] for edge in edges]),
            flat,
            max(along.values(), key=len, default=None),
        ),
    )
