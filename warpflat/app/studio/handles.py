"""Points of a pattern that can be dragged in its plane, and what of the scene each changes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from warpflat.app.scene.cuts import asked_cuts, cut_of_dart, place_of
from warpflat.app.scene.plan import FormScenePlan
from warpflat.app.studio.cut_tables import rounded
from warpflat.app.studio.solve import Solution
from warpflat.core import FloatArray, arc_lengths, unit
from warpflat.flat import Crack, border_of, seam_kind, triangulate
from warpflat.garment import FormDart, Mesh, Neckline, PlacedDart
from warpflat.pattern import unnumbered

__all__ = ["Handle", "pattern_handles"]

# The shortest dart that a tip is dragged to, and the narrowest mouth [m].
_SHORTEST, _NARROWEST = 0.01, 0.001
# Points that can be dragged lie further apart than this [m].
_APART = 0.004
# A tip inside a piece stays this share of its line away from the line's ends.
_INSIDE = 0.02
# Of the ease at a level this share lies at one edge of one piece, by the first word of the edge's name: a side seam joins two of four
# edges, an underarm seam two of two.
_SHARE_OF_EASE = {"side": 0.25, "outseam": 0.25, "underarm": 0.5}


@dataclass(frozen=True, kw_only=True, eq=False)
class Handle:
    """A point of a pattern that can be dragged.

    Attributes:
        name: what is dragged, as "tip of bust dart left".
        piece: whose pattern it is in.
        place: 2, in that pattern [m].
        change: returns the tables of the scene that change, for the place that it is dragged to (2 [m]).
    """

    name: str
    piece: str
    place: FloatArray
    change: Callable[[FloatArray], dict[str, Any]]


def pattern_handles(solution: Solution) -> list[Handle]:
    """Return what can be dragged: tips and mouths of darts; on a form points of side seams and necklines too."""
    plan = solution.plan
    if plan is None:
        return list(_of_cuts(solution))
    found = list[Handle]()
    for name in plan.form.pieces:
        flat = np.asarray(solution.pieces[name].positions)
        of_piece = list[Handle]()
        for handles in (_of_darts, partial(_of_sides, solution), _of_neckline):
            # Where a dart opens at a level of the side seam, its mouth is what is dragged.
            of_piece += [
                each
                for each in handles(plan, name, flat)
                if all(np.linalg.norm(each.place - other.place) > _APART for other in of_piece)
            ]
        found += of_piece
    # A shape that was chosen by itself stays as it was chosen.
    shape = plan.scene.settings.shape
    if shape == solution.scene.settings.shape:
        return found

    def in_shape(handle: Handle, to: FloatArray) -> dict[str, Any]:
        return {"shape": shape, **handle.change(to)}

    return [replace(each, change=partial(in_shape, each)) for each in found]


def _slid(
    name: str, piece: str, place: FloatArray, direction: FloatArray, change: Callable[[float], dict[str, Any]]
) -> Handle:
    """Return a handle of which only the way along a direction counts: `change` is called with it [m]."""
    return Handle(name=name, piece=piece, place=place, change=lambda to: change(float((to - place) @ direction)))


def _of_darts(plan: FormScenePlan, name: str, flat: FloatArray) -> Iterator[Handle]:
    """A tip goes along its dart's line; the ends of a mouth make the dart wider or narrower."""
    form = plan.form
    placed = {dart.name: dart for dart in form.darts if dart.piece == name}
    for dart_name, (left, right) in form.pieces[name].legs().items():
        dart = placed[dart_name]
        if dart.asked.pleat_mm is not None:
            continue
        part = form.dart_part(dart)
        two_tips = dart_name in form.pieces[name].fisheyes
        mouth, width = form.pieces[name].mouth(dart_name, flat)
        axis = unit(flat[left[-1]] - 0.5 * (flat[left[0]] + flat[right[0]]))
        # The upper tip may be the first one of the row, or the last.
        ends = form.vertices[dart.row[[0, -1]], 1]
        for end in (0, 1) if two_tips else (1,):
            change = partial(_move_tip, plan, dart, part, end)
            what = "tip" if not two_tips else "upper tip" if ends[end] == ends.max() else "lower tip"
            yield _slid(f"{what} of {dart_name}", name, flat[left[-end]], axis, change)
        for side, leg, other in (("left", left, right), ("right", right, left)):
            place = flat[leg[mouth]]
            wider = partial(_widen_mouth, plan, dart, width)
            across = np.array([-axis[1], axis[0]])
            across *= 1.0 if across @ (place - flat[other[mouth]]) >= 0.0 else -1.0
            yield _slid(f"mouth of {dart_name}, {side}", name, place, across, wider)


