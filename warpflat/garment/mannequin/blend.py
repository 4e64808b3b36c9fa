"""The surface of a form from that of the body: profiles eased, scaled, moved out or mixed, and cloth that leaves the body.

Cloth off the body runs straight between two levels, and is bridged over hollows, along a row and from level to level.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from warpflat.core import FloatArray, InputError, IntArray, arc_lengths, nearest, polyline_length, unit
from warpflat.flat import vertex_normals
from warpflat.garment.mannequin.layout import ARM_LEVELS, EASED_LEVELS, LEG_LEVELS, RING_LEVELS, Layout
from warpflat.garment.mannequin.profiles import convex_girth, scale_to_girth, upper_hull
from warpflat.garment.mannequin.sampled import smooth, smoothstep
from warpflat.garment.mannequin.sheet import fill_fork, fill_sheet, sheet_laplacian

__all__ = ["Adjustment", "adjusted_vertices", "bridge_row", "bridge_rows", "is_tight", "rule_rows"]

# A fold's mitre runs off to nothing where trunk and arm lie against each other: at most twice as far as either side moves.
_LEAST_MITRE = 0.5
# Rows down to so many times as far below a lowered underarm share the height.
_SHARED = 3.0
# Standard deviation [m] along the arm of the mean that bows a sleeve around the elbow.
_ELBOW_BOW = 0.03
# Straight cloth hangs from a belly that stands out over the hip by more than this [m]: bodies lean as far without one.
_BELLY = 0.02
# The cloth of a straight leg hangs from the crotch curve down to this share of the way from thigh to knee.
_HANGS = 0.8
# Standard deviation [m] along the leg of the mean that rounds a straight leg where it leaves the thigh.
_THIGH_BOW = 0.04
# A loose sleeve that hangs from its armhole is wider at the biceps. So many times it gets so much less there: most of its girth hangs.
_HANGING_ROUNDS, _HANGING_STEP = 3, 2.5
# Parts of the body whose profiles can be mixed with each other.
_PARTS = (RING_LEVELS, ARM_LEVELS[1:], LEG_LEVELS[1:])


@dataclass(frozen=True, kw_only=True)
class Adjustment:
    """The adjustments of one profile, made in this order.

    Attributes:
        like: another profile whose outline is mixed in by `weight`.
        weight: 0 keeps the outline, 1 takes all of the other's.
        bridge: hollows are bridged, as cloth hangs from bust point to bust point; not of the chest and of arms.
        scale: blow-up about the profile's middle.
        offset_cm: distance that the profile moves outward [cm].
        raise_cm: how far the profile moves up [cm], down if negative; not of the chest and of arms.
    """

    like: str | None = None
    weight: float = 1.0
    bridge: bool = False
    scale: float = 1.0
    offset_cm: float = 0.0
    raise_cm: float = 0.0

    @staticmethod
    def ranges() -> dict[str, tuple[float, float]]:
        """Return the least and the greatest valid value of every number."""
        return {
            "weight": (0.0, 1.0), "scale": (0.5, 6.0), "offset_cm": (-5.0, 100.0), "raise_cm": (-60.0, 60.0),
        }  # fmt: skip


def is_tight(profiles: Mapping[str, Adjustment], ease: Mapping[str, float]) -> bool:
    """Return whether a form is meant to be tighter than its body somewhere, as a knit is."""
    return min(ease.values(), default=0.0) < 0.0 or any(p.scale < 1.0 or p.offset_cm < 0.0 for p in profiles.values())


def adjusted_vertices(
    layout: Layout,
    vertices: FloatArray,
    profiles: Mapping[str, Adjustment],
    ruled: Sequence[tuple[str, str]] = (),
    ease: Mapping[str, float] | None = None,
    bridged: Sequence[tuple[str, str]] = (),
) -> FloatArray:
    """Return the body's vertices with some profiles moved; what lies between follows smoothly.

    Args:
        layout: the grid.
        vertices: #V by 3, the body [m].
        profiles: what is done, by level: a closed level of the trunk, ``chest``, an arm or a leg level; ``crotch`` moves up or down only.
        ruled: pairs of levels (upper, lower) of trunk, arms or legs between which the rows are straight.
        ease: by level, what a tape around it reads more than around the body [cm]. Cloth with ease bridges hollows.
        bridged: pairs of levels of the trunk between which the cloth bridges hollows from level to level, too.

    Raises:
        InputError: for a level that cannot be adjusted, or an order that turns two profiles over.
    """
    from scipy.interpolate import PchipInterpolator

    ease = ease or {}
    known = [*EASED_LEVELS, "crotch"]
    for level in ease:
        if level not in EASED_LEVELS:
            raise InputError(f"form: level {level!r} has no ease: {nearest(level, EASED_LEVELS)}")
    for level, change in profiles.items():
        for name in (level, change.like):
            if name is not None and name not in known:
                raise InputError(f"form: profile {name!r} cannot be adjusted: {nearest(name, known)}")
        if level in ("chest", *ARM_LEVELS) and (change.bridge or change.raise_cm):
            raise InputError(f"form: profile {level}: it is neither bridged nor raised; leave bridge and raise_cm out")
        parts = [next((i for i, part in enumerate(_PARTS) if name in part), -1) for name in (level, change.like)]
        if change.like and (-1 in parts or parts[0] != parts[1]):
            raise InputError(f"form: profile {level} cannot be like {change.like}; take a level of the same part")
    out = vertices.copy()
    if not (profiles or ruled or ease or bridged):
        return out
    changes = {level: (profiles.get(level, Adjustment()), ease.get(level, 0.0)) for level in {*profiles, *ease}}
    # The rings of the trunk first: sheet, arms and legs hang from them.
    rows = np.array([layout.level_row[level] for level in RING_LEVELS])
    moves = _level_moves(
        vertices, layout.rings, layout.level_row, RING_LEVELS, changes, lambda row, *how: _changed(row, *how) - row
    )
    for pair in ruled:
        if set(pair) <= set(RING_LEVELS):
            _hang_below_belly(moves, vertices, layout, sorted(map(RING_LEVELS.index, pair)))
    heights = [
        float(vertices[layout.rings[r[0]], 1].mean() + m[:, 1].mean())
        for r, m in zip(rows[:, None], moves, strict=True)
    ]
    _check_order(RING_LEVELS, heights)
    between = np.arange(rows[0], rows[-1] + 1)
    ids = layout.rings[between]
    # Against height, not row number: the spacing of rows changes from one band to the next.
    y = vertices[layout.rings[:, 0], 1]
    out[ids] += PchipInterpolator(y[rows], np.stack(moves), axis=0)(y[between])
    # The rings around both legs cut their corners: it is the legs that push a skirt out.
    solid = np.unique(np.concatenate([ids.ravel(), *(grid.ravel() for grid in layout.legs.values())]))
    row_of = {level: layout.level_row[level] for level in RING_LEVELS}
    for pair in ruled:
        if not set(pair) & {*ARM_LEVELS, *LEG_LEVELS}:
            rule_rows(out, layout.rings, row_of, pair, vertices[solid])
    for pair in bridged:
        bridge_rows(out, layout.rings, layout.level_row, pair)
    _move_sheet(out, layout, vertices, changes.get("chest"))
    _move_arms(out, layout, vertices, changes, ruled)
    _move_legs(out, layout, vertices, changes, ruled)
    # The neck follows its base, its top stays.
    share = np.linspace(1.0, 0.0, len(layout.neck))[:, None, None]
    out[layout.neck] = vertices[layout.neck] + share * (out[layout.neck[0]] - vertices[layout.neck[0]])
    return out


def _check_order(levels: Sequence[str], heights: Sequence[float]) -> None:
    """Raise InputError unless each of some levels lies above the one before it."""
    for (low, h0), (high, h1) in itertools.pairwise(zip(levels, heights, strict=True)):
        if h1 - h0 < 0.01:
            raise InputError(f"form: profile {high} comes to lie less than 1 cm above {low}; lower raise_cm")


def _changed(row: FloatArray, other: FloatArray | None, change: Adjustment, ease_cm: float) -> FloatArray:
    """Return a closed level row, #P by 3, after one adjustment and with its ease."""
    new = row.copy()
    if other is not None:
        new[:, [0, 2]] += change.weight * (other - row)[:, [0, 2]]
    if change.bridge or ease_cm > 0.0:
        new = bridge_row(new)
    middle = 0.5 * (new.min(axis=0) + new.max(axis=0))
    new = middle + (new - middle) * np.array([change.scale, 1.0, change.scale])
    grow = 2.0 * math.pi * change.offset_cm / 100.0 + ease_cm / 100.0
    if grow:
        girth = convex_girth(new) + grow
        if girth <= 0.2 * convex_girth(row):
            raise InputError(f"form: {grow * 100:g} cm of ease leave no girth (profile is {girth * 100:.0f} cm then)")
        tangent = np.roll(new, -1, axis=0) - np.roll(new, 1, axis=0)
        normal = unit(np.column_stack([-tangent[:, 2], np.zeros(len(new)), tangent[:, 0]]))
        outward = np.sign(np.sum(normal * (new - new.mean(axis=0))))
        new = scale_to_girth(new + outward * normal * grow / (2.0 * math.pi), girth)
    new[:, 1] += change.raise_cm / 100.0
    return new


