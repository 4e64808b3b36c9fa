"""What a garment is: up, front and left, its plane of symmetry, its borders by role, and its kind.

Borders tell most. Those that mirror each other beside the plane of symmetry are sleeves, armholes or legs; those in the plane are neck,
waist and hem. Where the garment is a tube that forks, the shortest way between two borders runs through the fork: the armpit, the crotch.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from warpflat.core import AXES, FloatArray, points_at_lengths, polyline_length, reflected, unit
from warpflat.flat import components
from warpflat.garment.seams.cloth import BESIDE_LINE, FACES, SAME_WAY, Cloth, section
from warpflat.garment.seams.fields import MirrorMap, mirror_map

__all__ = [
    "END",
    "FROM_SHOULDERS",
    "HOLE",
    "RING",
    "ROLES",
    "TAILORED",
    "Anatomy",
    "Border",
    "Limb",
    "averaged_limbs",
    "axis_name",
    "describe",
    "find_anatomy",
    "has_role",
]

Ids = NDArray[np.int64]
Kind = Literal[
    "top", "dress", "skirt", "trousers", "jumpsuit", "sleeve", "hat", "glove", "sock", "band", "closed", "other"
]

#: Kinds of garments that a tailor knows how to cut, and those of them that hang from the shoulders.
TAILORED = ("top", "dress", "skirt", "trousers", "jumpsuit")
FROM_SHOULDERS = ("top", "dress", "jumpsuit")

#: What borders are.
ROLES = ("neck", "waist", "hem", "sleeve", "leg", "opening", "armhole", "hole", "border", "middle", "limb")

# Lengths are shares of the square root of the area, unless they say otherwise.
# A border shorter than this is a hole: a buttonhole, or a fault of the mesh.
HOLE = 0.06
# Two borders mirror each other if their lengths agree within this ratio.
_PAIR_RATIO = 1.7
# An opening in front reaches down by at least this share of the garment's height.
_OPEN = 0.6
# A sleeve shorter than this is an armhole with a facing.
_SHORTEST_SLEEVE = 0.05
# The way along sleeve and side bends at the armpit by at least this [cosine of the angle between both].
_STRAIGHT = np.cos(np.radians(160.0))
# Nothing that is worn around the trunk is narrower [m]; no sleeve is wider, and no neck around which a poncho's upper end faces up.
_SLIMMEST = 0.6
# What is narrower below its upper end by this share is no skirt; if it goes on from its waist beyond the thigh, it is a dress.
_WAISTED = 0.93
# A waist is no longer than the cloth below it is wide by this; what goes on farther below an armhole, or a neck, than this is a dress [m].
_WAVES, _LONG = 1.25, 0.8
# The trunk of a newborn is so long, and so far around its widest opening [m]. From the waist to the thigh it is no farther than the third
# [m]; a leg's girth is there this share of the waist's.
_LEAST_BODY, _TO_THE_THIGH, _THIGH = (0.12, 0.28), 0.3, 0.35
# Openings around heads, and around wrists and ankles, are so long [m]; a hand is no thicker than this share of its width.
_HEADS, _HANDS, _FLAT_HAND = (0.38, 0.75), (0.1, 0.45), 0.65
# Above a hem that slants, the cloth tells left from right if it is at least this share of all.
_ENOUGH_ABOVE = 0.2
#: A border is a ring if its area vector is at least this of a circle's; an opening in front is none.
RING = 0.6
# Cloth that goes on from all its hems as a tube widened by more than this is a ball's with holes (a top's hem or sleeve .9 to 1.12, a
# ball's from 1.2 on).
_TUBE = 1.16
# It is turned around if it can be worn better by this.
_SURELY = 0.25
#: A garment ends above and below in such a share of its height: an opening in front does, and a hem that spans more slants.
END = 0.15
# A plane of symmetry holds if the mirror image of the cloth lies on the cloth within this (median).
_SYMMETRIC = 0.02
# Rounds of closest points for the plane of symmetry that is taken.
_MORE_ROUNDS = 40


@dataclass(frozen=True, kw_only=True, eq=False)
class Border:
    """A closed border.

    Attributes:
        vertices: in their order.
        middle: [m], length: [m].
        normal: the area vector of the loop over that of a circle as long: how level it is, and which way it faces.
        role: neck, waist, hem, sleeve, leg, opening, armhole, hole, or border.
        side: +1 on the garment's left, -1 on its right, 0 in the middle.
    """

    vertices: Ids
    middle: FloatArray
    length: float
    normal: FloatArray
    role: str = "border"
    side: int = 0

    @classmethod
    def measured(cls, vertices: FloatArray, loop: Ids) -> Border:
        """Return the border along a loop of vertices."""
        points = vertices[loop]
        following = np.roll(points, -1, axis=0)
        steps = np.linalg.norm(following - points, axis=1)
        length = float(steps.sum())
        middle = ((points + following) * (0.5 * steps[:, None])).sum(axis=0) / max(length, 1e-300)
        area = 0.5 * np.cross(points - middle, following - middle).sum(axis=0)
        return cls(vertices=loop, middle=middle, length=length, normal=area * (4.0 * np.pi / max(length, 1e-300) ** 2))


@dataclass(frozen=True, kw_only=True, eq=False)
class Limb:
    """A sleeve or a leg.

    Attributes:
        kind: "sleeve" or "leg".
        side: +1 left, -1 right.
        border: its number in the anatomy.
        fork: the place where its inner line meets that of the trunk or the other leg: the armpit, or the crotch [m].
        along: direction from the fork along the limb.
        length: from the fork to its end [m].
    """

    kind: Literal["sleeve", "leg"]
    side: int
    border: int
    fork: FloatArray
    along: FloatArray
    length: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Anatomy:
    """What a garment is.

    Attributes:
        kind: of garment.
        up, front: directions in space.
        normal, offset: the plane of symmetry, normal . x = offset; the normal points to the left.
        asymmetry: median distance of the mirrored cloth from the cloth [m].
        symmetric: whether it is its own mirror image in that plane.
        mirror: the mirror images of its vertices; None without symmetry.
        borders: by length.
        limbs: sleeves and legs.
        open_front: whether it opens from top to bottom in front.
        size: square root of its area [m].
        notes: what was chosen, one sentence each.
    """

    kind: Kind
    up: FloatArray
    front: FloatArray
    normal: FloatArray
    offset: float
    asymmetry: float
    symmetric: bool
    mirror: MirrorMap | None
    borders: tuple[Border, ...]
    limbs: tuple[Limb, ...]
    open_front: bool
    size: float
    notes: tuple[str, ...] = field(default=())

    def image(self, points: FloatArray) -> FloatArray:
        """Return the mirror images of points (... by 3 [m])."""
        return reflected(points, self.normal, self.offset)

    def across(self, points: FloatArray) -> FloatArray:
        """Return how far points (... by 3 [m]) lie to the left of the plane of symmetry [m]."""
        return np.asarray(points @ self.normal - self.offset)

    def limbs_of(self, kind: str) -> list[Limb]:
        """Return the sleeves, or the legs."""
        return [limb for limb in self.limbs if limb.kind == kind]

    def mate(self, limb: Limb) -> Limb | None:
        """Return the limb of the same kind on the other side, if there is one."""
        return next((one for one in self.limbs_of(limb.kind) if one.side == -limb.side), None)

    def border(self, role: str) -> Border | None:
        """Return the longest border of a role, if there is one."""
        return next((border for border in self.borders if border.role == role), None)

    @property
    def neck(self) -> Border | None:
        """The border around the neck: of what is open in front the opening; None for what hangs from the waist."""
        return self.border("neck") or self.border("opening")


def find_anatomy(cloth: Cloth, *, up: str | None = None, front: str | None = None) -> Anatomy:
    """Find out what a garment is.

    Args:
        cloth: one connected part, its normals pointing out.
        up, front: directions as "+y", "-z", where the user says them; +y and +z are tried first otherwise.
    """
    loops = [Border.measured(cloth.vertices, loop) for loop in cloth.loops]
    if up:
        made = _worn(cloth, loops, AXES[up], front)
    else:
        # +y is up, or +z where the openings lie level in z and not in y, or a garment that is open in front lies on its back.
        first, openings = AXES["+y"], [one for one in loops if one.length >= HOLE * cloth.size]
        if openings:
            level = np.sum([one.length * np.abs(one.normal) for one in openings], axis=0)
            longest = max(openings, key=lambda one: one.length)
            lies = level[2] > 2.0 * level[1] and level[2] > level[0]
            if np.linalg.norm(longest.normal) < RING and longest.length > 0.5 * sum(one.length for one in openings):
                # The thinnest way through it is from back to front.
                through = np.linalg.eigh(np.cov(cloth.vertices.T))[1][:, 0]
                lies = np.abs(through).argmax() == 1
            first = AXES["+z"] if lies else first
        made, turned = (_worn(cloth, loops, way, front) for way in (first, -first))
        made = turned if _wearable(cloth, turned) > _wearable(cloth, made) + _SURELY else made
        if made.up[1] < 0.5 and len(loops) > 1:
            why = "as its openings lie" if made.up @ first > 0.5 else "as nobody could wear it the other way up"
            words = f"up is taken as {axis_name(made.up)}, {why}; --up says otherwise"
            made = replace(made, notes=(words, *made.notes))
    if made.symmetric:
        made = replace(made, mirror=mirror_map(cloth, made.normal, made.offset, reach=BESIDE_LINE * made.size))
    return made


def _wearable(cloth: Cloth, anatomy: Anatomy) -> float:
    """Return how well a body could wear a garment this way up, from about -1 to 2.

    A head needs an opening. A neck is shorter than a hem, and a waist, too; sleeves begin near the neck and hang.
    """
    heights = cloth.vertices @ anatomy.up
    low, tall = float(heights.min()), max(float(np.ptp(heights)), 1e-300)

    def end(role: str, highest: bool) -> float:
        """Return the girth of the trunk's end [m]: of a circle as large as its border; of an opening in front, the length there."""
        own = anatomy.border(role)
        if own is not None:
            return own.length * float(np.sqrt(np.linalg.norm(own.normal)))
        opening = anatomy.border("opening")
        if opening is None:
            return 0.0
        ring = cloth.vertices[np.append(opening.vertices, opening.vertices[0])]
        level = heights[opening.vertices]
        at_end = (level > level.max() - END * tall) if highest else (level < level.min() + END * tall)
        return float(np.linalg.norm(np.diff(ring, axis=0), axis=1)[at_end].sum())

    if anatomy.kind not in TAILORED:
        return -0.5
    if anatomy.kind == "trousers":
        return 0.0
    if anatomy.kind == "jumpsuit":
        neck = anatomy.neck
        return 2.0 * float(heights[neck.vertices].max() - low) / tall - 1.0 if neck is not None else -1.0
    above, below = end("waist" if anatomy.kind == "skirt" else "neck", True), end("hem", False)
    if not above or not below:
        return -1.0
    sleeves = anatomy.limbs_of("sleeve")
    # One that leads to the other side begins elsewhere.
    outward = [float(limb.along @ anatomy.normal) * limb.side > 0.0 for limb in sleeves]
    hangs = [-float(limb.along @ anatomy.up) if out else -1.0 for limb, out in zip(sleeves, outward, strict=True)]
    hang = sum(hangs) / max(len(sleeves), 1)
    begin = sum((float(limb.fork @ anatomy.up) - low) / tall - 0.5 for limb in sleeves) / max(len(sleeves), 1)
    return (below - above) / (below + above) + hang + begin