def _move_tip(
    plan: FormScenePlan, dart: PlacedDart, part: tuple[float, float], end: int, moved: float
) -> dict[str, Any]:
    """Return the cuts with one end of a dart further along its line."""
    length = float(arc_lengths(plan.form.vertices[dart.row])[-1])
    moved = max(moved, _SHORTEST - length) if end else min(moved, length - _SHORTEST)
    asked = dart.asked
    two_tips = not {0.0, 1.0} & set(part)
    if asked.part is None and not two_tips:
        # A bust point, or a waist, is what it was measured from.
        tip = length + moved if dart.to_point is None else max(dart.to_point - moved, 0.0)
        return _with_darts(plan, replace(asked, tip_mm=round(1e3 * tip, 1)))
    ends = [round(share, 4) for share in part]
    ends[end] += moved * (part[1] - part[0]) / length
    ends[end] = round(float(np.clip(ends[end], _INSIDE, 1.0 - _INSIDE)), 4)
    return _with_darts(plan, replace(asked, part=(ends[0], ends[1]), tip_mm=None))


def _widen_mouth(plan: FormScenePlan, dart: PlacedDart, width: float, moved: float) -> dict[str, Any]:
    """Return the cuts with a dart whose mouth opens wider by twice what one of its ends was moved."""
    mouth = max(width + 2.0 * moved, _NARROWEST)
    return _with_darts(plan, replace(dart.asked, mouth_mm=round(1e3 * mouth, 1), like=None))


def _with_darts(plan: FormScenePlan, *darts: FormDart) -> dict[str, Any]:
    """Return the cuts of a scene with darts as they are asked for now."""
    cuts = asked_cuts(plan.scene)
    for dart in darts:
        at = next((k for k, table in enumerate(cuts) if place_of(table) == dart.place), len(cuts))
        cuts[at : at + 1] = [cut_of_dart(dart)]
    return {"cuts": cuts}


def _of_sides(solution: Solution, plan: FormScenePlan, name: str, flat: FloatArray) -> Iterator[Handle]:
    """A point of a side seam at a level gives the garment more or less ease there; darts there stay as wide as they are."""
    piece, layout = plan.form.pieces[name], plan.mannequin.layout
    asked = plan.scene.settings.ease
    table = {} if asked is None else {"preset": asked} if isinstance(asked, str) else dict(asked)

    def change(level: str, ease: float, share: float, moved: float) -> dict[str, Any]:
        # Left free, the darts would close by as much as the cloth grows, and the seam would hardly move.
        held, row = dict[tuple[str | None, ...], FormDart](), layout.lines.get(level, ())
        for own, form in plan.form.pieces.items():
            lies = np.asarray(solution.pieces[own].positions)
            placed = {dart.name: dart.asked for dart in plan.form.darts if dart.piece == own}
            for dart_name, (left, _) in form.legs().items():
                dart, (mouth, width) = placed[dart_name], form.mouth(dart_name, lies)
                # Those that are widest at the level, and as wide as the cloth wants.
                if dart.mouth_mm is None and dart.pleat_mm is None and form.grid_vertices[left[mouth]] in row:
                    held[dart.place] = replace(dart, mouth_mm=round(1e3 * width, 1), like=None)
        cuts = _with_darts(plan, *held.values()) if held else {}
        return {**cuts, "ease": {**table, level: round(ease + 100.0 * moved / share, 1)}}

    for edge, ids in piece.edges.items():
        share = _SHARE_OF_EASE.get(edge.split(" ")[0])
        for level, ease in plan.form.ease.items() if share is not None else ():
            at = np.flatnonzero(np.isin(piece.grid_vertices[ids], layout.lines.get(level, ())))
            if len(at) == 1 and share is not None:
                before, after = max(int(at[0]) - 1, 0), min(int(at[0]) + 1, len(ids) - 1)
                along = unit(flat[ids[after]] - flat[ids[before]])
                # Edges run counter-clockwise, so that what is outside lies to their right.
                yield _slid(
                    f"{unnumbered(edge)} at the {level}", name, flat[ids[at[0]]], np.array([along[1], -along[0]]),
                    partial(change, level, ease, share),
                )  # fmt: skip


