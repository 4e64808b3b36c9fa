"""Patterns written as the JSON of GarmentCode: whole panels of straight and cubic edges, stitched edge by edge."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from pydantic_core import to_json
from scipy.spatial.transform import Rotation

from warpflat.core import FloatArray, arc_lengths, points_at_lengths, turning_angles
from warpflat.pattern.drafting.curves import CHORD, TOLERANCE, cubic_weights
from warpflat.pattern.drafting.drafted import DraftedGarment
from warpflat.pattern.drafting.pieces import Piece, Place, Seam, SeamSide
from warpflat.pattern.drafting.whole_pieces import whole_pieces
from warpflat.pattern.export.read_garmentcode import CENTIMETRES, LABELS
from warpflat.pattern.files.output import atomic_path

__all__ = ["garmentcode_json", "write_garmentcode"]

# No cubic differs in length from its line by more [m]. It strays from it no farther than fitted curves do from clean borders.
_LENGTH = 1e-5
# Corners inside an edge turn by more than this [rad]. Ends of edges on both sides of a seam that are nearer than this [m] are stitched
# to each other, and no edge is split into shorter ones.
_CORNER, _SHORTEST = np.radians(25.0), 4e-3
# Rounds in which a cubic's parameters are brought nearer to its points.
_ROUNDS = 4
# Points at least to which a cubic is fitted.
_FEWEST = 25
# A piece without a place hangs this far in front of one that it is sewn to, or beside the body [m].
_BEFORE, _ASIDE = 0.05, 1.0


def write_garmentcode(
    garment: DraftedGarment, path: str | os.PathLike[str], *, size: str | None = None
) -> tuple[str, ...]:
    """Write :func:`garmentcode_json`; the file appears whole or not at all. Return what it leaves out, one sentence each."""
    data, notes = garmentcode_json(garment, size=size)
    with atomic_path(path) as temporary:
        temporary.write_bytes(to_json(data, indent=1) + b"\n")
    return notes


def garmentcode_json(garment: DraftedGarment, *, size: str | None = None) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Return a pattern in one size as GarmentCode has it, in centimetres, and what it leaves out, one sentence each.

    Panels are whole and have no allowance: halves are unfolded, and pairs are there twice. Both sides of a seam are split at the same
    places, since a stitch joins one edge to one: at corners, at the ends of edges, and where one cubic would not keep to the line.
    `name` of an edge, `seam` and `reversed` of a stitch, `open`, and of a panel `grain`, `placed` and what is cut of it are the
    package's own keys, which other programs pass over.

    Raises:
        InputError: an unknown size, or a piece that cannot be unfolded.
    """
    chosen = garment.of_sizes([garment.sample if size is None else size])
    left_out = [
        f"{piece.name}: GarmentCode knows no {what}: {', '.join(names)} left out"
        for piece in chosen
        for what, names in (("holes", [*piece.cutouts, *piece.fisheyes]), ("lines inside", piece.internal_lines))
        if names
    ]
    # Pieces are along their drawn lines, in their plane, without what GarmentCode does not know.
    drawn = list[Piece]()
    for drafted in chosen:
        own, frame = drafted.piece, np.vstack([drafted.frame, [0.0, 0.0, 1.0]])
        drawn.append(
            replace(
                own,
                edges=[replace(edge.edge, points=edge.line, vertices=None) for edge in drafted.edges],
                holes=(),
                internal_lines={},
                marks={},
                grain=drafted.grain,
                placement=None if own.placement is None else own.placement @ np.linalg.inv(frame),
            )
        )
    pieces, seams, _ = whole_pieces(drawn, garment.pattern.seams, unsewn=True)
    lines = {(name, edge.name): edge.points for name, piece in pieces.items() for edge in piece.edges}
    stitched, splits, notes = _stitched(pieces, seams, lines)
    left_out += notes
    number: dict[tuple[Place, float], int] = {}
    panels: dict[str, Any] = {}
    places = _places(pieces, seams, lines)
    for name, piece in pieces.items():
        parts = [
            split for edge in piece.edges for split in sorted(splits[name, edge.name], key=lambda each: each.begin)
        ]
        number |= {(split.key, split.begin): k for k, split in enumerate(parts)}
        panels[name] = _panel(piece, parts, places[name])
    stitches = []
    for both, seam in stitched:
        sides: list[Any] = [
            {"panel": each.key[0], "edge": number[each.key, each.begin], "seam": seam, "reversed": each.reversed}
            for each in both
        ]
        stitches.append([*sides, "right_wrong"] if both[0].reversed == both[1].reversed else sides)
    opened = _openings(stitches, {name: len(panel["vertices"]) for name, panel in panels.items()})
    for at in opened:
        (first, second), ends = stitches[at][:2], stitched[at][0]
        length = float(arc_lengths(cubic_weights(np.linspace(0.0, 1.0, 101)) @ ends[0].control)[-1])
        left_out.append(
            f"seam {first['seam']!r} is open over {1e3 * length:.0f} mm between {first['panel']} and {second['panel']}: "
            "the ends of a piece meet there in a point, which GarmentCode does not sew"
        )
    pattern: dict[str, Any] = {
        "panels": panels,
        "stitches": [stitch for at, stitch in enumerate(stitches) if at not in opened],
        "panel_order": list(panels),
    }
    if opened:
        pattern["open"] = [{"at": at, "stitch": stitches[at]} for at in opened]
    properties = {
        "curvature_coords": "relative",
        "normalize_panel_translation": False,
        "normalized_edge_loops": True,
        "units_in_meter": int(CENTIMETRES),
    }
    return {"pattern": pattern, "parameters": {}, "parameter_order": [], "properties": properties}, tuple(left_out)