def _hang_below_belly(moves: list[FloatArray], body: FloatArray, layout: Layout, span: Sequence[int]) -> None:
    """Move the levels up to the waist out to the belly, if it stands out over them: a skirt hangs straight from there.

    Args:
        moves: by level, #P by 3 [m], changed in place.
        body: #V by 3 [m].
        layout: the grid.
        span: numbers of the lowest and the highest level of the straight cloth; those above, up to the waist, may be the belly's.
    """
    rows = [body[layout.rings[layout.level_row[level]]] + move for level, move in zip(RING_LEVELS, moves, strict=True)]
    waist = RING_LEVELS.index("waist")
    for level in range(span[0], waist):
        middle = rows[level].mean(axis=0)[[0, 2]]

        def polar(row: FloatArray, middle: FloatArray = middle) -> tuple[FloatArray, FloatArray]:
            away = row[:, [0, 2]] - middle
            return np.arctan2(away[:, 0], away[:, 1]), np.linalg.norm(away, axis=1)

        angle, own = polar(rows[level])
        reach = own.copy()
        for above in range(max(level, span[1]) + 1, waist + 1):
            at, radius = polar(rows[above])
            order = np.argsort(at)
            reach = np.maximum(reach, np.interp(angle, at[order], radius[order], period=2.0 * np.pi) - _BELLY)
        moves[level][:, [0, 2]] += (reach / own - 1.0)[:, None] * (rows[level][:, [0, 2]] - middle)