def _worn(cloth: Cloth, raw: Sequence[Border], upward: FloatArray, front: str | None) -> Anatomy:
    """Return what a garment is that is worn with `upward` up, without its mirror images; see `find_anatomy`.

    `raw` are its borders, measured.
    """
    size = cloth.size
    notes: list[str] = []
    # A hem that slants says nothing about the body: the cloth beside it has no mass.
    heights, mass = cloth.vertices @ upward, cloth.mass
    wide = [heights[one.vertices] for one in raw if one.length >= HOLE * size]
    if len(wide) > 1:
        hem = min(wide, key=lambda own: float(own.mean()))
        above = mass * (heights > hem.max())
        slants = np.ptp(hem) > END * np.ptp(heights) and above.sum() > _ENOUGH_ABOVE * mass.sum()
        mass = above if slants else mass
    normal, offset, asymmetry = _plane_of_symmetry(cloth.vertices, mass, upward, size)
    holds = asymmetry <= _SYMMETRIC * size
    side = unit(np.cross(upward, normal))
    beside, ahead = (
        [abs(float(border.middle @ across) - at) for border in _roles(raw, across, at, size) if border.role == "limb"]
        for across, at in ((normal, offset), (side, float(np.median(cloth.vertices @ side))))
    )
    # A sleeve that comes forward is beside the plane between front and back, too, yet it is farther off to its side.
    one_sleeve = (
        holds
        and sum(one.length >= HOLE * size for one in raw) > 2
        and len(beside) < 2
        and max(ahead, default=0.0) > max(beside, default=0.0)
    )
    if one_sleeve:
        # The plane lies between front and back.
        holds = False
    forward = AXES["+z"] if abs(upward[2]) < 0.5 else AXES["-y"]
    if front:
        given = AXES[front] - (AXES[front] @ upward) * upward
        forward = given if np.linalg.norm(given) >= 0.5 else forward
    elif one_sleeve:
        across = np.cross(side, upward)
        forward = across * (1.0 if across @ forward >= 0.0 else -1.0)
    if holds:
        level = unit(normal - (normal @ upward) * upward)
        across = np.cross(upward, forward)
        # Front is at right angles to the plane of symmetry, unless the user says that it is not.
        if abs(across @ level) > 0.5 or not front:
            turned = np.cross(level, upward)
            forward = turned * (1.0 if turned @ forward >= -1e-9 else -1.0)
    left = unit(np.cross(upward, forward))
    forward = np.cross(left, upward)
    if not holds or abs(normal @ left) < 0.5:
        normal, offset = left, float(np.median(cloth.vertices @ left))
    normal, offset = (normal, offset) if normal @ left > 0 else (-normal, -offset)
    borders = _roles(raw, normal, offset, size)
    kind, borders, open_front = _kind(cloth, borders, upward)
    limbs = _limbs(cloth, borders, upward)
    if holds:
        # An armhole whose facing is as long as the shortest sleeve is the same on both sides.
        both = {(limb.kind, limb.side) for limb in limbs}
        mates = {(border.role, -border.side) for border in borders}
        limbs = [limb for limb in limbs if (limb.kind, limb.side) not in mates or (limb.kind, -limb.side) in both]
    if front is None:
        turned_words = _faces_backwards(cloth, borders, kind, upward, forward, open_front)
        if turned_words:
            notes.append(turned_words)
            forward, normal, offset = -forward, -normal, -offset
            borders = [replace(border, side=-border.side) for border in borders]
            limbs = [replace(limb, side=-limb.side) for limb in limbs]
    if one_sleeve:
        notes.append("it has a sleeve on one side alone: each side has its own lines")
    elif not holds:
        notes.append(
            f"it has no plane of symmetry (mirrored, it is {1e3 * asymmetry:.0f} mm off): each side has its own lines"
        )
    return Anatomy(
        kind=kind,
        up=upward,
        front=forward,
        normal=normal,
        offset=offset,
        asymmetry=asymmetry,
        symmetric=holds,
        mirror=None,
        borders=tuple(borders),
        limbs=tuple(limbs),
        open_front=open_front,
        size=size,
        notes=tuple(notes),
    )