def _stitched(
    pieces: Mapping[str, Piece], seams: Sequence[Seam], lines: Mapping[Place, FloatArray]
) -> tuple[list[tuple[tuple[_Split, ...], str]], dict[Place, list[_Split]], list[str]]:
    """Split all edges: return which parts are stitched to each other, with their seam, all parts by edge, and what is left out."""
    pleats = {f"{name}.{dart.name}": dart.pleat for name, piece in pieces.items() for dart in piece.darts}
    splits: dict[Place, list[_Split]] = {key: [] for key in lines}
    stitched, sewn, left_out = list[tuple[tuple[_Split, ...], str]](), set[Place](), list[str]()
    for seam in seams:
        edges = {side.place for side in seam.stretches}
        if sewn & edges:
            left_out.append(
                f"seam {seam.name!r}: one of its edges is in another seam, and GarmentCode stitches an edge once: left out"
            )
            continue
        sewn |= edges
        depth = pleats.get(seam.name)
        for row in _divide([_Strand.of(chain, lines) for chain in seam.sides], seam, depth):
            for split in row:
                splits[split.key].append(split)
            if depth is None or row[0].at < depth:
                stitched.append((row, seam.name))
    for key in lines.keys() - sewn:
        strand = _Strand.of([SeamSide(piece=key[0], edge=key[1])], lines)
        splits[key] = [split for (split,) in _divide([strand], None, None)]
    return stitched, splits, left_out


def _panel(piece: Piece, parts: Sequence[_Split], place: FloatArray) -> dict[str, Any]:
    """Return the entry of a piece whose outline is some parts, in order, and which hangs at a place."""
    corners, edges = np.array([split.control[0] for split in parts]), list[dict[str, Any]]()
    for k, split in enumerate(parts):
        edges.append({"endpoints": [k, (k + 1) % len(parts)]})
        if split.is_curved:
            chord = split.control[3] - split.control[0]
            axes = np.stack([chord, [-chord[1], chord[0]]]) / (chord @ chord)
            params = ((split.control[1:3] - split.control[0]) @ axes.T).tolist()
            edges[-1]["curvature"] = {"type": "cubic", "params": params}
        if label := LABELS.get(piece.levels.get(split.key[1], "")):
            edges[-1]["label"] = label
        edges[-1]["name"] = split.key[1]
    origin, turn = corners[0], np.column_stack([place[:, :2], np.cross(place[:, 0], place[:, 1])])
    return {
        "translation": (CENTIMETRES * (place @ [*origin, 1.0])).tolist(),
        "rotation": Rotation.from_matrix(turn).as_euler("xyz", degrees=True).tolist(),
        "vertices": (CENTIMETRES * (corners - origin)).tolist(),
        "edges": edges,
        "grain": None if piece.grain is None else (CENTIMETRES * (piece.grain - origin)).tolist(),
        "placed": piece.placement is not None,
        **{key: getattr(piece, key) for key in ("fabric", "quantity", "paired", "also")},
    }


