"""From a flattened surface, whole or cut into pieces, to a pattern: border as edges, cuts as darts and seams."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.core.errors import InputError
from warpflat.core.text import find_unused_name, quote_value
from warpflat.flattening.applied_cut import seam_kind
from warpflat.garment.closed_cuts import CLOSED, are_closed, close_cuts, seams_of_cuts
from warpflat.garment.edge_rules import EdgeRules
from warpflat.garment.to_pattern import grain_of
from warpflat.pattern.from_mesh import MeshFeatures, line_labels, piece_from_mesh
from warpflat.pattern.piece_parts import DEFAULT_ALLOWANCE, Edge, Hole
from warpflat.pattern.pieces import Garment, Piece, Seam, SeamSide
from warpflat.surface.border_seams import SAME_PLACE
from warpflat.surface.connectivity import border_loops, join_labels
from warpflat.surface.cut.dart import fish_eye_measure
from warpflat.surface.cut.dart_legs import are_curved, pull_back, pull_back_eye

if TYPE_CHECKING:
    from warpflat.flattening.result import Flattening
    from warpflat.surface.border_seams import NamedSeam
    from warpflat.surface.cut.cut_mesh import Seam as Cut
    from warpflat.surface.mesh import Surface

__all__ = ["check_edge_names", "pattern_of_surface"]


#: Least distance [m] of the grain line from darts and holes, and the steps [m] in which it is moved aside.
GRAIN_CLEAR, GRAIN_STEP = 0.008, 0.010


def check_edge_names(surfaces: Iterable[Surface], rules: EdgeRules, *, cuts: Iterable[str] = ()) -> None:
    """Check that every name in the rules can be an edge's, before anything is flattened.

    Lines along the border name the edges, holes are numbered. Where corners split them shows only in the plane.
    Therefore "bottom_2" passes if there is a bottom, and "edge_7" if there is a stretch of border without a line.

    Args:
        surfaces: with their lines, cut as they are going to be.
        rules: as of :func:`pattern_of_surface`.
        cuts: names of the cuts, for the legs of their darts.

    Raises:
        InputError: a name that no piece can have (gives the nearest).
    """
    legs = "|".join(map(re.escape, ["dart", *cuts]))
    edges: dict[str, list[str]] = {}
    for surface in surfaces:
        loops = border_loops(surface.faces)
        lines = {label for loop in loops for label in line_labels(loop, surface.lines)}
        names = {line or "edge" for line in lines}
        later = re.compile(rf"({'|'.join(map(re.escape, sorted(names)))})_\d+|({legs})(_\d+)?\.(left|right)")
        asked = {name.removeprefix(f"{surface.name}.") for name in (*rules.kinds, *rules.allowances)}
        known = {line or "edge_1" for line in lines} | {name for name in asked if later.fullmatch(name)}
        known |= {f"hole_{number}" for number in range(1, len(loops))}
        edges.setdefault(surface.name, []).extend(sorted(known))
    rules.check(edges)


def pattern_of_surface(
    results: Sequence[Flattening],
    *,
    name: str,
    rules: EdgeRules | None = None,
    size: str = "",
    seams: Sequence[NamedSeam] = (),
) -> tuple[Garment, tuple[str, ...]]:
    """Make the pattern of one flattened surface, or of the pieces into which cuts have parted it.

    A cut with one tip inside becomes a dart of its name, one with two tips a fish-eye dart; their tips are moved back
    as the cut asks for. A cut that parts the surface is a seam between the two pieces.

    Args:
        results: pieces of different names.
        name: of the pattern.
        rules: kinds and allowances of edges and holes; an edge along a feature line has the line's name, others are
            called "edge_1" and so on, counter-clockwise.
        size: for the label.
        seams: of the border, by the lines that are sewn to each other.

    Returns:
        The pattern, and what was chosen on the way, one sentence each: names of edges that no piece has are left out.

    Raises:
        InputError: the rules have an unknown kind, a border crosses itself, a crack overlaps, its tip is moved back too
            far, or a named seam's side is no edge.
    """
    rules = rules or EdgeRules()
    pieces = [_piece(result, size) for result in results]
    named = [_named_seam(seam, results, pieces) for seam in seams]
    names = {p.name: [*(edge.name for edge in p.edges), *(hole.name for hole in p.holes)] for p in pieces}
    rules, notes = rules.known(names)
    notes = (
        *notes,
        *(
            f"cut {quote_value(title)} opens by less than {1e3 * CLOSED:g} mm: the pattern is whole there, with a line"
            for result in results
            for title in _closed_cuts(result)
        ),
    )
    rules.check(names)
    pieces = [
        replace(
            piece,
            edges=[_apply_rules(piece.name, edge, rules) for edge in piece.edges],
            holes=[_apply_rules_to_hole(piece.name, hole, rules) for hole in piece.holes],
        )
        for piece in pieces
    ]
    return Garment(name=name, pieces={size: pieces}, seams=_seams(results, pieces, rules, named)), notes


def _piece(result: Flattening, size: str) -> Piece:
    """Return one piece with its cuts as darts, and its grain."""
    darts: dict[str, tuple[int, int, int]] = {}
    fisheyes: dict[str, Cut] = {}
    tip_back = {title: cut.tip_back for title, cut, _ in seams_of_cuts(result)}
    closed = _closed_cuts(result)
    faces, lines = result.faces, dict(result.network.surface.lines)
    if closed:
        faces, lines = close_cuts(faces, lines, closed, count=len(result.positions))
    loops = border_loops(faces)
    for title, _, seam in seams_of_cuts(result):
        kind = seam_kind(seam)
        if title in closed:
            continue
        if kind == "fish-eye":
            fisheyes[title] = seam
        elif kind == "dart" and (places := _dart_places(loops, seam)) is not None:
            darts[title] = places
    piece = piece_from_mesh(
        faces,
        result.positions,
        name=result.surface.name,
        features=MeshFeatures(
            lines=lines,
            darts=darts,
            fisheyes={title: np.union1d(seam.left, seam.right) for title, seam in fisheyes.items()},
        ),
        size=size,
        fabric=result.fabric.name,
    )
    for title in [title for title in (*darts, *fisheyes) if tip_back[title] > 0]:
        try:
            if title in darts:
                piece = _shorten_dart(piece, title, tip_back[title])
            else:
                piece = _shorten_fisheye(piece, title, fisheyes[title], result.positions, tip_back[title])
        except InputError as reason:
            raise InputError(f"piece {piece.name!r}: dart {title!r}: {reason}") from None
    drawn = [
        replace(dart, cut=are_curved(piece.edge(dart.left).points, piece.edge(dart.right).points))
        for dart in piece.darts
    ]
    on_border = np.isin(result.datum, np.concatenate(loops)).mean() > 0.5
    datum = None if on_border else result.positions[result.datum]
    grain = _clear_of_holes(grain_of(piece.outline, result, datum), piece)
    return replace(piece, darts=drawn, grain=grain)


def _closed_cuts(result: Flattening) -> dict[str, Cut]:
    return {title: seam for title, _, seam in seams_of_cuts(result) if are_closed(result.positions, seam)}


def _clear_of_holes(grain: FloatArray, piece: Piece) -> FloatArray:
    """Move the grain line aside as far as it takes to keep off holes and fish-eye darts."""
    import shapely

    along = (grain[1] - grain[0]) / np.linalg.norm(grain[1] - grain[0])
    across = np.array([along[1], -along[0]])
    free = shapely.Polygon(piece.outline, [hole.points for hole in piece.holes]).buffer(-GRAIN_CLEAR)
    for step in range(31):
        for side in (1, -1):
            moved = grain + side * step * GRAIN_STEP * across
            if free.contains(shapely.LineString(moved)):
                return moved
    return grain


def _shorten_dart(piece: Piece, title: str, tip_back: float) -> Piece:
    """Move the tip of a dart back by `tip_back` [m] from the end of its cut."""
    left, right = piece.edge(f"{title}.left"), piece.edge(f"{title}.right")
    legs = pull_back(left.points, right.points[::-1], tip_back)
    moved = {left.name: legs[0], right.name: legs[1][::-1]}
    edges = [replace(edge, points=moved.get(edge.name, edge.points)) for edge in piece.edges]
    return replace(piece, edges=edges)


def _shorten_fisheye(piece: Piece, title: str, seam: Cut, positions: FloatArray, tip_back: float) -> Piece:
    """Move both tips of a fish-eye dart back by `tip_back` [m] from the ends of its cut."""
    station = fish_eye_measure(positions, seam.left, seam.right).station
    left, right = pull_back_eye(positions[seam.left], positions[seam.right], station, tip_back)
    ring = np.concatenate([right[:-1], left[:0:-1]])
    return replace(piece, holes=[replace(h, points=ring) if h.name == title else h for h in piece.holes])


def _dart_places(loops: Sequence[IntArray], cut: Cut) -> tuple[int, int, int] | None:
    """Return left mouth, tip and right mouth of a dart, counter-clockwise; None where it does not open at a border."""
    at_end = cut.left[-1] == cut.right[-1]
    tip = int(cut.left[-1] if at_end else cut.left[0])
    mouths = [int(side[0] if at_end else side[-1]) for side in (cut.left, cut.right)]
    for loop in loops:
        where = {vertex: place for place, vertex in enumerate(loop.tolist())}
        if all(vertex in where for vertex in (tip, *mouths)):
            first, second = sorted(mouths, key=lambda v: (where[tip] - where[v]) % len(loop))
            return first, tip, second
    return None


def _apply_rules(piece: str, edge: Edge, rules: EdgeRules) -> Edge:
    """Return an edge with the kind and the allowance that the rules give it."""
    if edge.kind == "dart":
        # For a dart that is cut away, not folded.
        return replace(edge, allowance=rules.allowance(piece, edge.name, "seam"))
    kind = rules.kind(piece, edge.name, edge.kind)
    return replace(edge, kind=kind, allowance=rules.allowance(piece, edge.name, kind))


def _apply_rules_to_hole(piece: str, hole: Hole, rules: EdgeRules) -> Hole:
    """Return a hole with the allowance that the rules give it."""
    if hole.kind == "dart":
        return hole
    kind = rules.kind(piece, hole.name, "seam")
    if kind not in ("seam", "hem", "cut"):
        raise InputError(f"kinds.{hole.name}: a hole cannot be of kind {kind!r}; give it 'seam', 'hem' or 'cut'")
    width = rules.allowance(piece, hole.name, kind)
    return replace(hole, allowance=DEFAULT_ALLOWANCE[kind] if width is None else width)


def _named_seam(seam: NamedSeam, results: Sequence[Flattening], pieces: Sequence[Piece]) -> Seam:
    """Return a named seam by the edges that its two lines have become; these run against each other."""
    first, second = (_edges_along(line, results, pieces) for line in seam.sides)
    back = tuple(replace(part, reversed=True) for part in reversed(second))
    return Seam(name=seam.name, sides=(first, back), ease=seam.ease)


def _edges_along(line: str, results: Sequence[Flattening], pieces: Sequence[Piece]) -> tuple[SeamSide, ...]:
    """Return the edges along a line, in order, as the border runs."""
    for result, piece in zip(results, pieces, strict=True):
        ids = result.network.surface.lines.get(line)
        if ids is None:
            continue
        own = [e for e in piece.edges if e.vertices is not None and e.kind != "dart" and np.isin(e.vertices, ids).all()]
        if sum(len(edge.points) - 1 for edge in own) != len(ids) - 1:
            continue
        ends = {int(edge.vertices[-1]) for edge in own if edge.vertices is not None}
        start = next((k for k, e in enumerate(own) if e.vertices is not None and int(e.vertices[0]) not in ends), 0)
        return tuple(SeamSide(piece=piece.name, edge=edge.name) for edge in own[start:] + own[:start])
    raise InputError(f"line {line!r} is no whole stretch of a piece's border; a cut or another line parts it")


def _seams(
    results: Sequence[Flattening], pieces: Sequence[Piece], rules: EdgeRules, named: Sequence[Seam]
) -> tuple[Seam, ...]:
    """Return the seams: those that are named, and pairs of edges that are one curve in space."""
    seams: list[Seam] = [*named]
    for edges in _edges_by_ends(results, pieces, named):
        for (first, curve), (second, other) in combinations(edges, 2):
            against = not _are_one(curve, other)
            if _are_one(curve, other[::-1] if against else other):
                name = first.edge.removesuffix(".left").removesuffix(".right")
                name = find_unused_name(name, {seam.name for seam in seams})
                sides = ((first,), (replace(second, reversed=against),))
                seams.append(Seam(name=name, sides=sides, ease=rules.ease.get(name, 0.0)))
    return tuple(seams)


def _are_one(curve: FloatArray, other: FloatArray) -> bool:
    return len(curve) == len(other) and bool(np.linalg.norm(curve - other, axis=1).max() < SAME_PLACE)


def _edges_by_ends(
    results: Sequence[Flattening], pieces: Sequence[Piece], named: Sequence[Seam]
) -> list[list[tuple[SeamSide, FloatArray]]]:
    """Group the edges that may be sewn by their two ends in space, each with its curve (#P by 3 [m])."""
    from scipy.spatial import cKDTree

    done = {(side.piece, side.edge) for seam in named for row in seam.sides for side in row}
    edges = [
        (SeamSide(piece=piece.name, edge=edge.name), result.network.surface.vertices[edge.vertices])
        for result, piece in zip(results, pieces, strict=True)
        for edge in piece.edges
        if edge.kind in ("seam", "cut") and edge.vertices is not None and (piece.name, edge.name) not in done
    ]
    if not edges:
        return []
    ends = np.array([curve[[0, -1]] for _, curve in edges]).reshape(-1, 3)
    place = join_labels(len(ends), *cKDTree(ends).query_pairs(SAME_PLACE, output_type="ndarray").T)
    groups: dict[tuple[int, ...], list[tuple[SeamSide, FloatArray]]] = {}
    for edge, here in zip(edges, np.sort(place.reshape(-1, 2), axis=1).tolist(), strict=True):
        groups.setdefault(tuple(here), []).append(edge)
    return list(groups.values())
