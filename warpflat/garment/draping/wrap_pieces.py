"""Flat pieces are laid around a body by their seams: where a pattern from outside starts to be sewn.

The pieces around the trunk start where a file says that they hang. Without that they are laid beside and upon each other in the plane,
each by the longest seam (longest upwards) that joins it to one that lies. The plane is rolled up around the trunk, so that its first and
last edge meet; a tier that goes around the body by itself, such as a gathered skirt, by its own width. Sleeves are rolled up around the
arms. The garment goes up or down to where it hangs: on the shoulders, at its own levels, or with its top at the waist.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from scipy.spatial import cKDTree

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.core.errors import InputError, nearest
from warpflat.core.polyline import polyline_length
from warpflat.garment.draping.mesh_pieces import FlatMesh, Weld, sewn_places, welded_vertices
from warpflat.garment.draping.openings import Opening, find_openings, limbs_of
from warpflat.garment.mannequin.mannequin import Mannequin

__all__ = ["UNITS", "continue_pieces", "find_roles", "hang_from_edges", "hood_beside_head", "wrap_pieces"]

#: Where a file's units stand.
UNITS = (
    "are its units right (in DXF the text UNITS or $INSUNITS, in SVG width and viewBox, in GarmentCode units_in_meter)?"
)
# Cloth around less than this share of the body's waist is no garment for it.
_LEAST_GIRTH = 0.5

# The trunk is rolled up as an ellipse so many times as wide as deep.
_WIDTH_OVER_DEPTH = 1.4
# Openings of both sleeves are equally long but for this share.
_ALIKE = 0.05
# A hood is taller than this [m].
_HOOD = 0.2
# Sides of a seam that are farther apart than this share of the pieces' width meet behind the body.
_FAR = 0.25
# Pieces that hang from the shoulders start this much higher [m].
_ABOVE = 0.01
# Pieces that hang around another place than the body, sideways or forwards by so much [m], are moved to it.
_ASIDE = np.array([0.02, np.inf, 0.1])
# The highest of a sleeve, whose middle is laid above the arm, is what reaches up to this share of its height.
_CAP = 0.95
# What falls from an edge hangs upright where the cloth above leads downwards by this share.
_HANGS = -0.8
# What is drafted follows so many of the nearest vertices of its seams.
_NEXT = 4


@dataclass(frozen=True)
class _Frame:
    """Where pieces are rolled up: a point, the direction of their height, that of their middle, and the half axes [m]."""

    origin: FloatArray
    up: FloatArray
    front: FloatArray

    def roll(self, flat: FloatArray, width: float, ratio: float) -> FloatArray:
        """Roll #P by 2 points up around an ellipse of the circumference `width`."""
        angle = 2.0 * np.pi * flat[:, 0] / width
        depth = width / (np.pi * (3 * (1 + ratio) - np.sqrt((3 + ratio) * (1 + 3 * ratio))))
        side = np.cross(self.up, self.front)
        out = depth * (np.outer(np.cos(angle), self.front) + ratio * np.outer(np.sin(angle), side))
        return np.asarray(self.origin + out + np.outer(flat[:, 1], self.up))