def _openings(stitches: Sequence[Sequence[Any]], corners: Mapping[str, int]) -> list[int]:
    """Return which stitches are left open, so that no two corners of a panel meet but those that a stitch of the panel with itself joins.

    Such corners are the ends of a waistband that goes around to where it began. A stitch of other panels between them is opened,
    as a zip would be.
    """
    opened: list[int] = []
    for _ in stitches:
        # The corners that each stitch brings together.
        links: dict[tuple[str, int], list[tuple[tuple[str, int], int]]] = {}
        itself: set[frozenset[tuple[str, int]]] = set()
        for number, (first, second, *word) in enumerate(stitches):
            if number in opened:
                continue
            (a, i), (b, j) = ((side["panel"], side["edge"]) for side in (first, second))
            ends = ((a, i), (a, (i + 1) % corners[a])), ((b, j), (b, (j + 1) % corners[b]))
            for one, other in zip(ends[0], ends[1] if word else ends[1][::-1], strict=True):
                links.setdefault(one, []).append((other, number))
                links.setdefault(other, []).append((one, number))
                itself |= {frozenset((one, other))} if a == b else set()
        found = None
        for start in links:
            # Breadth first over all that meets in this corner, with the stitches on the way.
            ways: dict[tuple[str, int], list[int]] = {start: []}
            for corner in (reached := [start]):
                for other, number in links[corner]:
                    if other not in ways:
                        ways[other] = [*ways[corner], number]
                        reached.append(other)
            same = [corner for corner in reached if corner[0] == start[0]]
            sewn = any(frozenset((start, corner)) in itself for corner in same)
            if len(same) > 1 and not sewn:
                found = ways[same[1]], start[0]
                break
        if found is None:
            break
        way, panel = found
        others = [number for number in way if panel not in (stitches[number][0]["panel"], stitches[number][1]["panel"])]
        opened.append((others or way)[0])
    return sorted(opened)


@dataclass(frozen=True, eq=False)
class _Split:
    """A part of an edge that is one edge of the file.

    Attributes:
        key: piece and edge.
        begin: where it begins on the edge, in the edge's own direction [m].
        at: where it begins on its seam [m].
        reversed: whether the seam runs against the edge.
        control: 4 by 2, its cubic in the edge's own direction [m].
        is_curved: whether it is no straight line.
    """

    key: Place
    begin: float
    at: float
    reversed: bool
    control: FloatArray
    is_curved: bool


@dataclass(frozen=True, eq=False)
class _Strand:
    """A side of a seam as one line.

    Attributes:
        sides: its edges.
        points: #P by 2 per edge [m], in the seam's direction; each edge in the plane of its own piece.
        ends: #E + 1, where edges begin and end [m].
        corners: where it may not be passed over [m]: at the ends and at corners inside edges.
    """

    sides: Sequence[SeamSide]
    points: Sequence[FloatArray]
    ends: FloatArray
    corners: FloatArray

    @classmethod
    def of(cls, chain: Sequence[SeamSide], lines: Mapping[Place, FloatArray]) -> _Strand:
        points = [lines[side.piece, side.edge][:: -1 if side.reversed else 1] for side in chain]
        arcs = [arc_lengths(line) for line in points]
        ends = np.concatenate([[0.0], np.cumsum([arc[-1] for arc in arcs])])
        turns = [
            begin + arc[1:-1][np.abs(turning_angles(line)) > _CORNER]
            for begin, arc, line in zip(ends[:-1], arcs, points, strict=True)
        ]
        return cls(sides=chain, points=points, ends=ends, corners=np.unique(np.concatenate([ends, *turns])))

    def split(self, low: float, high: float) -> tuple[_Split, float]:
        """Return the part between two lengths, and how far its cubic is off, over what is allowed."""
        number = int(np.clip(np.searchsorted(self.ends, 0.5 * (low + high)) - 1, 0, len(self.sides) - 1))
        side, line = self.sides[number], self.points[number]
        arc = arc_lengths(line)
        a, b = np.clip([low - self.ends[number], high - self.ends[number]], 0.0, arc[-1])
        inside = arc[(arc > a + 1e-9) & (arc < b - 1e-9)]
        steps = np.unique(np.concatenate([inside, np.linspace(a, b, _FEWEST)]))
        control, off = _cubic(points_at_lengths(line, steps))
        chord = control[0] + np.linspace(0.0, 1.0, 4)[:, None] * (control[3] - control[0])
        curved = bool(np.abs(control - chord).max() > CHORD)
        if side.reversed:
            control, a = control[::-1], float(arc[-1]) - b
        found = _Split(
            key=side.place,
            begin=float(a),
            at=low,
            reversed=side.reversed,
            control=control,
            is_curved=curved,
        )
        return found, off


