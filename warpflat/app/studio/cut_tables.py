"""From a picked line or two points to a table of a scene's `[[cuts]]`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from warpflat.app.scene.cuts import cut_of_dart
from warpflat.app.scene.load import Scene
from warpflat.app.studio.pick import Hit
from warpflat.app.studio.solve import Solution
from warpflat.core import FloatArray, InputError, IntArray, arc_lengths, find_unused_name, without_side
from warpflat.flat import Flattening, border_of
from warpflat.garment import is_part_of

__all__ = ["cut_along", "cut_between", "cuttable_lines", "rounded"]

# A point of a cut this near to the border means the border [m]; so near two points must lie to a line of a form.
_TO_BORDER, _TO_LINE = 0.015, 0.03
_WHOLE = (0.0, 1.0)
# A dart takes this share of its line unless a book or the user says otherwise.
_DART = 2 / 3


def cuttable_lines(solution: Solution, piece: str) -> dict[str, IntArray]:
    """Return the lines of a piece that run through it and not along its border only, as vertices of its uncut surface."""
    surface = solution.pieces[piece].surface
    border = _border(solution.pieces[piece])
    inside = {
        name: np.asarray(ids, dtype=np.int32)
        for name, ids in surface.lines.items()
        if not border.issuperset(np.asarray(ids).tolist())
    }
    if solution.plan is None:
        return inside
    known = solution.plan.mannequin.layout.lines
    found: dict[str, IntArray] = {}
    for name, ids in inside.items():
        line = next((line for line in known if is_part_of(name, line)), None)
        # What darts have left of a line is reported by its longest part.
        if line is not None and line not in found:
            found[line] = ids
    return found


def cut_along(solution: Solution, piece: str, line: str, part: tuple[float, float] | None = None) -> dict[str, Any]:
    """Return the table of a cut along a line.

    Args:
        solution: of the scene before.
        piece: its name.
        line: of :func:`cuttable_lines`.
        part: shares of the line's length; None for all of it on a surface, and on a form for the dart that a book has there, or a
            dart of two thirds of the line.

    Raises:
        InputError: a dart of a form would not begin at the border of its piece, or is too short.
    """
    if solution.plan is None:
        name = _unused(solution.scene, line)
        return {"name": name, "line": line, **({} if part is None or part == _WHOLE else {"part": _shares(part)})}
    row = cuttable_lines(solution, piece)[line]
    if part is None:
        # The dart that a pattern book has along the line, unless the piece has it already.
        form = solution.plan.form
        taken = {dart.place for dart in form.recipe.darts}
        darts = {
            (dart.piece, dart.line): dart
            for dart in reversed(form.usual_darts())
            if dart.place not in taken and dart.towards is None
        }
        left = line.removesuffix(" right") + " left"
        dart = darts.get((piece, line)) or darts.get((piece, left))
        if dart is not None:
            return cut_of_dart(dart)
        part = (1.0 - _DART, 1.0) if int(row[0]) not in _border(solution.pieces[piece]) else (0.0, _DART)
    arc = arc_lengths(solution.pieces[piece].surface.vertices[row])
    first, last = (int(np.abs(arc - share * arc[-1]).argmin()) for share in part)
    return _dart_table(solution, piece, line, row[first : last + 1])


def cut_between(solution: Solution, first: Hit, second: Hit) -> dict[str, Any]:
    """Return the table of a cut between two points; on a form, of the part of a line that runs by both.

    Raises:
        InputError: the points lie on two pieces, at one place, or on a form by no line.
    """
    if first.piece != second.piece:
        raise InputError(f"the points lie on two pieces, {first.piece} and {second.piece}; click both on one piece")
    if first.piece not in solution.pieces:
        raise InputError(f"{first.piece} is a piece of the cut that is tried; apply it or leave it first")
    piece, vertices = solution.pieces[first.piece], solution.pieces[first.piece].surface.vertices
    border, ends = np.array(sorted(_border(piece))), []
    for hit in (first, second):
        away = np.linalg.norm(vertices - hit.point, axis=1)
        # A click near the border means the border.
        near = border[np.argmin(away[border])]
        ends.append(int(near if away[near] <= _TO_BORDER else np.argmin(away)))
    if ends[0] == ends[1]:
        raise InputError("both points lie at one place; click two that lie further apart")
    if solution.plan is None:
        return {
            "name": _unused(solution.scene, "cut"), "from": rounded(vertices[ends[0]]), "to": rounded(vertices[ends[1]])
        }  # fmt: skip
    best: tuple[float, str, IntArray] | None = None
    for line, row in cuttable_lines(solution, first.piece).items():
        distances = [np.linalg.norm(vertices[row] - vertices[end], axis=1) for end in ends]
        worst = max(float(distance.min()) for distance in distances)
        if worst <= _TO_LINE and (best is None or worst < best[0]):
            low, high = sorted(int(np.argmin(distance)) for distance in distances)
            best = worst, line, row[low : high + 1]
    if best is None:
        raise InputError(
            f"{first.piece}: no line runs within {100 * _TO_LINE:g} cm of both points; on a form darts lie along its lines"
        )
    return _dart_table(solution, first.piece, best[1], best[2])


def _dart_table(solution: Solution, piece: str, line: str, row: IntArray) -> dict[str, Any]:
    """Return the table of the dart, or the seam, that slits a row of vertices of a form's piece."""
    plan = solution.plan
    assert plan is not None
    if len(row) < 2:
        raise InputError(f"{piece}: the part of {line!r} holds no edge of the mesh; take a longer one")
    ends = row if int(row[0]) in _border(solution.pieces[piece]) else row[::-1]
    base = without_side(line)
    dart = plan.form.dart_along(piece, plan.form.pieces[piece].grid_vertices[ends], base)
    if dart is None:
        raise InputError(
            f"{piece}: a dart along {line!r} must begin at an edge of the piece, where no other dart lies; "
            "let the part begin or end there"
        )
    name = f"{base} seam" if dart.parts_piece else f"{base} dart"
    table = cut_of_dart(replace(dart, name=_unused(solution.scene, name, piece)))
    return {**table, "part": _shares(table["part"])}


def _border(piece: Flattening) -> set[int]:
    return set(border_of(piece.surface).tolist())


def rounded(point: FloatArray) -> list[float]:
    """Return a point [m] to the micrometre, as a scene has it."""
    return [round(float(value), 6) for value in point]


def _shares(part: Sequence[float]) -> list[float]:
    return [round(share, 4) for share in part]


def _unused(scene: Scene, name: str, piece: str | None = None) -> str:
    """Return a name that no cut of the scene, or of the piece, has yet."""
    return find_unused_name(
        name, {table.name or str(table.line) for table in scene.settings.cuts if table.piece == piece}
    )