def wrap_pieces(
    meshes: Mapping[str, FlatMesh],
    welds: Sequence[Sequence[Weld]],
    body: Mannequin,
    *,
    at: Mapping[str, str] | None = None,
    hung: Mapping[str, FloatArray] | None = None,
    levels: Mapping[str, tuple[str, float]] | None = None,
    top: str | float | None = None,
) -> dict[str, FloatArray]:
    """Place the points of each piece (#P by 3 [m]) around a body.

    Args:
        meshes: the pieces, upright: y runs up along the body, their right side towards the viewer.
        welds: for each seam the vertices that it joins.
        body: with its levels.
        at: by piece "front", "back", "left arm" or "right arm"; others go by their seams, or, where these do not tell, by their names.
        hung: by piece the points (#P by 3 [m]) where it hangs beside a body.
        levels: by piece the level of the body where it hangs, and the height [m] that this has in `hung`.
        top: the highest point of the trunk: a level of the body or a height [m].

    Raises:
        InputError: a piece hangs together with no other, the pieces go around half the waist only, or a level is unknown.
    """
    at, hung, names = dict(at or {}), hung or {}, list(meshes)
    joins, openings = _joins(welds, names), find_openings(meshes, welds)
    groups, _ = find_roles(meshes, welds, at, openings)
    on_arms = set[str]().union(*groups)
    trunk = [name for name in names if name not in on_arms]
    if not trunk:
        raise InputError("there are sleeves alone; a garment needs a piece around the trunk")
    waist, heights = body.line("waist"), {name: level.height for name, level in body.levels().items()}
    girth, around = polyline_length(waist, closed=True), max((each.length for each in openings), default=np.inf)
    if around < _LEAST_GIRTH * girth:
        raise InputError(
            f"the pattern goes {1e3 * around:.0f} mm around the body, whose waist has {1e3 * girth:.0f} mm: {UNITS} Is a piece missing?"
        )
    if isinstance(top, str) and top not in heights:
        raise InputError(f"top: level {top!r} is unknown: {nearest(top, heights)}")
    shoulder = max(float(body.line(f"shoulder {side}")[:, 1].max()) for side in ("left", "right"))
    middle = 0.5 * (waist.min(axis=0) + waist.max(axis=0))
    placed, is_hung = dict[str, FloatArray](), hung.keys() >= set(trunk)
    if is_hung:
        # A file may stand anywhere: its pieces go around the body's middle.
        ends = np.concatenate([hung[name] for name in trunk])
        off = middle - 0.5 * (ends.min(axis=0) + ends.max(axis=0))
        placed = {name: hung[name] + np.where(np.abs(off) > _ASIDE, off, 0.0) for name in trunk}
    else:
        fronts = [name for name in trunk if at.get(name) == "front" or (name not in at and "front" in name.lower())]
        inner = [join for join in joins if set(join.pieces) <= set(trunk)]
        inner = _whole_sides(inner, {name: meshes[name].points for name in trunk})
        plane = _lay_out(meshes, inner, trunk, fronts or trunk[:1])
        width, _ = _girth(plane, inner)
        frame = _Frame(middle * [0.0, 0.0, 1.0], np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0]))
        # The pieces in tiers above each other: those of one are joined by upright seams.
        sides = [join for join in inner if all(np.ptp(row[:, 1]) > np.ptp(row[:, 0]) for row in join.points(plane))]
        for tier in _parts(sides, list(plane)):
            laid = {name: plane[name] for name in tier}
            of_tier, meets = _girth(laid, [join for join in inner if set(join.pieces) <= laid.keys()])
            if meets:
                laid = _centred(laid, of_tier, [name for name in fronts if name in laid])
            placed |= {
                name: frame.roll(flat, of_tier if meets else width, _WIDTH_OVER_DEPTH) for name, flat in laid.items()
            }
    # Pieces with an armhole hang from the shoulders: where a sleeve is sewn on, or an opening of the trunk is beside its middle.
    welded, begins = welded_vertices(meshes, welds)
    free = [each for each in openings if not each.pieces & on_arms]
    limbs = limbs_of(free, sewn_places(placed, begins, welded), ())
    armholed = {name for each, limb in zip(free, limbs, strict=True) if limb.endswith("arm") for name in each.pieces}
    upright = dict(meshes)
    for group in groups:
        seams = [(a, b, placed[a][own], its) for (a, b), (own, its) in _both_ways(joins) if a in placed and b in group]
        if seams:
            armholed |= {a for a, _, _, _ in seams}
            side = "left" if np.concatenate([points for _, _, points, _ in seams])[:, 0].mean() > 0.0 else "right"
            at = at | {name: f"{side} arm" for name in group if not at.get(name, "").endswith(" arm")}
        for name in {b for _, b, _, _ in seams}:
            # A sleeve may lie in its file; by quarter turns its cap comes up.
            flat, cap = meshes[name].points, np.concatenate([its for _, b, _, its in seams if b == name])
            x, y = flat[cap].mean(axis=0) - flat.mean(axis=0)
            turn = np.linalg.matrix_power([[0, -1], [1, 0]], round(np.arctan2(x, y) / (0.5 * np.pi)) % 4)
            upright[name] = replace(meshes[name], points=flat @ turn.T)
    # Each garment of a suit hangs by itself: with its top where that is asked for, else by its armholes, else at its own levels.
    for part in _parts(joins, names):
        own = [name for name in part if name in placed]
        if not own:
            continue
        shift, high = dict.fromkeys(own, 0.0), max(float(placed[name][:, 1].max()) for name in own)
        tops = [float(placed[name][:, 1].max()) for name in own if name in armholed]
        lines: dict[str, list[float]] = {}
        for level, height in (levels[name] for name in own if levels and name in levels):
            lines.setdefault(level, []).append(height)
        if top is not None:
            below = heights[top] if isinstance(top, str) else float(top)
            shift = dict.fromkeys(own, below - high)
        elif tops:
            shift = dict.fromkeys(own, shoulder + _ABOVE - max(tops))
        elif not lines and not (is_hung and heights["hip"] < high < shoulder):
            shift = dict.fromkeys(own, heights["waist"] - high)
        for level, row in lines.items():
            height = float(np.mean(row))
            hangs = [name for name in own if placed[name][:, 1].mean() < height] if top is not None or tops else own
            shift |= dict.fromkeys(hangs, heights[level] - height)
        placed |= {name: placed[name] + [0.0, by, 0.0] for name, by in shift.items()}
    for side in ("left", "right"):
        placed |= _on_arm(upright, joins, [name for name in names if at.get(name) == f"{side} arm"], side, body)
    return placed