def has_role(cloth: Cloth, vertices: Ids, *roles: str) -> NDArray[np.bool_]:
    """Return whether vertices of a cloth whose field "role" says so are at borders of some roles."""
    known = np.round(cloth.values["role"][vertices]) if "role" in cloth.values else np.zeros(len(vertices))
    return np.isin(known, [1 + ROLES.index(role) for role in roles])


def describe(anatomy: Anatomy) -> str:
    """Return what a garment is, in a few words: "top, two sleeves, open in front"."""
    words: list[str] = [anatomy.kind]
    for kind in ("sleeve", "leg"):
        count = len(anatomy.limbs_of(kind))
        if count and anatomy.kind not in (kind, "trousers"):
            words.append(f"{count} {kind}{'s' if count > 1 else ''}")
    if anatomy.open_front:
        words.append("open in front")
    return ", ".join(words)


def axis_name(direction: FloatArray) -> str:
    """Return the axis of space that is nearest to a direction, as "+y"."""
    k = int(np.abs(direction).argmax())
    return f"{'+' if direction[k] > 0 else '-'}{'xyz'[k]}"


def _plane_of_symmetry(
    vertices: FloatArray, mass: FloatArray, upward: FloatArray, size: float
) -> tuple[FloatArray, float, float]:
    """Return normal, offset [m] and asymmetry [m] of the plane in which a surface is most its own mirror image.

    Closest points again and again, from twelve upright planes through the middle.
    """
    tree = cKDTree(vertices)
    share = mass / mass.sum()
    # Quadrature points of equal area, and so independent of how fine the mesh is where.
    rank = np.searchsorted(np.cumsum(share), (np.arange(900) + 0.5) / 900)
    points = vertices[np.unique(np.minimum(rank, len(vertices) - 1))]
    middle = points.mean(axis=0)
    one = np.cross(upward, [1.0, 0.0, 0.0] if abs(upward[0]) < 0.9 else [0.0, 1.0, 0.0])
    one /= np.linalg.norm(one)
    other = np.cross(upward, one)

    def closer(normal: FloatArray, offset: float, rounds: int) -> tuple[float, FloatArray, float]:
        """Return the asymmetry of a plane after some rounds of closest points, its normal and its offset."""
        for _ in range(rounds):
            away, nearest = tree.query(reflected(points, normal, offset))
            near = away <= max(float(np.quantile(away, 0.8)), 1e-3 * size)
            p, q = points[near], vertices[nearest[near]]
            p_mean, q_mean = p.mean(axis=0), q.mean(axis=0)
            spread = (p - p_mean).T @ (q - q_mean)
            values, axes = np.linalg.eigh(spread + spread.T)
            # Of the three the one that is nearest to the plane before: the smallest may be the thickness of a flat thing.
            k = int(np.abs(axes.T @ normal).argmax()) if values[1] - values[0] < 0.05 * values[2] else 0
            normal = axes[:, k] * (1.0 if axes[:, k] @ normal >= 0 else -1.0)
            offset = float(normal @ (p_mean + q_mean)) / 2.0
        return float(np.median(tree.query(reflected(points, normal, offset))[0])), normal, offset

    normals = [np.cos(angle) * one + np.sin(angle) * other for angle in np.pi / 12 * np.arange(12)]
    found = [closer(normal, float(normal @ middle), 6) for normal in normals]
    # A lying plane (above against below) is no garment's.
    upright = [one for one in found if abs(one[1] @ upward) < 0.5] or found
    best = min(upright, key=lambda one: one[0])
    # Round things have many: the one nearest to the axes is taken.
    as_good = [one for one in upright if one[0] <= best[0] + 0.004 * size]
    best = max(as_good, key=lambda one: (round(float(abs(one[1][0])), 2), -one[0]))
    # The lean of a coarse mesh is found slowly.
    best = min(best, closer(best[1], best[2], _MORE_ROUNDS), key=lambda one: one[0])
    spacing = float(np.median(tree.query(vertices[:: max(1, len(vertices) // 500)], k=2)[0][:, 1]))
    # Images fall between vertices: what the mesh's own spacing explains is no asymmetry.
    return best[1], best[2], max(0.0, best[0] - 0.5 * spacing)


def _roles(raw: Sequence[Border], normal: FloatArray, offset: float, size: float) -> list[Border]:
    """Return the borders: pairs beside the plane of symmetry as "limb", those in the middle as "middle", and holes."""
    across = [float(one.middle @ normal) - offset for one in raw]
    roles = ["hole" if one.length < HOLE * size else "middle" for one in raw]
    pairs = []
    for i, j in combinations(range(len(raw)), 2):
        if "hole" in (roles[i], roles[j]) or across[i] * across[j] >= 0.0:
            continue
        away = float(np.linalg.norm(reflected(raw[i].middle, normal, offset) - raw[j].middle))
        short, long = sorted((raw[i].length, raw[j].length))
        if (
            away < 0.7 * abs(across[i] - across[j])
            and long < _PAIR_RATIO * short
            and min(abs(across[i]), abs(across[j])) > BESIDE_LINE * size
        ):
            pairs.append((away, i, j))
    for _, i, j in sorted(pairs):
        if roles[i] == roles[j] == "middle":
            roles[i] = roles[j] = "limb"
    widest = max(map(abs, across), default=0.0)
    longest = max((one.length for one in raw), default=0.0)
    for i, one in enumerate(raw):
        # One sleeve alone.
        if roles[i] == "middle" and abs(across[i]) > max(0.15 * size, 0.5 * widest) and one.length < 0.6 * longest:
            roles[i] = "limb"
    return [
        replace(one, role=role, side=int(np.sign(at)) if role == "limb" else 0)
        for one, role, at in zip(raw, roles, across, strict=True)
    ]


def _kind(cloth: Cloth, borders: Sequence[Border], upward: FloatArray) -> tuple[Kind, list[Border], bool]:
    """Return the kind, the borders with their roles, and whether the front is open."""
    heights = cloth.vertices @ upward
    tall = max(float(np.ptp(heights)), 1e-300)

    def level(border: Border) -> float:
        return float(border.middle @ upward)

    def span(border: Border) -> float:
        return float(np.ptp(heights[border.vertices])) / tall

    middles = sorted((border for border in borders if border.role == "middle"), key=level)
    # No arm and no leg is as thin as that; what has one more opening alone, and ends at the thigh, is as wide as a thigh.
    thigh = _THIGH * middles[0].length if len(middles) == 1 and tall < _TO_THE_THIGH else 0.0
    thin = max(_HANDS[0], thigh)
    limbs = sorted((border for border in borders if border.role == "limb" and border.length > thin), key=level)
    girth = max((border.length for border in middles), default=0.0)
    if tall < _LEAST_BODY[0] or (len(limbs) < 4 and girth < _LEAST_BODY[1]):
        limbs = []
    # An opening from top to bottom is no ring.
    open_front = bool(limbs) and any(span(one) > _OPEN and np.linalg.norm(one.normal) < RING for one in middles)
    roles = dict.fromkeys(middles, "border")
    kind: Kind = "other" if middles else "closed"
    if len(limbs) >= 4:
        kind = "jumpsuit"
        roles |= {border: "leg" if number < 2 else "sleeve" for number, border in enumerate(limbs)}
        roles |= {border: "opening" if span(border) > _OPEN else "neck" for border in middles}
    elif limbs and len(middles) == 1 and not open_front and level(limbs[-1]) < level(middles[0]):
        kind = "trousers"
        roles |= {middles[0]: "waist"} | dict.fromkeys(limbs, "leg")
    elif limbs:
        kind = "top"
        roles |= dict.fromkeys(limbs, "sleeve")
        if open_front:
            roles[max(middles, key=span)] = "opening"
        elif len(middles) == 1:
            roles[middles[0]] = "hem" if level(middles[0]) < 0.5 * (heights.min() + heights.max()) else "neck"
        else:
            roles[middles[0]], roles[middles[-1]] = "hem", "neck"
        if (hem := next((border for border in middles if roles[border] == "hem"), None)) is not None:
            faces_down = abs(hem.normal @ upward) > FACES * np.linalg.norm(hem.normal)
            if not (faces_down and min(_widening(cloth, border) for border in (hem, *limbs)) < _TUBE):
                # A ball with holes.
                kind, roles = "other", dict.fromkeys((*middles, *limbs), "border")
            else:
                # From the neck, or the armhole, down, a dress is longer than a body is to the hip.
                top = level(limbs[-1] if middles[-1] is hem else middles[-1])
                long = top - float(heights[hem.vertices].min())
                kind = "dress" if long > min(_LONG, 0.95 * hem.length) else "top"
    elif len(middles) == 2:
        kind = _between_two(cloth, middles[0], middles[1], upward)
        if kind in TAILORED:
            roles = {middles[0]: "hem", middles[1]: "waist" if kind == "skirt" else "neck"}
    elif len(middles) == 1:
        kind = _one_border(cloth, middles[0], upward)
    hidden = [border for border in borders if border.role == "limb" and border not in limbs]
    made = [
        replace(border, role="hole", side=0)
        if border in hidden
        else replace(border, role=roles.get(border, border.role))
        for border in borders
    ]
    return kind, made, open_front


def _widening(cloth: Cloth, border: Border) -> float:
    """Return the area within a border's radius of it, over that of a tube: more than 1 for a ball."""
    radius = border.length / (2.0 * np.pi)
    far = dijkstra(cloth.graph, directed=False, indices=border.vertices, min_only=True)
    near = far[cloth.faces].mean(axis=1) <= radius
    return float(cloth.face_areas[near].sum() / max(radius * border.length, 1e-300))


def _between_two(cloth: Cloth, lower: Border, upper: Border, upward: FloatArray) -> Kind:
    """Return what a tube or a ring between two borders is: a band, around the trunk, a sleeve, or something else."""
    short, long = sorted((lower.length, upper.length))
    girth, apart = 0.5 * (short + long), float(np.linalg.norm(upper.middle - lower.middle))
    if apart < 0.2 * girth:
        return "band"
    if float((upper.middle - lower.middle) @ upward) > 0.5 * apart and girth > _SLIMMEST:
        # Around the trunk a skirt is narrowest at its upper end, a waist. A top's end runs up and down between straps and armholes, or goes
        # around a neck from which cloth lies over the shoulders. What widens again below a waist is a dress.
        low = float((cloth.vertices[lower.vertices] @ upward).max())
        heights = cloth.vertices @ upward
        high = float(heights[upper.vertices].min())
        if high - low < 0.02:
            return "skirt"
        everywhere = np.ones(len(cloth.faces), dtype=bool)
        levels = np.linspace(high, low, 17)[1:-1]
        girths = np.array([section(cloth, heights - level, everywhere)[0] for level in levels])
        narrowest = int(girths.argmin())
        if upper.length > _WAVES * girths[narrowest]:
            return "dress" if high - low > _LONG else "top"
        near = heights[cloth.faces].mean(axis=1) > high - END * (high - low)
        area = cloth.face_areas[near]
        lies = float((np.abs(cloth.face_normals[near] @ upward) * area).sum() / max(float(area.sum()), 1e-300))
        if upper.length < _SLIMMEST and lies > FACES:
            return "dress" if high - low > _LONG else "top"
        if girths[narrowest] > _WAISTED * girths[0]:
            return "skirt"
        return "dress" if levels[narrowest] - low > _TO_THE_THIGH else "top"
    return "sleeve" if girth < _SLIMMEST and apart > 0.75 * girth and long < _PAIR_RATIO * short else "other"


def _one_border(cloth: Cloth, border: Border, upward: FloatArray) -> Kind:
    """Return what a thing with one border is: a hat, a sock or a glove if its size and its shape say so, else "other"."""
    others = [loop for loop in cloth.loops if not np.array_equal(np.sort(loop), np.sort(border.vertices))]
    if sum(polyline_length(cloth.vertices[loop], closed=True) for loop in others) > 0.5 * border.length:
        return "other"
    if border.length > 3.0 * cloth.size or sum(cloth.shape) != 2:
        # A disk that is no deeper than a panel, or a thing with a handle, as a mug.
        return "other"
    way = cloth.vertices - border.middle
    depth = way @ upward
    girth, radius = border.length, border.length / (2.0 * np.pi)
    if _HEADS[0] < girth < _HEADS[1] and max(0.5 * radius, -2.0 * depth.min()) < depth.max() < 2.0 * girth:
        return "hat"
    if not _HANDS[0] < girth < _HANDS[1]:
        return "other"
    # A foot is much longer than the leg above it is wide.
    level = way - np.outer(depth, upward)
    tall = -float(depth.min())
    if tall > 2.0 * depth.max():
        foot, leg = level[depth < -0.75 * tall], level[depth > -0.4 * tall]
        axes = np.linalg.eigh(foot.T @ foot)[1] if len(foot) > 2 else np.eye(3)
        spans = np.ptp(foot @ axes[:, 1:], axis=0) if len(foot) > 2 else np.zeros(2)
        if len(leg) and spans[1] > 1.8 * max(float(np.ptp(leg @ axes[:, 2])), float(spans[0])):
            return "sock"
    # A hand is flat, and its thumb or its fingers stand apart.
    areas = cloth.face_areas
    along = unit(areas @ way[cloth.faces].mean(axis=1))
    reach = way @ along
    outer = way[reach > 0.4 * reach.max()]
    outer = outer - np.outer(outer @ along, along)
    axes = np.linalg.eigh(np.cov(outer.T))[1] if len(outer) > 3 else np.eye(3)
    thick, wide = np.ptp(outer @ axes[:, 1:], axis=0)
    if thick < _FLAT_HAND * wide and reach.max() > 0.6 * girth:
        for part in np.linspace(0.3, 0.95, 14):
            above = reach[cloth.faces] > part * reach.max()
            crossed = cloth.faces[above.any(axis=1) & ~above.all(axis=1)].astype(np.int32)
            if len(crossed) and components(crossed).max() > 0:
                return "glove"
    return "other"


def _limbs(cloth: Cloth, borders: Sequence[Border], upward: FloatArray) -> list[Limb]:
    """Return the limbs with their forks, which the shortest ways between borders pass through."""
    arms = [i for i, border in enumerate(borders) if border.role == "sleeve"]
    legs = [i for i, border in enumerate(borders) if border.role == "leg"]
    if not arms and not legs:
        return []
    heights = cloth.vertices @ upward
    found = []
    for i in (*arms, *legs):
        own = borders[i]
        if i in arms:
            # To the lower part of the trunk's end: the hem, the lower part of an opening, or the legs.
            ends = [b.vertices for b in borders if b.role in ("hem", "opening", "leg")]
            if not ends:
                continue
            goal = np.concatenate(ends)
            goal = goal[heights[goal] <= heights[goal].min() + 0.25 * (heights.max() - heights[goal].min())]
        else:
            mates = [borders[j].vertices for j in legs if j != i]
            if not mates:
                continue
            goal = np.concatenate(mates)
        far, before, _ = dijkstra(
            cloth.graph, directed=False, indices=own.vertices, min_only=True, return_predecessors=True
        )
        end = int(goal[np.argmin(far[goal])])
        if not np.isfinite(far[end]):
            continue
        way = [end]
        while before[way[-1]] >= 0:
            way.append(int(before[way[-1]]))
        points = cloth.vertices[way[::-1]]
        fork, along, length, bend = _fork(points, upward, cloth.size)
        if i in arms and (bend < _STRAIGHT or length < _SHORTEST_SLEEVE * cloth.size):
            continue
        found.append(
            Limb(
                kind="sleeve" if i in arms else "leg",
                side=own.side or 1,
                border=i,
                fork=fork,
                along=along,
                length=length,
            )
        )
    return found


def averaged_limbs(anatomy: Anatomy, *, alike: bool) -> tuple[Limb, ...]:
    """Return the limbs, each the mean of itself and its mate's mirror image where both are nearly the same, or all `alike`."""
    if anatomy.mirror is None:
        return anatomy.limbs
    made = []
    for limb in anatomy.limbs:
        mate = anatomy.mate(limb)
        if mate is not None:
            along = reflected(mate.along, anatomy.normal)
            fork = anatomy.image(mate.fork)
            near = along @ limb.along > SAME_WAY and np.linalg.norm(fork - limb.fork) < BESIDE_LINE * anatomy.size
            if alike or near:
                length = 0.5 * (limb.length + mate.length)
                limb = replace(limb, along=unit(along + limb.along), fork=0.5 * (fork + limb.fork), length=length)
        made.append(limb)
    return tuple(made)


def _fork(points: FloatArray, upward: FloatArray, size: float) -> tuple[FloatArray, FloatArray, float, float]:
    """Return where a way along a limb and on along the trunk bends most, the direction from there along the limb, and its length.

    Returns:
        The place, the direction, the length from the first point to the place [m], and the cosine of the angle between both legs.
    """
    total = polyline_length(points)
    samples = np.linspace(0.0, total, 201)
    line = points_at_lengths(points, samples)
    for _ in range(2):
        # The way follows edges: its steps are smoothed away.
        line[1:-1] = 0.25 * line[:-2] + 0.5 * line[1:-1] + 0.25 * line[2:]
    reach = max(3, int(200 * 0.2 * size / max(total, 1e-300)))

    def legs(at: int) -> tuple[FloatArray, FloatArray, int]:
        r = max(3, min(at, 200 - at, reach))
        low, high = max(0, at - r), min(200, at + r)
        return unit(line[low] - line[at]), unit(line[high] - line[at]), r

    # Where it comes up from the limb and goes down again. At the waist a way bends, too, and a short sleeve bends it near its end only.
    rises = [-r * float((one + other) @ upward) for one, other, r in map(legs, range(1, 200))]
    at = 1 + int(np.argmax(rises))
    for _ in range(4):
        one, other, r = legs(at)
        low, high = max(0, at - r), min(200, at + r)
        step = line[low : high + 1] @ -(one + other)
        new = low + int(step.argmax())
        new = min(max(new, 1), 199)
        if new == at:
            break
        at = new
    return line[at], unit(line[0] - line[at]), float(samples[at]), float(one @ other)


def _faces_backwards(
    cloth: Cloth, borders: Sequence[Border], kind: Kind, upward: FloatArray, forward: FloatArray, open_front: bool
) -> str:
    """Return why the garment faces the other way, or "": an opening lies in front, a neck is lower in front."""
    heights, depth = cloth.vertices @ upward, cloth.vertices @ forward
    told = f"at the {axis_name(-forward)} side, which is taken as its front; --front says otherwise"
    opening = next((border.vertices for border in borders if border.role == "opening"), None)
    if open_front and opening is not None:
        # Between top and bottom only the edges of the opening are left.
        own = heights[opening]
        inner = opening[np.abs(own - 0.5 * (own.min() + own.max())) < 0.2 * np.ptp(own)]
        behind = len(inner) > 0 and np.median(depth[inner]) < np.median(depth) - 0.02 * cloth.size
        return f"it opens {told}" if behind else ""
    neck = next((border.vertices for border in borders if border.role == "neck"), None)
    if neck is not None and kind in FROM_SHOULDERS:
        ahead = depth[neck] > np.median(depth[neck])
        front, back = (np.quantile(heights[neck[chosen]], 0.1) for chosen in (ahead, ~ahead))
        return f"its neck is lower {told}" if front - back > 0.06 * cloth.size else ""
    return ""