def _divide(strands: Sequence[_Strand], seam: Seam | None, depth: float | None) -> list[tuple[_Split, ...]]:
    """Divide the sides of a seam at the same places, and fit a cubic to each part; a strand alone is an edge that is not sewn."""
    first, last = strands[0], strands[-1]
    own = first.corners if depth is None else np.union1d(first.corners, [min(depth, first.ends[-1])])
    whole, other = float(first.ends[-1]), float(last.ends[-1])
    along = np.linspace(0.0, whole, 2001)
    across = along if seam is None else np.array([seam.reach(t, whole) for t in along])
    across = across * (other / across[-1])
    # Marks of both sides in their order; those nearer than an edge may be short are one.
    marks = [(t, float(np.interp(t, along, across))) for t in own.tolist()]
    for t in last.corners.tolist():
        place = float(np.interp(t, across, along))
        near = min(range(len(marks)), key=lambda k: abs(marks[k][0] - place))
        at_end = min(t, other - t) <= 0.0
        if abs(marks[near][0] - place) < _SHORTEST or at_end:
            marks[near] = marks[near][0], t
        else:
            marks = sorted([*marks, (place, t)])
    rows, todo = list[tuple[_Split, ...]](), list(pairwise(marks))[::-1]
    while todo:
        (a, c), (b, d) = todo.pop()
        found = [strand.split(*ends) for strand, ends in zip(strands, ((a, b), (c, d)), strict=False)]
        if max(off for _, off in found) > 1.0 and min(b - a, d - c) > 2.0 * _SHORTEST:
            middle = 0.5 * (a + b), 0.5 * (c + d)
            todo += [(middle, (b, d)), ((a, c), middle)]
        else:
            rows.append(tuple(split for split, _ in found))
    return rows


def _cubic(points: FloatArray) -> tuple[FloatArray, float]:
    """Fit a cubic (4 by 2) to points (#P by 2 [m]) with the same ends.

    Return it, and by how much place or length are off, over what is allowed.

    Least squares in the two inner control points, whose parameters are brought nearer by Newton's method (Schneider 1990).
    """
    arc = arc_lengths(points)
    chord = points[-1] - points[0]
    straight = points[0] + np.linspace(0.0, 1.0, 4)[:, None] * chord
    at, control = arc / arc[-1], straight
    for _ in range(_ROUNDS):
        weights = cubic_weights(at)
        inner = np.linalg.lstsq(weights[:, 1:3], points - weights @ straight, rcond=None)[0]
        control = straight + np.vstack([np.zeros(2), inner, np.zeros(2)])
        away = cubic_weights(at) @ control - points
        first, second = 3.0 * np.diff(control, axis=0), 6.0 * np.diff(control, n=2, axis=0)
        s = 1.0 - at
        speed = np.stack([s * s, 2.0 * s * at, at * at], axis=1) @ first
        bend = np.stack([s, at], axis=1) @ second
        slope = (speed * speed).sum(axis=1) + (away * bend).sum(axis=1)
        step = np.divide((away * speed).sum(axis=1), slope, out=np.zeros_like(at), where=slope > 0.0)
        at = np.clip(at - step, 0.0, 1.0)
    off = float(np.linalg.norm(cubic_weights(at) @ control - points, axis=1).max())
    length = float(arc_lengths(cubic_weights(np.linspace(0.0, 1.0, 201)) @ control)[-1])
    # A closed line has no chord to which its control points could be relative.
    closed = float(np.linalg.norm(chord)) < 0.1 * arc[-1]
    return control, np.inf if closed else max(off / TOLERANCE, abs(length - float(arc[-1])) / _LENGTH)


def _places(
    pieces: Mapping[str, Piece], seams: Sequence[Seam], lines: Mapping[Place, FloatArray]
) -> dict[str, FloatArray]:
    """Return where each piece hangs: its own place, before a piece that it is sewn to, or beside the body."""
    places = {name: piece.placement for name, piece in pieces.items() if piece.placement is not None}
    joined = [
        (
            (one.piece, lines[one.piece, one.edge].mean(axis=0)),
            (other.piece, lines[other.piece, other.edge].mean(axis=0)),
        )
        for seam in seams
        for k in range(max(map(len, seam.sides)))
        for one, other in [[side[min(k, len(side) - 1)] for side in seam.sides]]
    ]
    joined += [(other, one) for one, other in joined]
    for _ in pieces:
        for (name, middle), (beside, at) in joined:
            if name not in places and beside in places:
                near = places[beside]
                place = near @ [*at, 1.0] + _BEFORE * np.cross(near[:, 0], near[:, 1])
                places[name] = np.column_stack([near[:, :2], place - near[:, :2] @ middle])
    for count, name in enumerate(name for name in pieces if name not in places):
        places[name] = np.array([[1.0, 0.0, (1.0 + count) * _ASIDE], [0.0, 1.0, _ASIDE], [0.0, 0.0, 0.0]])
    return places