def find_roles(
    meshes: Mapping[str, FlatMesh], welds: Sequence[Sequence[Weld]], at: Mapping[str, str], openings: Sequence[Opening]
) -> tuple[list[set[str]], set[str]]:
    """Return the pieces of each sleeve, and those of a hood: those that are told, else what the seams tell, else by their names.

    By the seams a piece goes with the opening that is the fewest seams away. A sleeve goes with one opening, has a twin whose opening is
    as long, and is not sewn to it, as the legs of trousers are. A hood goes with one opening of four or more, is tall, is sewn on at its
    lower side, and not to a sleeve.

    Args:
        meshes: the pieces, upright.
        welds: for each seam the vertices that it joins.
        at: by piece "left arm" or "right arm", where that is told.
        openings: of the garment.
    """
    sewn = _both_ways(_joins(welds, list(meshes)))
    beside: dict[str, set[str]] = {name: set() for name in meshes}
    for (a, b), _ in sewn:
        beside[a].add(b)
    of = {name: {number for number, each in enumerate(openings) if name in each.pieces} for name in meshes}
    while ring := {
        name: found
        for name in meshes
        if not of[name] and (found := set[int]().union(*(of[other] for other in beside[name])))
    }:
        of |= ring
    groups = [{name for name in meshes if of[name] == {number}} for number in range(len(openings))]
    twins = [
        (abs(openings[i].length / openings[j].length - 1.0), i, j)
        for i, j in combinations(range(len(openings)), 2)
        if groups[i] and groups[j] and not any(beside[name] & groups[j] for name in groups[i])
    ]
    alike, i, j = min(twins, default=(1.0, 0, 0))
    sleeves = [{name for name in meshes if at.get(name) == f"{side} arm"} for side in ("left", "right")]
    if not any(sleeves):
        # What a cuff is sewn to is as near to the neck, but has no opening of its own.
        on_border = set[str]().union(*(each.pieces for each in openings))
        cuffed = {
            k: {name for name in set(meshes) - on_border if k in of[name] and beside[name] & groups[k]} for k in (i, j)
        }
        twin = alike < _ALIKE and len(openings) > 2
        sleeves = (
            [groups[i] | cuffed[i] - cuffed[j], groups[j] | cuffed[j] - cuffed[i]]
            if twin
            else [{name} for name in meshes if "sleeve" in name.lower()]
        )
    on_arms, hood = set[str]().union(*sleeves), set[str]()
    for group in groups if len(openings) > 3 else ():
        ends = [
            meshes[a].points[own, 1].mean() - meshes[a].points[:, 1].mean()
            for (a, b), (own, _) in sewn
            if a in group and b not in group
        ]
        tall = any(np.ptp(meshes[name].points[:, 1]) > _HOOD for name in group)
        if (
            tall
            and not group & on_arms
            and not any(beside[name] & on_arms for name in group)
            and ends
            and max(ends) < 0.0
        ):
            hood |= group
    return sleeves, hood