def _level_moves(
    body: FloatArray,
    grid: IntArray,
    row_of: Mapping[str, int],
    levels: Sequence[str],
    changes: Mapping[str, tuple[Adjustment, float]],
    move: Callable[[FloatArray, FloatArray | None, Adjustment, float], FloatArray],
) -> list[FloatArray]:
    """Return the displacement of the row of each level, each #P by 3; `move` gives that of a row that changes."""
    found = []
    for level in levels:
        row = body[grid[row_of[level]]]
        if level not in changes:
            found.append(np.zeros_like(row))
            continue
        change, ease_cm = changes[level]
        other = body[grid[row_of[change.like]]] if change.like else None
        found.append(move(row, other, change, ease_cm))
    return found


def _move_sheet(out: FloatArray, layout: Layout, body: FloatArray, chest: tuple[Adjustment, float] | None) -> None:
    """Move chest and shoulders with the bust's rows; neckline and shoulder seams stay.

    Where the trunk's sides move outward, the armholes' lower ends move along the bisector of the fold under the arm, off trunk and arm
    alike: out and down.
    """
    bust, chest_row = layout.level_row["bust"], layout.level_row["chest"]
    ids, laplacian, local = sheet_laplacian(layout, bust - 3)
    move = out - body
    held = np.zeros(len(ids), bool)
    for line in ("neck", "shoulder left", "shoulder right"):
        held[local[layout.lines[line]]] = True
    held[local[layout.rings[bust - 3 : bust + 1].ravel()]] = True
    if chest is not None:
        for grid in (layout.front, layout.back):
            row = grid[0]
            distance = chest[0].offset_cm / 100.0 + chest[1] / 200.0 / math.pi
            tangent = np.gradient(body[row], axis=0)
            normals = unit(np.column_stack([-tangent[:, 2], np.zeros(len(row)), tangent[:, 0]]))
            move[row] = distance * normals + (chest[0].scale - 1.0) * (body[row] - body[row].mean(axis=0))
            held[local[row]] = True
    free = np.flatnonzero(~held)
    fill_sheet(move, layout, ids, laplacian[free], free)
    normals = vertex_normals(body, layout.faces)
    reach, side_reach = layout.columns[3] + len(layout.front) // 2, layout.quarter - layout.to_princess
    around, beside = np.arange(-reach, reach + 1), np.arange(-side_reach + 1, side_reach)
    for side, column in (("left", layout.quarter), ("right", 3 * layout.quarter)):
        at_bust, loop = layout.rings[bust, column], layout.arms[side][0]
        of_trunk = unit(normals[at_bust] * [1.0, 0.0, 1.0])
        outward = float(move[at_bust] @ of_trunk)
        if outward <= 0.0:
            continue
        # Beyond the rounded web of the armpit.
        bisector = unit(of_trunk + normals[layout.arms[side][layout.arm_row["biceps"] // 2, 0]])
        wished = outward / max(float(bisector @ of_trunk), _LEAST_MITRE) * bisector
        more = wished - move[loop[0]]
        move[loop[around % len(loop)]] += (np.cos(0.5 * np.pi * around / (reach + 1)) ** 2)[:, None] * more
        # The rows up to the bust share the height below an underarm that is lowered.
        heights = body[layout.rings[: chest_row + 1, column], 1]
        # From the underbust up; from further down where little height would be left to share.
        far = np.flatnonzero(heights <= heights[chest_row] - _SHARED * abs(float(more[1])))
        first = min(layout.level_row["underbust"], int(far[-1]) if len(far) else 0)
        share = ((heights[first : bust + 1] - heights[first]) / (heights[chest_row] - heights[first]))[:, None]
        rows = layout.rings[first : bust + 1, (column + beside) % layout.rings.shape[1]]
        move[rows, 1] += float(more[1]) * share * smoothstep(1.0 - np.abs(beside) / side_reach)
        held[local[loop]] = True
    if held[free].any():
        fill_sheet(move, layout, ids, laplacian[~held], np.flatnonzero(~held))
    out[ids] = body[ids] + move[ids]
    out[layout.rings[: bust + 1]] = (body + move)[layout.rings[: bust + 1]]


def _move_arms(
    out: FloatArray,
    layout: Layout,
    body: FloatArray,
    changes: Mapping[str, tuple[Adjustment, float]],
    ruled: Sequence[tuple[str, str]],
) -> None:
    from scipy.interpolate import PchipInterpolator

    for grid in layout.arms.values():
        own, biceps = dict(changes), grid[layout.arm_row["biceps"]]
        change, ease_cm = changes.get("biceps", (Adjustment(), 0.0))
        wished = 0.0
        for _ in range(_HANGING_ROUNDS if ease_cm > 0.0 else 1):
            at_levels = _level_moves(body, grid, layout.arm_row, ARM_LEVELS[1:], own, _arm_move)
            moves = [out[grid[0]] - body[grid[0]], *at_levels]
            rows = np.array([layout.arm_row[level] for level in ARM_LEVELS])
            out[grid[1:]] = (body[grid] + PchipInterpolator(rows, np.stack(moves), axis=0)(np.arange(len(grid))))[1:]
            if changes.get("elbow", (None, 0.0))[1] > 0.0:
                # The rows of a loose sleeve go around the elbow in a bow: cloth does not follow the crease of a bent arm.
                first, elbow, end = (layout.arm_row[level] for level in ("biceps", "elbow", "wrist"))
                bent = out[grid[first : end + 1]]
                apart = np.linalg.norm(np.diff(bent.mean(axis=1), axis=0), axis=1)[: 2 * (elbow - first)].mean()
                near = np.interp(np.arange(first, end + 1), [first, elbow, end], [0.0, 1.0, 0.0])[:, None, None]
                out[grid[first : end + 1]] = bent + smoothstep(near) * (
                    smooth(bent, _ELBOW_BOW / max(apart, 1e-9)) - bent
                )
            for pair in ruled:
                if pair[0] in ARM_LEVELS or pair[1] in ARM_LEVELS:
                    rule_rows(out, grid, layout.arm_row, pair, None)
            if ease_cm > 0.0:
                wished = wished or polyline_length(out[biceps], closed=True)
                # Skin runs from the trunk into the arm on a saddle, and around the shoulder's muscle; cloth lies on neither.
                _hang(out, layout, grid[: layout.arm_row["elbow"] + 1])
                more = 100.0 * (polyline_length(out[biceps], closed=True) - wished)
                own["biceps"] = (change, max(own["biceps"][1] - _HANGING_STEP * more, 0.0))


def _move_legs(
    out: FloatArray,
    layout: Layout,
    body: FloatArray,
    changes: Mapping[str, tuple[Adjustment, float]],
    ruled: Sequence[tuple[str, str]],
) -> None:
    """Move crotch curve and legs, with the hip's row from which they hang."""
    from scipy.interpolate import PchipInterpolator
    from scipy.optimize import brentq

    curve = layout.crotch
    change = changes.get("crotch", (Adjustment(), 0.0))[0]
    if change != Adjustment(raise_cm=change.raise_cm):
        raise InputError("form: profile crotch: it moves up or down only; leave all but raise_cm out")
    ends = out[curve[[0, -1]]] - body[curve[[0, -1]]]
    share = (arc_lengths(body[curve]) / polyline_length(body[curve]))[:, None]
    moved = body[curve] + (1.0 - share) * ends[0] + share * ends[1]
    depth = body[curve[0], 1] - body[curve, 1]
    moved[:, 1] += depth / depth.max() * change.raise_cm / 100.0
    out[curve[1:-1]] = moved[1:-1]
    for side, grid in layout.legs.items():
        move_leg = functools.partial(_leg_move, sign=1.0 if side == "left" else -1.0)
        moves = _level_moves(body, grid, layout.leg_row, LEG_LEVELS[1:], changes, move_leg)
        rows = np.array([layout.leg_row[level] for level in LEG_LEVELS[1:]])
        between = np.arange(rows[0], rows[-1] + 1)
        out[grid[between]] = body[grid[between]] + PchipInterpolator(rows, np.stack(moves), axis=0)(between)
        _check_order(LEG_LEVELS[:0:-1], [float(out[grid[row], 1].mean()) for row in rows[::-1]])
    move = out - body
    fill_fork(move, layout)

    def too_wide(share: float, skin: FloatArray, off: FloatArray, wished: float) -> float:
        return convex_girth(skin + share * off) - wished

    row_of = {level: layout.leg_row[level] for level in LEG_LEVELS[1:]}
    for grid in layout.legs.values():
        fork = grid[1 : layout.leg_row["leg_thigh"]]
        out[fork] = body[fork] + move[fork]
        straight = [pair for pair in ruled if set(pair) & set(LEG_LEVELS)]
        wished = convex_girth(out[grid[row_of["leg_thigh"]]])
        for pair in straight:
            rule_rows(out, grid, row_of, pair, body[grid[1:].reshape(-1)])
        if straight:
            # The cloth of a straight leg hangs from the crotch curve to the upper thigh, along the inseam. On the body the curve's square
            # corner to the front becomes the thigh's round one within a few centimetres: cut like that, the fork would end in a beak.
            thigh, knee = row_of["leg_thigh"], row_of["leg_knee"]
            ahead, behind = layout.crotch_point + layout.to_princess, len(curve) - 1 - layout.crotch_point
            at = np.arange(grid.shape[1])
            near = np.maximum(1.0 - at / ahead, 0.0) + np.maximum(1.0 - (len(at) - at) / behind, 0.0)
            _hang(out, layout, grid[: thigh + round(_HANGS * (knee - thigh)) + 1], near)
            # Around the thigh the rows run into the straight leg in a bow, or the outseam would have a corner.
            upper = out[grid[: knee + 1]]
            apart = float(np.linalg.norm(np.diff(upper[thigh:].mean(axis=1), axis=0), axis=1).mean())
            ramp = np.interp(np.arange(knee + 1), [0, 0.5 * thigh, 0.5 * (thigh + knee), knee], [0.0, 1.0, 1.0, 0.0])
            bow = smooth(upper, _THIGH_BOW / max(apart, 1e-9)) - upper
            out[grid[1:knee]] += (smoothstep(ramp)[:, None, None] * bow)[1:knee]
            # The leg is drawn towards the body at the thigh until its girth there is as wished, and stays straight down to its end.
            skin = body[grid[thigh]]
            off = out[grid[thigh]] - skin
            if too_wide(1.0, skin, off, wished) > 0.0 > too_wide(0.0, skin, off, wished):
                below = np.cumsum(np.linalg.norm(np.diff(out[grid].mean(axis=1), axis=0), axis=1)[thigh:])
                up = np.arange(thigh + 1) / thigh
                share_off = np.concatenate([np.sin(0.5 * np.pi * up), 1.0 - below / below[-1]])
                taken = (1.0 - brentq(too_wide, 0.0, 1.0, args=(skin, off, wished), xtol=1e-4)) * share_off
                out[grid[1:]] -= (taken[:, None, None] * off)[1:]


def _hang(out: FloatArray, layout: Layout, grid: IntArray, near: FloatArray | None = None) -> None:
    """Let the columns of a limb hang straight over their hollows from the first row to the last, into which they run without a corner.

    Args:
        out: #V by 3 [m], changed in place.
        layout: the grid.
        grid: #rows by #columns.
        near: #columns, from 0 where the columns stay to 1 where they hang; all hang without it.
    """
    rows = out[grid]
    arc = np.cumsum(np.linalg.norm(np.diff(rows, axis=0, prepend=rows[:1]), axis=2), axis=0)
    along = unit(rows[-1] - rows[0])
    outward = vertex_normals(out, layout.body_faces)[grid].mean(axis=0)
    outward -= along * np.einsum("ck,ck->c", along, outward)[:, None]
    way, height = (np.einsum("rck,ck->rc", rows - rows[0], axis) for axis in (along, outward))
    hung = rows.copy()
    for column in range(grid.shape[1]):
        touch = upper_hull(np.stack([way[:, column], height[:, column]], axis=1))
        for axis in range(3):
            hung[:, column, axis] = np.interp(arc[:, column], arc[touch, column], rows[touch, column, axis])
    share = (arc / arc[-1])[..., None]
    weight = 1.0 if near is None else smoothstep(near)[:, None]
    out[grid[1:-1]] += (weight * (1.0 - share * share) * (hung - rows))[1:-1]


def _leg_move(row: FloatArray, other: FloatArray | None, change: Adjustment, ease_cm: float, sign: float) -> FloatArray:
    """Return the displacement of a leg's closed row; its inside runs midway between the leg and the midplane (`sign`: +1 left)."""
    if other is not None:
        other = other + row.mean(axis=0) - other.mean(axis=0)
    move = _changed(row, other, change, ease_cm) - row
    outwards = 0.5 * float((sign * row[:, 0]).min()) - float((sign * (row + move)[:, 0]).min())
    move[:, 0] += sign * max(outwards, 0.0)
    return move


def _arm_move(row: FloatArray, other: FloatArray | None, change: Adjustment, ease_cm: float) -> FloatArray:
    """Return the displacement of an arm's closed row, in its own plane and about its middle."""
    middle = row.mean(axis=0)
    length = polyline_length(row, closed=True)
    shape = row - middle
    if other is not None:
        second = other - other.mean(axis=0)
        shape = (1.0 - change.weight) * shape + change.weight * second
    factor = change.scale * (1.0 + (2.0 * math.pi * change.offset_cm + ease_cm) / 100.0 / max(length, 1e-9))
    if factor <= 0.2:
        raise InputError(f"form: an arm profile of {length * 100:.0f} cm cannot shrink to {factor:.0%}")
    return middle + factor * shape - row


def bridge_row(row: FloatArray) -> FloatArray:
    """Return a closed level row with every vertex that lies in a hollow moved to the straight line across it."""
    from scipy.spatial import ConvexHull

    touch = np.sort(ConvexHull(row[:, [0, 2]]).vertices)
    s = arc_lengths(row, closed=True)
    at = np.append(s[touch], s[-1] + s[touch[0]])
    around = np.vstack([row[touch], row[touch[:1]]])
    places = np.where(s[:-1] < at[0], s[:-1] + s[-1], s[:-1])
    return np.column_stack([np.interp(places, at, around[:, i]) for i in range(3)])


def bridge_rows(out: FloatArray, grid: IntArray, row_of: Mapping[str, int], pair: tuple[str, str]) -> None:
    """Move what lies in a hollow between two levels out to the hull of all rows from the one to the other.

    A skirt hangs like this from the waist over the small of the back to the seat. Where a row stands out, it stays.

    Args:
        out: #V by 3 [m], changed in place.
        grid: rows of the trunk.
        row_of: its levels.
        pair: of levels.
    """
    low, high = sorted(row_of[level] for level in pair)
    ids = grid[low : high + 1]
    rows = out[ids]
    middle = rows.mean(axis=1)
    share = (middle[1:-1, 1] - middle[0, 1]) / (middle[-1, 1] - middle[0, 1])
    inner = rows[1:-1]
    # About one axis for all rows, so that a column of the grid does not bend as the rows' middles do.
    axis = middle[0] + share[:, None] * (middle[-1] - middle[0])
    starts = axis[:, None] * [1.0, 0.0, 1.0] + inner * [0.0, 1.0, 0.0]
    rays = inner - starts
    reach = np.maximum(_hull_reach(rows.reshape(-1, 3), starts, rays), 1.0)
    out[ids[1:-1]] = starts + reach[..., None] * rays


def rule_rows(
    out: FloatArray, grid: IntArray, row_of: Mapping[str, int], pair: tuple[str, str], solid: FloatArray | None
) -> None:
    """Lay the rows between two levels straight.

    Args:
        out: #V by 3 [m], changed in place.
        grid: rows of trunk, arm or leg.
        row_of: its levels.
        pair: of levels.
        solid: #P by 3, the body, over which cloth hangs where it stands out between the levels; None for an arm, whose
            rows share the way evenly whatever its direction.
    """
    for level in pair:
        if level not in row_of:
            raise InputError(f"form: ruled: level {level!r} is unknown: {nearest(level, row_of)}")
    a, b = sorted(row_of[level] for level in pair)
    if a == b:
        raise InputError(f"form: ruled: {pair[0]} and {pair[1]} are the same level")
    ids = grid[a : b + 1]
    first, last = out[ids[0]], out[ids[-1]]
    share = np.linspace(0.0, 1.0, len(ids))
    if solid is not None:
        share = (out[ids, 1].mean(axis=1) - first[:, 1].mean()) / (last[:, 1].mean() - first[:, 1].mean())
    straight = first + share[:, None, None] * (last - first)
    if len(ids) > 2 and solid is not None:
        low, high = sorted((first[:, 1].mean(), last[:, 1].mean()))
        between = solid[(solid[:, 1] > low) & (solid[:, 1] < high)]
        ends = np.concatenate([first, last])
        inner = straight[1:-1]
        middles = inner.mean(axis=1, keepdims=True) * [1.0, 0.0, 1.0] + inner * [0.0, 1.0, 0.0]
        rays = inner - middles
        alone, over = (_hull_reach(points, middles, rays) for points in (ends, np.concatenate([ends, between])))
        # Straight, except where the body pushes the hull out; the hull of the end rows alone is no straight line, so that
        # the body may stand out of the one and not of the other.
        bare = _hull_reach(between, middles, rays)
        pushed = np.maximum(np.where(over > alone * (1.0 + 1e-9), over, bare), 1.0)
        straight[1:-1] = middles + pushed[..., None] * rays
    out[ids] = straight


def _hull_reach(points: FloatArray, starts: FloatArray, rays: FloatArray) -> FloatArray:
    """Return how many of its own lengths each ray, #R by #P by 3, runs from inside the convex hull of `points` to it."""
    from scipy.spatial import ConvexHull

    planes = ConvexHull(points).equations
    normals = np.ascontiguousarray(planes[:, :3].T)
    reach = np.empty(rays.shape[:2])
    for row, (start, ray) in enumerate(zip(starts, rays, strict=True)):  # a row of them at a time stays in the cache
        rate = ray @ normals
        room = -(start @ normals + planes[:, 3])
        np.divide(room, rate, out=room, where=rate > 1e-12)
        room[rate <= 1e-12] = np.inf
        reach[row] = room.min(axis=1)
    return reach
