"""Where a tailor cuts: shoulder, side, armhole, underarm, inseam, centre front and back, each the zero line of a smooth field."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from warpflat.core import FloatArray, reflected, unit
from warpflat.flat import border_loops, components
from warpflat.garment.seams.anatomy import Anatomy, Limb
from warpflat.garment.seams.cloth import FACES, ISLAND, LEVELS, SAME_WAY, Cloth, edge_components, section

__all__ = [
    "BESIDE",
    "FACING",
    "LEFT",
    "centre_lines",
    "cut_as_a_tailor",
    "draw_fields",
    "side_word",
    "with_drawn_sleeves",
]

Ids = NDArray[np.int64]

# Lengths are shares of the garment's size, the square root of its area.
# Wrinkles that are shorter than some three of these do not bend a seam.
_SMOOTH = 0.035
# The armhole leans outwards towards the shoulder by this [rad]: a body is wider there than at the armpit.
_LEAN = np.radians(8.0)
# The armhole is looked for in such steps outwards, from half of one outside of the armpit.
_STEP = 0.008
# Its length falls by no more than this over the way outwards once it runs around the sleeve.
_STEEP = 3.0
# Nor does its plane follow an arm further than this: one that hangs, and one that is raised.
_HANGS, _RAISED = np.radians(-4.0), np.radians(30.0)
# A hood is wider, across its opening, than the neck below it by this, and the shoulders are by the second. Its opening goes up by at
# least this share of its height.
_WIDER, _SHOULDERS, _FACE = 1.1, 1.4, 0.5
#: A line that the user has drawn is meant where a tailor would have cut within this; what is drawn further off the cloth is a mistake.
BESIDE = 0.08
# A sleeve has no more than this share of the neck, or of the opening.
_NECK = 0.35

#: The field that is positive in front, the one that is positive on the left, and those that are positive in a sleeve.
FACING, LEFT = "front", "left"


def side_word(side: float) -> str:
    """Return "left" for a positive number, else "right"."""
    return "left" if side > 0 else "right"


def draw_fields(cloth: Cloth, anatomy: Anatomy) -> Cloth:
    """Return the cloth with the fields whose zero lines are seams: front, left, "sleeve 0" and so on; symmetric where the garment is."""
    size, mirror = anatomy.size, anatomy.mirror
    normal = cloth.smooth(cloth.vertex_normals, _SMOOTH * size)
    by_normals = normal @ anatomy.front / np.maximum(np.linalg.norm(normal, axis=1), 1e-3)
    armholes = _armhole_fields(cloth, anatomy)
    # Along sleeves and legs the place around the axis says how far vertices face to the front: wrinkles do not turn it.
    facing = by_normals.copy()
    regions = [(limb, armholes[number]) for number, limb in enumerate(anatomy.limbs_of("sleeve")) if number in armholes]
    regions += [(limb, (limb.fork - cloth.vertices) @ anatomy.up) for limb in anatomy.limbs_of("leg")]
    for limb, beyond in regions:
        rim = anatomy.borders[limb.border].vertices
        own = cloth.reached(beyond > 0.0, rim)
        others = np.flatnonzero(~own)
        if len(others) == 0 or own.sum() < 30:
            continue
        along = cloth.solve(np.concatenate([rim, others]), np.concatenate([np.ones(len(rim)), np.zeros(len(others))]))
        # The middle of each of some rings, as a smooth curve.
        count = int(np.clip(own.sum() // 40, 4, 24))
        order = np.flatnonzero(own)[np.argsort(along[own], kind="stable")]
        mass = cloth.mass[order]
        ring = np.minimum((np.cumsum(mass) / mass.sum() * count).astype(np.int64), count - 1)
        total = np.maximum(np.bincount(ring, mass, minlength=count), 1e-300)
        at = np.bincount(ring, mass * along[order], minlength=count) / total
        middle = np.stack(
            [np.bincount(ring, mass * x, minlength=count) / total for x in cloth.vertices[order].T], axis=1
        )
        degree = min(4, count - 1)
        curve = np.polynomial.polynomial.polyfit(at, middle, degree)
        tangent = np.polynomial.polynomial.polyder(curve)
        t = np.clip(along[own], at.min(), at.max())
        way = unit(np.asarray(np.polynomial.polynomial.polyval(t, tangent).T, dtype=np.float64))
        off = cloth.vertices[own] - np.polynomial.polynomial.polyval(t, curve).T
        off -= np.einsum("ij,ij->i", off, way)[:, None] * way
        weight = np.clip(4.0 * along[own], 0.0, 1.0)
        facing[own] = (1.0 - weight) * by_normals[own] + weight * (unit(off) @ anatomy.front)
    left = anatomy.across(cloth.vertices)
    beside = [border for border in anatomy.borders if border.side]
    if {border.side for border in beside} == {1, -1}:
        given = np.concatenate([np.full(len(border.vertices), float(border.side)) for border in beside])
        left = cloth.solve(np.concatenate([border.vertices for border in beside]), given)
        left = left if mirror is None else mirror.symmetrised(left, -1.0)
    # The cloth at the centre lines is wholly in front, or wholly behind.
    changes = (left[cloth.faces].min(axis=1) < 0.0) & (left[cloth.faces].max(axis=1) >= 0.0)
    centre = np.unique(cloth.faces[changes])
    # Between, at a crotch, it faces neither way.
    centre = centre[np.abs(facing[centre]) > FACES]
    front = cloth.solve(centre, np.sign(facing[centre]), data=facing, length=2.0 * _SMOOTH * size)
    front = front if mirror is None else mirror.symmetrised(front)
    sleeves = {f"sleeve {number}": field for number, field in armholes.items()}
    return cloth.with_values(**{FACING: front, LEFT: left}, **sleeves)


def _armhole_fields(cloth: Cloth, anatomy: Anatomy) -> dict[int, FloatArray]:
    """Return for each sleeve, by its number, how far vertices are outside of its armhole [m]: negative in the trunk.

    The armhole lies in a plane that faces between the side and the sleeve's direction, and leans outwards to the shoulder. It begins at
    the armpit and moves outwards as long as its length falls fast: there it still runs along the trunk.
    """
    found: dict[int, tuple[FloatArray, float]] = {}
    limbs, size = anatomy.limbs_of("sleeve"), anatomy.size
    for number, limb in enumerate(limbs):
        fork, along = limb.fork, limb.along
        outwards, up = limb.side * anatomy.normal, anatomy.up
        outwards = unit(outwards - (outwards @ up) * up)
        for _ in range(2):
            # It faces half way from the side to the sleeve, and not far below the level. It turns forwards with an arm as far as that is
            # raised: a shoulder does. A sleeve that hangs is set forwards in its armhole.
            half = outwards + along
            rise = np.clip(np.arctan2(half @ up, max(float(half @ outwards), 1e-3)), _HANGS, _RAISED)
            flat = half - (half @ up) * up
            flat -= (1.0 - max(rise / _RAISED, 0.0)) * (flat - (flat @ outwards) * outwards)
            angle = rise - _LEAN
            direction = np.asarray(np.cos(angle) * unit(flat) + np.sin(angle) * up)
            outside = _outside(cloth, anatomy, limb, (cloth.vertices - fork) @ direction)
            if outside is None:
                break
            offset, middle = outside
            found[number] = direction, float(fork @ direction) + offset
            way = anatomy.borders[limb.border].middle - middle
            if np.linalg.norm(way) < 0.05 * size:
                break
            along = way / np.linalg.norm(way)
    for number, limb in enumerate(limbs):
        other_limb = anatomy.mate(limb)
        mate = None if other_limb is None else limbs.index(other_limb)
        if limb.side > 0 and mate is not None and {number, mate} <= found.keys() and anatomy.mirror is not None:
            # Both planes become the mean of one and the mirror image of the other, if these are much the same.
            (one, at), (other, there) = found[number], found[mate]
            normal = anatomy.normal
            image = reflected(other, normal)
            shift = there - 2.0 * anatomy.offset * float(other @ normal)
            rim = anatomy.borders[limb.border].middle
            if abs((rim @ one - at) - (rim @ image - shift)) < BESIDE * size and one @ image > SAME_WAY:
                length = float(np.linalg.norm(one + image))
                both, level = (one + image) / length, (at + shift) / length
                found[number] = both, level
                found[mate] = reflected(both, normal), level - 2.0 * anatomy.offset * float(both @ normal)
    return {number: cloth.vertices @ direction - at for number, (direction, at) in found.items()}


def _outside(cloth: Cloth, anatomy: Anatomy, limb: Limb, height: FloatArray) -> tuple[float, FloatArray] | None:
    """Return how far outside of a plane through the armpit the armhole lies [m], and the middle of its loop; None if there is none."""
    rim = anatomy.borders[limb.border].vertices
    others = [b for k, b in enumerate(anatomy.borders) if k != limb.border]
    step = _STEP * anatomy.size
    # Sections that run around the sleeve alone, from the innermost on: their offsets, lengths and middles.
    around = list[tuple[float, float, FloatArray]]()
    bare: tuple[float, FloatArray] | None = None
    for number in range(60):
        offset = (number + 0.5) * step
        beyond = cloth.reached(height > offset, rim)
        if offset >= height[rim].min():
            break
        shares = [float(beyond[border.vertices].mean()) for border in others]
        crossed = {border.role for border, share in zip(others, shares, strict=True) if share > 0.0}
        if bare is None and beyond[rim].all() and crossed == {"neck"} and max(shares) <= _NECK:
            bare = offset, section(cloth, height - offset, np.asarray(beyond[cloth.faces].any(axis=1)))[1]
        if not beyond[rim].all() or crossed:
            around = []
            continue
        if bare is not None:
            # A neck that leaves the shoulders bare ends on the sleeves, and so does the armhole.
            return bare
        around.append((offset, *section(cloth, height - offset, np.asarray(beyond[cloth.faces].any(axis=1)))))
        if len(around) > 3 and all(around[k][1] - around[k + 2][1] < _STEEP * 2.0 * step for k in (-4, -3)):
            return around[-4][::2]
    return around[0][::2] if around else bare


def _sleeves(cloth: Cloth, anatomy: Anatomy) -> Iterator[tuple[int, str, Limb]]:
    """Yield the number, the field and the limb of each sleeve that has one."""
    for number, limb in enumerate(anatomy.limbs_of("sleeve")):
        if f"sleeve {number}" in cloth.values:
            yield number, f"sleeve {number}", limb


def cut_as_a_tailor(cloth: Cloth, anatomy: Anatomy, *, hood: bool = True) -> tuple[Cloth, list[str]]:
    """Return the cloth cut where a tailor would cut it, and notes; a hood in one with the trunk if it is not to be cut off.

    Its faces have the label "sleeve": the number of the sleeve, or -1.

    Args:
        cloth: with its fields (see `draw_fields`).
        anatomy: of the garment.
        hood: whether it is cut off.
    """
    cloth, notes = with_drawn_sleeves(cloth, anatomy), list[str]()
    sleeves = list(_sleeves(cloth, anatomy))
    for number, name, limb in sleeves:
        if number in cloth.labels["sleeve"]:
            continue
        cut = _cut_armhole(cloth, anatomy, name, limb, number)
        if cut is None:
            notes.append(
                f"no line around the {side_word(limb.side)} sleeve was found: it is cut in one with the front and back"
            )
        else:
            cloth = cut
    cloth = _cut_hood(cloth, anatomy) if hood else cloth
    legs = anatomy.limbs_of("leg")
    if legs:
        cloth, centre = centre_lines(cloth)
        for name, edges in centre.items():
            if len(edges):
                cloth = cloth.with_seam(name, edges)
    for number in range(-1, len(anatomy.limbs_of("sleeve"))):
        cloth = cloth.without_islands(FACING, cloth.labels["sleeve"] == number)
    cloth, ahead, _ = cloth.split(FACING, np.ones(len(cloth.faces), dtype=bool))
    trunk = cloth.labels["sleeve"] < 0
    armpits = [float(limb.fork @ anatomy.up) for _, _, limb in sleeves]
    # Above the middle of the armholes a line is a shoulder where there are no sleeves.
    bare = [float(border.middle @ anatomy.up) for border in anatomy.borders if border.role == "sleeve"]
    upper = float(np.mean(bare)) if bare else np.inf
    lines = cloth.line_between(ahead, trunk)
    on_left = cloth.values[LEFT][lines].mean(axis=1) > 0.0
    ends: list[tuple[str, Ids]] = []
    for leftwards in (True, False):
        parts = edge_components(lines[on_left == leftwards])
        # The one that is the nearest to the crotch is the inseam.
        near = [
            np.linalg.norm(cloth.vertices[part.ravel()] - leg.fork, axis=1).min() for leg in legs[:1] for part in parts
        ]
        for k, part in enumerate(parts):
            heights = cloth.vertices[part.ravel()] @ anatomy.up
            if near and k == int(np.argmin(near)) and len(parts) > 1:
                word = "inseam"
            elif heights.min() > min(armpits) + 0.02 * anatomy.size if armpits else heights.mean() > upper:
                word = "shoulder"
            else:
                word = "side"
            name = f"{word} {side_word(1.0 if leftwards else -1.0)}"
            cloth = cloth.with_seam(name, part)
            ends.append((word, part))
    low = np.unique(
        np.concatenate([part.ravel() for word, part in ends if word in ("side", "inseam")] or [np.empty(0, np.int64)])
    )
    for number, _, limb in sleeves:
        if number not in cloth.labels["sleeve"]:
            continue
        # It is opened along the line that goes on from the side seam.
        own = cloth.labels["sleeve"] == number
        armhole = np.intersect1d(cloth.faces[own], cloth.faces[~own])
        for part in edge_components(cloth.line_between(ahead, own)):
            touches = np.unique(part)
            if all(np.isin(touches, known).any() for known in (armhole, low, cloth.border_edges)):
                cloth = cloth.with_seam(f"underarm {side_word(limb.side)}", part)
                break
    return cloth, notes


def centre_lines(cloth: Cloth) -> tuple[Cloth, dict[str, Ids]]:
    """Return the cloth split between left and right of the trunk, and the edges of the lines in front and behind by name."""
    cloth, _, _, edges = cloth.parted(LEFT, cloth.labels["sleeve"] < 0)
    ahead = cloth.values[FACING][edges].mean(axis=1) > 0.0
    return cloth, {"centre front": edges[ahead], "centre back": edges[~ahead]}


def with_drawn_sleeves(cloth: Cloth, anatomy: Anatomy, *, anywhere: bool = False) -> Cloth:
    """Return the cloth with the label "sleeve": the number of the sleeve that seams have cut off already, or -1.

    Args:
        cloth: with its fields (see `draw_fields`).
        anatomy: of the garment.
        anywhere: whether a sleeve may begin elsewhere than near its armhole, and with some of the neck, as a raglan sleeve does.
    """
    part, label = cloth.parts, np.full(len(cloth.faces), -1, dtype=np.int64)
    whole = np.bincount(part, cloth.face_areas)
    for number, name, limb in _sleeves(cloth, anatomy):
        rim = anatomy.borders[limb.border].vertices
        if anywhere:
            # Parts that lie outside of the armhole, most of them: a cuff does, and the sleeve above it.
            beyond = cloth.reached(cloth.values[name] > 0.0, rim)[cloth.faces].mean(axis=1) * cloth.face_areas
            own = (np.bincount(part, beyond) > 0.5 * whole)[part]
        else:
            own = np.isin(part, part[np.isin(cloth.faces, rim).any(axis=1)])
        line = np.intersect1d(cloth.faces[own], cloth.faces[~own])
        others = [b for k, b in enumerate(anatomy.borders) if k != limb.border and b.role != "hole"]
        most = max((float(np.isin(border.vertices, cloth.faces[own]).mean()) for border in others), default=0.0)
        near = anywhere or (len(line) > 0 and np.abs(cloth.values[name][line]).mean() <= BESIDE * anatomy.size)
        if len(line) and near and most <= (_NECK if anywhere else 0.0):
            label[own] = number
    return cloth.with_labels(sleeve=label)


def _cut_armhole(cloth: Cloth, anatomy: Anatomy, name: str, limb: Limb, number: int) -> Cloth | None:
    """Return the cloth with an armhole cut: the first line outside of the armpit that closes around the sleeve; None if none does."""
    rim = anatomy.borders[limb.border].vertices
    base = cloth.values[name]
    for outwards in np.arange(0.0, BESIDE, _STEP) * anatomy.size:
        everywhere = np.ones(len(cloth.faces), dtype=bool)
        trial = cloth.with_values(**{name: base - outwards})
        trial = trial.without_islands(name, everywhere, keep=ISLAND / 20)
        # Only the part beyond the line that holds the sleeve's end is the sleeve.
        part = trial.reached(trial.values[name] > 0.0, rim)
        if not part[rim].all():
            continue
        trial, positive, _ = trial.split(name, np.asarray(part[trial.faces].any(axis=1)))
        grown = np.append(part, np.zeros(len(trial.vertices) - len(part), dtype=bool))
        sleeve = positive & grown[trial.faces].any(axis=1)
        if len(border_loops(trial.faces[sleeve].astype(np.int32))) != 2:
            continue
        trial = trial.with_labels(sleeve=np.where(sleeve, number, trial.labels["sleeve"]))
        edges = trial.line_between(sleeve, np.ones(len(trial.faces), dtype=bool))
        return trial.with_seam(f"armhole {side_word(limb.side)}", edges)
    return None


def _cut_hood(cloth: Cloth, anatomy: Anatomy) -> Cloth:
    """Return the cloth with a hood cut off where the neck is narrowest, and in halves; as it is if it has none.

    A hood widens above the neck, and its opening, or the front's, goes up along the face. Its line lies in a plane from there to the
    nape. Its faces have the label "sleeve" behind the last sleeve: lines of the trunk do not run in it.
    """
    opening = anatomy.neck
    if opening is None:
        return cloth
    trunk = cloth.labels["sleeve"] < 0
    heights, ahead = cloth.vertices @ anatomy.up, cloth.vertices @ anatomy.front
    used = np.unique(cloth.faces[trunk])
    top = float(heights[used].max())
    shoulder = max(
        (float(limb.fork @ anatomy.up) for limb in anatomy.limbs_of("sleeve")), default=top - 0.4 * anatomy.size
    )
    levels = np.linspace(shoulder, top, LEVELS)[1:-1]
    loop, around = cloth.vertices[opening.vertices], list[float]()
    for level in levels:
        # Around the cloth, and across the opening between the two places where that is as high: a hood is open there.
        girth, height = section(cloth, heights - level, trunk)[0], heights[opening.vertices] - level
        under = height < 0.0
        first = np.flatnonzero(under != np.roll(under, -1))
        if len(first) == 2:
            following = (first + 1) % len(loop)
            share = (height[first] / (height[first] - height[following]))[:, None]
            one, other = loop[first] + share * (loop[following] - loop[first])
            girth += float(np.linalg.norm(other - one))
        around.append(girth)
    girths = np.array(around)
    # The narrowest level above which it is wider again, and below which the shoulders are much wider.
    above, below = np.maximum.accumulate(girths[::-1])[::-1], np.maximum.accumulate(girths)
    is_neck = (above > _WIDER * girths) & (below > _SHOULDERS * girths)
    neck = int(np.where(is_neck, girths, np.inf).argmin())
    # Its seam lies at the neck's root, where the shoulders begin.
    level = float(levels[1 + max(np.flatnonzero(girths[:neck] > _SHOULDERS * girths[neck]), default=-1)])
    rim = heights[opening.vertices]
    if not is_neck[neck] or rim.max() - level < _FACE * (top - level):
        return cloth
    nape = used[np.abs(heights[used] - level) < 0.03 * anatomy.size]
    nape = nape[ahead[nape].argmin()] if len(nape) else used[heights[used].argmax()]
    low = opening.vertices[int(rim.argmin())]
    # A plane that is no steeper than half a right angle, a little above the lowest place of the opening; level where that is far below.
    rise, depth = float(rim.min()) + 0.01 * anatomy.size - level, float(ahead[low] - ahead[nape])
    slope = rise / depth if depth > 0.0 and abs(rise) < depth else 0.0
    field = heights - level - slope * (ahead - ahead[nape])
    trial, beyond, within, edges = cloth.parted(field, trunk)
    hood = beyond & within
    if components(trial.faces[hood].astype(np.int32)).max() > 0:
        return cloth
    number = len(anatomy.limbs_of("sleeve"))
    trial = trial.with_labels(sleeve=np.where(hood, number, trial.labels["sleeve"])).with_seam("hood", edges)
    trial, _, _, middle = trial.parted(LEFT, hood)
    return trial.with_seam("hood centre", middle)