@dataclass(frozen=True)
class _Join:
    """Two pieces and the vertices of each that a seam joins."""

    pieces: tuple[str, str]
    vertices: tuple[IntArray, IntArray]

    def points(self, points: Mapping[str, FloatArray]) -> tuple[FloatArray, FloatArray]:
        """Return the points on both sides (#J by 2)."""
        return points[self.pieces[0]][self.vertices[0]], points[self.pieces[1]][self.vertices[1]]


def _parts(joins: Sequence[_Join], names: Sequence[str]) -> list[list[str]]:
    """Return the names in parts that hang together by joins."""
    parts = {name: {name} for name in names}
    for join in joins:
        a, b = join.pieces
        parts |= dict.fromkeys(merged := parts[a] | parts[b], merged)
    return [[name for name in names if name in part] for part in {id(part): part for part in parts.values()}.values()]


def _joins(welds: Sequence[Sequence[Weld]], names: Sequence[str]) -> list[_Join]:
    """Return what each seam joins of the named pieces, a piece to itself too."""
    joins = []
    for seam in welds:
        pairs: dict[tuple[str, str], list[tuple[int, int]]] = {}
        for (piece, vertex), *others in seam:
            for other, its in others:
                if piece in names and other in names:
                    pairs.setdefault((piece, other), []).append((vertex, its))
        for both, rows in pairs.items():
            if len(rows) > 1:
                first, second = np.array(rows, dtype=np.int32).T
                joins.append(_Join(both, (first, second)))
    return joins


def _both_ways(joins: Sequence[_Join]) -> list[tuple[tuple[str, str], tuple[IntArray, IntArray]]]:
    """Return pieces and vertices of each join, either first."""
    return [pair for join in joins for pair in ((join.pieces, join.vertices), (join.pieces[::-1], join.vertices[::-1]))]


def _whole_sides(joins: Sequence[_Join], points: Mapping[str, FloatArray]) -> list[_Join]:
    """Join upright seams of the same two pieces on the same side of both, as those that a corner parts.

    Pieces lie by the mean of a whole side. By the longest part of one side, and by the other side as a whole, a symmetric garment
    would lie askew.
    """
    middle = {name: 0.5 * (row[:, 0].min() + row[:, 0].max()) for name, row in points.items()}
    sides: dict[object, _Join] = {}
    for number, join in enumerate(joins):
        rows = join.points(points)
        key: object = number
        if all(np.ptp(row[:, 1]) > np.ptp(row[:, 0]) for row in rows) and join.pieces[0] != join.pieces[1]:
            key = (
                join.pieces,
                *(bool(row[:, 0].mean() > middle[name]) for name, row in zip(join.pieces, rows, strict=True)),
            )
        if key in sides:
            before = sides[key].vertices
            both = [np.concatenate(pair) for pair in zip(before, join.vertices, strict=True)]
            join = _Join(join.pieces, (both[0], both[1]))
        sides[key] = join
    return list(sides.values())


