"""Grade rules: how far each numbered point of the sample size moves in every other size, as AAMA and ASTM tables (`.rul`)."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import datetime

import numpy as np

from warpflat._version import __version__
from warpflat.core.arrays import FloatArray
from warpflat.core.output import atomic_path
from warpflat.core.polyline import arc_lengths, points_at_lengths
from warpflat.pattern.drafted import DraftedGarment, DraftedPiece

__all__ = ["GradePoint", "GradeRules", "grade_rules", "write_rul"]

#: Grade points between the corners of a curved edge, by their shares of its length.
_BETWEEN = (0.25, 0.5, 0.75)
#: An edge whose chord is shorter than it by less than this share is straight.
_STRAIGHT = 1e-4
#: Moves that differ by less than this [m] are one rule.
_SAME = 5e-6
#: Pairs in a line of a table.
_IN_LINE = 4


@dataclass(frozen=True, kw_only=True)
class GradePoint:
    """A graded point of the sample size.

    Attributes:
        at: its place [m] in the drafted piece.
        rule: number of its rule.
        layer: "2" on the boundary, "4" at a notch, "13" at a drill hole.
    """

    at: FloatArray
    rule: int
    layer: str


@dataclass(kw_only=True)
class GradeRules:
    """The rules of a garment, and its graded points.

    Attributes:
        sizes: in their order.
        sample: the size that is graded.
        moves: by rule, from 1 on: #sizes by 2 [m], from the sample size's point to each size's; x and y as drawn.
        points: by piece.
    """

    sizes: tuple[str, ...]
    sample: str
    moves: list[FloatArray] = field(default_factory=list)
    points: dict[str, list[GradePoint]] = field(default_factory=dict)

    def rule(self, moves: FloatArray) -> int:
        """Return the number of a rule, a new one if there is none alike."""
        for number, known in enumerate(self.moves, 1):
            if np.abs(known - moves).max() < _SAME:
                return number
        self.moves.append(moves)
        return len(self.moves)


def grade_rules(garment: DraftedGarment, sizes: Sequence[str]) -> GradeRules:
    """Return the grade rules of a nest: rule 1 moves nothing.

    Graded are the corners of the cutting line, places between them on curved edges, notches and drill holes; each is the same
    place in every size. A place that some size does not have is not graded.
    """
    sample = garment.garment.sample if garment.garment.sample in sizes else sizes[0]
    rules = GradeRules(sizes=tuple(sizes), sample=sample)
    rules.rule(np.zeros((len(sizes), 2)))
    for piece in garment.pieces[sample]:
        all_sizes = {each.size: each for each in garment.all_sizes(piece.name)}
        rows = [_places(all_sizes[size]) for size in sizes]
        own = rows[list(sizes).index(sample)]
        for key, at in own.items():
            if all(key in row for row in rows):
                moves = np.array([row[key] - at for row in rows])
                number = rules.rule(moves)
                rules.points.setdefault(piece.name, []).append(GradePoint(at=at, rule=number, layer=key[0]))
    return rules


def _places(piece: DraftedPiece) -> dict[tuple[str, str, float], FloatArray]:
    """Return the places of one piece that are graded, by layer, name and number."""
    import shapely

    found: dict[tuple[str, str, float], FloatArray] = {}
    ring = piece.cut_line
    line = shapely.LinearRing(ring)
    for edge in piece.edges:
        if edge.kind == "dart" and edge.width == 0:
            continue
        points = edge.line
        length = float(arc_lengths(points)[-1])
        chord = float(np.linalg.norm(points[-1] - points[0]))
        for share in (0.0, *(_BETWEEN if chord < length * (1.0 - _STRAIGHT) else ())):
            found["2", edge.name, share] = _on_cut_line(points, share, edge.width, ring, line)
    counts: dict[str, int] = {}
    for notch in piece.notches:
        for base in notch.base:
            number = counts[notch.seam] = counts.get(notch.seam, 0) + 1
            found["4", notch.seam, float(number)] = base
    for number, hole in enumerate(piece.drill_holes):
        found["13", hole.name, float(number)] = hole.at
    return found


def _on_cut_line(points: FloatArray, share: float, width: float, ring: FloatArray, line: object) -> FloatArray:
    """Return the place on the cutting line beside a place of the sewing line; at a corner its nearest corner."""
    import shapely

    assert isinstance(line, shapely.LinearRing)
    length = float(arc_lengths(points)[-1])
    at = points_at_lengths(points, [share * length])[0]
    if share == 0.0:
        around = np.vstack([ring[-1:], ring, ring[:1]])
        before, after = around[1:-1] - around[:-2], around[2:] - around[1:-1]
        turns = np.abs(
            np.arctan2(before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0], (before * after).sum(axis=1))
        )
        corners = ring[turns > np.radians(12.0)]
        near = corners[np.linalg.norm(corners - at, axis=1) < 4.0 * max(width, 0.012)] if len(corners) else corners
        if len(near):
            return np.asarray(near[np.linalg.norm(near - at, axis=1).argmin()])
    return np.asarray(line.interpolate(line.project(shapely.Point(at))).coords[0])


def write_rul(
    rules: GradeRules,
    path: str | os.PathLike[str],
    *,
    name: str,
    dialect: str,
    units: str,
    scale: float,
    created: datetime,
) -> None:
    """Write the table of grade rules; the file appears whole or not at all.

    Args:
        rules: of a nest.
        path: of the file.
        name: of the table, as the DXF names it.
        dialect: "aama" or "astm".
        units: "metric" or "english".
        scale: file units per metre.
        created: date and time for the file's text.
    """
    lines = [
        "ANSI/AAMA VERSION: 1.0.0" if dialect == "aama" else "ASTM/D13 Proposal 1 Version: D6673-10",
        "AUTHOR: warpflat",
        "PRODUCT: warpflat",
        f"VERSION: {__version__}",
        f"CREATION DATE: {created:%d-%m-%Y}",
        f"CREATION TIME: {created:%H:%M}",
        f"UNITS: {units.upper()}",
        f"GRADE RULE TABLE: {name}",
        f"NUMBER OF SIZES: {len(rules.sizes)}",
        f"SIZE LIST: {' '.join(size.replace(' ', '_') for size in rules.sizes)}",
        f"SAMPLE SIZE: {rules.sample.replace(' ', '_')}",
    ]
    for number, moves in enumerate(rules.moves, 1):
        lines.append(f"RULE: DELTA {number}")
        pairs = [f"{x:>10.3f},{y:>9.3f}" for x, y in (moves * scale + 0.0).tolist()]
        lines += ["".join(pairs[k : k + _IN_LINE]) for k in range(0, len(pairs), _IN_LINE)]
    lines.append("END")
    text = "\r\n".join(lines) + "\r\n"
    with atomic_path(path) as temporary:
        temporary.write_bytes(text.encode("ascii", "replace"))