def _of_neckline(plan: FormScenePlan, name: str, flat: FloatArray) -> Iterator[Handle]:
    """Points of the neckline on centre lines and shoulder seams make it deeper or wider."""
    piece, form = plan.form.pieces[name], plan.scene.settings.form
    now = asdict((plan.form.recipe.neckline or Neckline()).in_cm(plan.mannequin.layout, plan.form.body))
    now = {key: value for key, value in now.items() if not key.endswith("share")}
    neck = {vertex for edge, ids in piece.edges.items() if edge.split(" ")[0] == "neck" for vertex in ids.tolist()}

    def change(key: str, moved: float) -> dict[str, Any]:
        low, high = Neckline.ranges()[key]
        depth = round(min(max(now[key] + 100.0 * moved, low), high), 1)
        table = {"like": form} if isinstance(form, str) else dict(form or {})
        return {"form": {**table, "neckline": {**now, key: depth}}}

    for line, ids in piece.surface.lines.items():
        row: Sequence[int] = np.asarray(ids).tolist()
        word = "shoulder" if line.startswith("shoulder ") else line
        key = {"centre front": "front_cm", "centre back": "back_cm", "shoulder": "side_cm"}.get(word)
        row = row if row[0] in neck else row[::-1]
        if key is not None and row[0] in neck and len(row) > 2:
            along = unit(flat[row[2]] - flat[row[0]])
            yield _slid(f"neckline at the {line}", name, flat[row[0]], along, partial(change, key))


def _of_cuts(solution: Solution) -> Iterator[Handle]:
    """On a mesh a tip goes along its line, or anywhere if the cut runs between points; a mouth goes along the border."""
    (name,) = solution.pieces
    piece, scene = solution.pieces[name], solution.scene
    flat, tables = np.asarray(piece.positions), [table.name or table.line for table in scene.settings.cuts]
    for made in piece.cuts:
        # A cut of several tables, or in a plane, has no end of its own in the scene.
        if tables.count(made.name) != 1 or len(made.seams) != 1:
            continue
        number, seam = tables.index(made.name), made.seams[0]
        if scene.settings.cuts[number].plane is not None or seam_kind(seam) == "parting":
            continue
        for end in (0, -1):
            what = "tip" if seam.left[end] == seam.right[end] else "mouth"
            for side, leg in (("", seam.left),) if what == "tip" else ((", left", seam.left), (", right", seam.right)):
                place = flat[leg[end]]
                change = partial(_move_end, solution, number, seam, end, place)
                yield Handle(name=f"{what} of {made.name}{side}", piece=name, place=place, change=change)


def _move_end(
    solution: Solution, number: int, seam: Crack, end: int, start: FloatArray, to: FloatArray
) -> dict[str, Any]:
    """Return the cuts with one end of the cut of a number dragged from one place of the plane to another."""
    (piece,) = solution.pieces.values()
    surface, flat = piece.surface, np.asarray(piece.positions)
    cuts = asked_cuts(solution.scene)
    table = cuts[number]
    is_tip = seam.left[end] == seam.right[end]
    if is_tip and "line" in table:
        arc = arc_lengths(surface.vertices[np.asarray(surface.lines[table["line"]])])
        share = {vertex: float(s / arc[-1]) for vertex, s in zip(surface.lines[table["line"]], arc, strict=True)}
        tip, other = share[int(seam.path[end])], share[int(seam.path[-1 - end])]
        axis = unit(start - 0.5 * (flat[seam.left[-1 - end]] + flat[seam.right[-1 - end]]))
        shift = float((to - start) @ axis) / float(arc[-1])
        moved = tip + (shift if tip > other else -shift)
        least = _SHORTEST / float(arc[-1])
        low, high = (other + least, 1.0 - _INSIDE) if tip > other else (_INSIDE, other - least)
        cuts[number] = {**table, "part": sorted((round(other, 4), round(min(max(moved, low), high), 4)))}
        return {"cuts": cuts}
    # The place of the surface that lies there in the pattern, or nearest to it.
    cut = piece.network.surface
    triangles = triangulate(cut.faces)[0].astype(np.int64)
    nearest, weights, _ = Mesh(np.pad(flat, [(0, 0), (0, 1)]), triangles).closest(np.append(to, 0.0)[None])
    point = np.asarray(weights[0] @ cut.vertices[triangles[nearest[0]]])
    if not is_tip:
        border = surface.vertices[border_of(surface)]
        point = border[np.linalg.norm(border - point, axis=1).argmin()]
    rest = surface.vertices[seam.path[-1 - end]]
    ends = {end: point, -1 - end: rest}
    given = [(0, "from"), (-1, "to")]
    if "from" in table:
        # Whichever end of the table lies nearer.
        places = ((key, table[key]) for key in ("from", "to"))
        known = {key: surface.vertices[place] if isinstance(place, int) else np.array(place) for key, place in places}
        moved_end = surface.vertices[seam.path[end]]
        key = min(known, key=lambda key: float(np.linalg.norm(known[key] - moved_end)))
        cuts[number] = {**table, key: rounded(point)}
    else:
        name = table.get("name", table.get("line"))
        kept = {key: value for key, value in table.items() if key not in ("line", "part", "plane")}
        cuts[number] = {**kept, "name": name, **{key: rounded(ends[at]) for at, key in given}}
    return {"cuts": cuts}