def _on_arm(
    meshes: Mapping[str, FlatMesh], joins: Sequence[_Join], names: Sequence[str], side: str, body: Mannequin
) -> dict[str, FloatArray]:
    """Roll the pieces on an arm up around it, laid beside each other: their highest point above it, at the armhole's."""
    if not names:
        return {}
    plane = _lay_out(meshes, [join for join in joins if set(join.pieces) <= set(names)], names, names[:1])
    points = np.concatenate(list(plane.values()))
    hole, wrist = body.line(f"armhole {side}"), body.line(f"wrist {side}").mean(axis=0)
    shoulder = hole[hole[:, 1].argmax()]
    up = hole.mean(axis=0) - wrist
    up /= np.linalg.norm(up)
    front = shoulder - hole.mean(axis=0)
    front -= (front @ up) * up
    front /= np.linalg.norm(front)
    width, high = float(np.ptp(points[:, 0])), float(points[:, 1].max())
    middle = 0.5 * float(points[:, 0].min() + points[:, 0].max())
    if len(names) > 1:
        # Around the arm: the highest points may lie at both ends of what is laid out.
        cap = points[points[:, 1] >= high - (1.0 - _CAP) * np.ptp(points[:, 1])]
        middle = float(np.angle(np.exp(2j * np.pi * cap[:, 0] / width).mean())) * width / (2.0 * np.pi)
    # The highest point of the cap lies beside the shoulder.
    beyond = float((shoulder - hole.mean(axis=0)) @ up)
    frame = _Frame(hole.mean(axis=0) + beyond * up, up, front)
    return {name: frame.roll(flat - [middle, high], width, 1.0) for name, flat in plane.items()}


def _lay_out(
    meshes: Mapping[str, FlatMesh], joins: Sequence[_Join], trunk: Sequence[str], fronts: Sequence[str]
) -> dict[str, FloatArray]:
    """Shift the trunk's pieces beside each other, each by the seam that reaches highest; the middle of the fronts is at 0."""
    flat = {name: meshes[name].points for name in trunk}
    links = []
    for join in joins:
        p, q = join.points(flat)
        if join.pieces[0] != join.pieces[1]:
            links.append((float(min(np.ptp(p[:, 1]), np.ptp(q[:, 1]))), *join.pieces, (p - q).mean(axis=0)))
    links.sort(key=lambda link: -link[0])
    shift = {fronts[0]: np.zeros(2)}
    while len(shift) < len(trunk):
        for _, a, b, by in links:
            if (a in shift) != (b in shift):
                if a in shift:
                    shift[b] = shift[a] + by
                else:
                    shift[a] = shift[b] - by
                break
        else:
            lost = next(name for name in trunk if name not in shift)
            raise InputError(
                f"piece {lost!r} is sewn to no other on the same part of the body; join it by a seam, or say in [[pieces]] where it is"
            )
    plane = {name: points + shift[name] for name, points in flat.items()}
    return _centred(plane, _girth(plane, joins)[0], fronts)


def _centred(plane: Mapping[str, FloatArray], width: float, fronts: Sequence[str]) -> dict[str, FloatArray]:
    """Shift pieces so that the middle of the fronts is at 0, around a circumference; as they are without fronts."""
    width = max(width, 1e-6)
    turn = sum(np.exp(2j * np.pi * plane[name][:, 0] / width).mean() for name in fronts)
    middle = np.angle(turn) * width / (2 * np.pi)
    return {name: points - [middle, 0.0] for name, points in plane.items()}


def _girth(plane: Mapping[str, FloatArray], joins: Sequence[_Join]) -> tuple[float, bool]:
    """Return the way around, and whether an upright seam meets behind the body.

    The way around is how far apart the edges lie that meet there [m], or the width of all pieces. Upright edges half as far apart are
    those inside a leg.
    """
    whole = float(np.ptp(np.concatenate(list(plane.values()))[:, 0]))
    around = []
    for join in joins:
        rows = join.points(plane)
        apart = abs(float((rows[0] - rows[1])[:, 0].mean()))
        if all(np.ptp(row[:, 1]) > np.ptp(row[:, 0]) for row in rows) and apart > _FAR * whole:
            around.append(apart)
    return max(around, default=whole), bool(around)


def continue_pieces(
    placed: Mapping[str, FloatArray],
    meshes: Mapping[str, FlatMesh],
    welds: Sequence[Sequence[Weld]],
    turned_down: Collection[str] = (),
) -> dict[str, FloatArray]:
    """Place bands, collars, pockets and whatever else was drafted flat: as if the cloth that they are sewn to ran on beyond the seam.

    The piece with the longest seams to those that lie comes first.

    Args:
        placed: by piece the points (#P by 3 [m]) of those that lie.
        meshes: all pieces.
        welds: for each seam the vertices that it joins.
        turned_down: pieces that lie back on what they are sewn to, as the fall of a collar on its stand.

    Raises:
        InputError: a piece hangs together with none that lies.
    """
    found = dict(placed)
    while lost := [name for name in meshes if name not in found]:
        # By piece its vertices that are sewn, the places of these, and where the piece's x and y lead from there.
        sewn: dict[str, list[tuple[IntArray, FloatArray, FloatArray]]] = {name: [] for name in lost}
        for (name, other), (own, its) in _both_ways(_joins(welds, list(meshes))):
            if name in lost and other in found:
                across = _border_frames(meshes[name], own).transpose(0, 2, 1)
                # Into this piece is out of the other one, or back into it.
                flat = _border_frames(meshes[other], its) * [1.0, 1.0 if name in turned_down else -1.0] @ across
                sewn[name].append((own, found[other][its], _slopes(meshes[other], found[other])[its] @ flat))
        lengths = {
            name: sum(
                float(np.linalg.norm(np.diff(meshes[name].points[own], axis=0), axis=1).sum()) for own, _, _ in rows
            )
            for name, rows in sewn.items()
        }
        name = max(lost, key=lambda each: lengths[each])
        if not sewn[name]:
            raise InputError(f"piece {name!r} is sewn to no piece that has a designed surface")
        own, place, way = (np.concatenate(column) for column in zip(*sewn[name], strict=True))
        flat = meshes[name].points
        far, near = cKDTree(flat[own]).query(flat, k=min(_NEXT, len(own)))
        weight = 1.0 / np.maximum(far, 1e-6) ** 2
        weight /= weight.sum(axis=1, keepdims=True)
        off = flat[:, None] - flat[own[near]]
        found[name] = np.einsum("pk,pka->pa", weight, place[near] + np.einsum("pkab,pkb->pka", way[near], off))
    return found


def hang_from_edges(
    placed: Mapping[str, FloatArray],
    meshes: Mapping[str, FlatMesh],
    welds: Sequence[Sequence[Weld]],
    falling: Mapping[str, float],
) -> dict[str, FloatArray]:
    """Place flounces and ruffles as a smooth skirt that falls from the edges to which they are sewn, without their folds.

    Args:
        placed: by piece the points (#P by 3 [m]) of those that lie.
        meshes: all pieces.
        welds: for each seam the vertices that it joins.
        falling: the pieces that are placed, with the share of its length by which each stands out.

    Returns:
        By piece its points, #P by 3 [m].
    """
    rows: dict[str, list[tuple[IntArray, FloatArray, FloatArray]]] = {name: [] for name in falling}
    for (name, other), (own, its) in _both_ways(_joins(welds, list(meshes))):
        if name in falling and other in placed:
            out = -_border_frames(meshes[other], its)[:, :, 1:]
            down = (_slopes(meshes[other], placed[other])[its] @ out)[:, :, 0]
            rows[name].append((own, placed[other][its], down))
    found, sewn = {}, {name: seams for name, seams in rows.items() if seams}
    middle = np.concatenate([place for seams in sewn.values() for _, place, _ in seams] or [np.zeros((1, 3))]).mean(
        axis=0
    )
    for name, seams in sewn.items():
        flat, best = meshes[name].points, np.full(len(meshes[name].points), np.inf)
        found[name] = np.empty((len(flat), 3))
        for own, place, down in seams:
            a, b = flat[own[:-1]], flat[own[1:]]
            share = np.einsum("psk,sk->ps", flat[:, None] - a, b - a) / np.maximum(((b - a) ** 2).sum(axis=1), 1e-12)
            share = np.clip(share, 0.0, 1.0)
            off = np.linalg.norm(flat[:, None] - a - share[..., None] * (b - a), axis=2)
            nearest_side = off.argmin(axis=1)
            points, here = np.arange(len(flat)), off.min(axis=1) < best
            at, t = nearest_side[here], share[points, nearest_side][here, None]
            start, way = ((1.0 - t) * row[at] + t * row[at + 1] for row in (place, down))
            # On the trunk it hangs, on an arm it runs on.
            way = np.where((way[:, 1] < _HANGS * np.linalg.norm(way, axis=1))[:, None], [0.0, -1.0, 0.0], way)
            out = (start - middle) * [1.0, 0.0, 1.0]
            way = way + falling[name] * out / np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-9)
            way /= np.linalg.norm(way, axis=1, keepdims=True)
            best = np.minimum(best, off.min(axis=1))
            found[name][here] = start + best[here, None] * way
    return found


def hood_beside_head(
    placed: Mapping[str, FloatArray],
    meshes: Mapping[str, FlatMesh],
    welds: Sequence[Sequence[Weld]],
    hood: Collection[str],
    beside: float,
) -> dict[str, FloatArray]:
    """Place the halves of a hood flat beside a head, upright as they are drawn, with the middles of their seams at the neckline's.

    Args:
        placed: by piece the points (#P by 3 [m]) of those that lie.
        meshes: all pieces.
        welds: for each seam the vertices that it joins.
        hood: the pieces of the hood; what is sewn to both sides of the neckline, such as a strip over the crown, is no half.
        beside: how far from the middle the halves lie [m].

    Returns:
        By half its points, #P by 3 [m].
    """
    rows: dict[str, list[tuple[IntArray, FloatArray]]] = {name: [] for name in hood}
    for (name, other), (own, its) in _both_ways(_joins(welds, list(meshes))):
        if name in hood and other in placed and other not in hood:
            rows[name].append((own, placed[other][its]))
    found = {}
    for name, seams in rows.items():
        if not seams:
            continue
        own, neckline = (np.concatenate(column) for column in zip(*seams, strict=True))
        side = float(np.sign(neckline[:, 0]).mean())
        if abs(side) > 0.5:
            off = meshes[name].points - meshes[name].points[own].mean(axis=0)
            seen = neckline - neckline.mean(axis=0)
            # Drawn upright, it faces one way or the other.
            forwards = np.sign(off[own, 0] @ seen[:, 2])
            x, y = np.sign(side) * beside, neckline[:, 1].mean() + off[:, 1]
            found[name] = np.column_stack([np.full(len(y), x), y, neckline[:, 2].mean() + forwards * off[:, 0]])
    return found


def _border_frames(mesh: FlatMesh, row: IntArray) -> FloatArray:
    """Return the directions along a row of border vertices (#R) and into the piece as columns, #R by 2 by 2."""
    points = mesh.points
    along = np.gradient(points[row], axis=0)
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-12)
    inwards = np.column_stack([-along[:, 1], along[:, 0]])
    middle = points[mesh.triangles[np.isin(mesh.triangles, row).sum(axis=1) == 2]].mean(axis=1)
    place = cKDTree(points[row]).query(middle)[1]
    left = np.einsum("ta,ta->t", middle - points[row[place]], inwards[place])
    return np.stack([along, inwards * (1.0 if np.median(left) > 0.0 else -1.0)], axis=-1)


def _slopes(mesh: FlatMesh, points: FloatArray) -> FloatArray:
    """Return where a piece's x and y lead in space at its vertices, #P by 3 by 2, for places #P by 3."""
    flat, space = mesh.points[mesh.triangles], points[mesh.triangles]
    sides, edges = ((each[:, 1:] - each[:, :1]).transpose(0, 2, 1) for each in (flat, space))
    area = np.linalg.det(sides)
    of_triangles = (edges @ np.linalg.inv(sides)).reshape(-1, 6) * area[:, None]
    corner, count = mesh.triangles.ravel(), len(points)
    total = np.stack([np.bincount(corner, np.repeat(column, 3), count) for column in of_triangles.T], axis=1)
    return np.asarray((total / np.bincount(corner, np.repeat(area, 3), count)[:, None]).reshape(-1, 3, 2))
