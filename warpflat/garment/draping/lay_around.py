"""A sewn garment is laid around a body by its openings alone: where a pattern from outside starts to be sewn.

A garment has few openings: a waist and a hem, a waist and two legs, a neck, a hem and two arms, or a neck, two arms and two legs. How many
there are, and how far apart along the cloth, tells which is which. Each becomes a ring around its limb, as far along it as the cloth
reaches, turned so that what is nearest to another opening looks there. The cloth between the rings is harmonic, and is then drawn as near
to its flat shape as it goes without the body (as rigid as possible, Sorkine and Alexa 2007).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, permutations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components, dijkstra

from warpflat.core import BoolArray, FloatArray, InputError, IntArray, factor_symmetric, polyline_length, unit
from warpflat.flat import border_edges
from warpflat.garment.draping.limbs import armpit_heights
from warpflat.garment.draping.openings import Opening
from warpflat.garment.draping.sew_around import AsRigid
from warpflat.garment.draping.sewn_cloth import SewnCloth
from warpflat.garment.mannequin.mannequin import Mannequin
from warpflat.garment.mannequin.slicer import UP

__all__ = ["Laid", "lay_around"]

# An opening that is longer than so many times the body's waist, beside those of two limbs, runs along a front that is open.
_OPEN_FRONT = 2.0
# The edge of a hood rises so far [m] from the throat to the crown (hoods .22 and .34, a collar with its placket .16, necks up to .06), and
# starts so far [m] before and below the middle of the face.
_HOOD, _BEFORE_FACE, _LOWER = 0.19, 0.02, 0.06
# The shortest way from a sleeve's end to the hem, but for this share, runs along the underarm. It is laid below the arm, from so far [m]
# below the armpit on.
_UNDERARM, _BESIDE_ARMPIT = 1.03, 0.1
# A leg ends at least so far [m] below the crotch.
_BELOW = 0.03
# How the rings hold the cloth, over its own stiffness, and for how many rounds.
_HOLDS = ((0.05, 30), (0.002, 20))


@dataclass(frozen=True, kw_only=True, eq=False)
class Laid:
    """A garment around a body.

    Attributes:
        positions: #V by 3 [m].
        limbs: around which limb each opening goes, such as "left arm"; "" for the trunk and the neck.
        hooded: whether it has a hood.
        level: #V, what hangs from no shoulder.
    """

    positions: FloatArray
    limbs: Sequence[str]
    hooded: bool
    level: BoolArray


@dataclass(frozen=True, kw_only=True, eq=False)
class _Ring:
    """An opening around a limb: its vertices, where they lie on the unit circle, and the circle's centre and half axes [m]."""

    vertices: IntArray
    circle: NDArray[np.complex128]
    centre: FloatArray
    axes: FloatArray

    def places(self) -> FloatArray:
        """Return #R by 3, the places of its vertices."""
        return np.asarray(self.centre + np.column_stack([self.circle.real, self.circle.imag]) @ self.axes)

    def turned(self, value: FloatArray, way: FloatArray) -> _Ring:
        """Return the ring turned so that what has the largest values (#R) looks a way; as it is if all are equal."""
        turn = complex(self.axes @ way @ [1.0, 1j]) / (complex((value - value.mean()) @ self.circle) or 1.0)
        return replace(self, circle=self.circle * turn / abs(turn))

    def nearest_places(self, points: FloatArray) -> FloatArray:
        """Return the places of its vertices (#R by 3) when it is turned as is nearest to points."""
        seen = (points - self.centre) @ self.axes.T @ [1.0, 1j]
        turn = complex(seen @ np.conj(self.circle))
        return replace(self, circle=self.circle * turn / abs(turn)).places()


def lay_around(
    cloth: SewnCloth,
    openings: Sequence[Opening],
    body: Mannequin,
    lines: Mapping[str, FloatArray],
    *,
    up: FloatArray,
    hints: FloatArray,
    top: Callable[[float], float],
    on_shoulders: bool = True,
) -> Laid:
    """Lay sewn cloth around a body.

    Args:
        cloth: the sewn cloth; where it is designed to lie does not matter.
        openings: of the garment.
        body: with its levels.
        lines: the body's limbs: see :func:`warpflat.garment.draping.limbs.limb_lines`.
        up: #V, how high each vertex lies in its piece [m].
        hints: #V by 3, where each vertex is said to lie: x is 1 to the left and z in front, -1 to the right and behind, 0 if unknown.
        top: the height [m] at which what does not hang from the shoulders hangs, by that of its highest opening in `up`.
        on_shoulders: whether a neck lies on the shoulders, else at the collar.

    Raises:
        InputError: the openings are not those of a garment.
    """
    graph, rigid = cloth.edge_lengths(), AsRigid(cloth)
    sides = set(map(tuple, border_edges(cloth.faces).tolist()))
    pairs = [
        pair for each in openings for pair in np.column_stack([each.vertices, np.roll(each.vertices, -1)]).tolist()
    ]
    # A border runs with the cloth on its left, seen from the right side of most of the pieces.
    handed = 1.0 if sum(tuple(pair) in sides for pair in pairs) >= 0.5 * len(pairs) else -1.0
    _, part = connected_components(graph, directed=False)
    laid, limbs, hooded, rings = np.zeros((len(cloth.designed), 3)), [""] * len(openings), False, list[_Ring]()
    level, under = np.zeros(len(laid), dtype=bool), dict[str, NDArray[np.intp]]()
    tops, armpits = list[tuple[BoolArray, _Ring]](), armpit_heights(body)
    for own in np.unique(part):
        rows = [k for k, each in enumerate(openings) if part[each.vertices[0]] == own]
        parted = [openings[k] for k in rows]
        far = np.array([dijkstra(graph, directed=False, indices=each.vertices, min_only=True) for each in parted])
        far[~np.isfinite(far)] = 0.0  # of other garments
        kinds = _kinds(parted, far, up, polyline_length(body.line("waist"), closed=True))
        edge = parted[kinds.index("neck" if "neck" in kinds else "waist")]
        highest, arms = edge.vertices, [k for k, kind in enumerate(kinds) if kind == "arm"]
        # The edge of a hood rises over the shoulders, from the throat to the crown.
        hood = bool(arms) and float(np.ptp(far[arms].mean(axis=0)[highest])) > _HOOD
        collar, shoulder = body.line("collar"), body.line("shoulder left")
        if "neck" not in kinds:
            high = top(float(up[highest].mean()))
        elif hood or not on_shoulders:
            high = float(collar[:, 1].mean())
        else:
            # The wider a neck, the farther out and the lower on the shoulders it lies.
            radius = np.maximum.accumulate([polyline_length(collar, closed=True) / (2.0 * np.pi), *shoulder[:, 0]])
            high = float(np.interp(edge.length / (2.0 * np.pi), radius, [collar[:, 1].mean(), *shoulder[:, 1]]))
        from_low = far[[k for k, kind in enumerate(kinds) if kind in ("hem", "leg")]].min(axis=0)
        # Without another sign the highest edge is deeper in front, nearer to the lowest ones.
        looks = hints * (part == own)[:, None]
        if not looks.any():
            looks[highest, 2] = -from_low[highest]
        trials = []
        for swapped in (False, True):
            named = _name_limbs(kinds, parted, far, swapped=swapped)
            found = _rings(graph, parted, far, named, hood, body, lines, hints=hints, high=high, handed=handed)
            places = _harmonic(rigid, found, part == own)
            trials.append((float((looks * places).sum()), places, found, named))
        _, places, found, named = max(trials, key=lambda trial: trial[0])
        laid[part == own] = places[part == own]
        level |= (part == own) & ("neck" not in kinds)
        rings += found
        tops += [] if "neck" in kinds else [(part == own, found[0])]
        hooded |= hood
        for k, name in zip(rows, named, strict=True):
            limbs[k] = name if name.endswith(("arm", "leg")) else ""
        for name, from_end in zip(named, far, strict=True):
            if name.endswith("arm"):
                both = np.where(part == own, from_end + from_low, np.inf)
                on_side = places[:, 1] > armpits[name] - _BESIDE_ARMPIT
                under[name] = np.flatnonzero((both < _UNDERARM * both.min()) & on_side)
    for weight, rounds in _HOLDS:
        held = np.zeros(len(laid))
        held[np.concatenate([ring.vertices for ring in rings] + list(under.values()))] = weight
        rigid.hold(held + 1e-6)
        for _ in range(rounds):
            target = laid.copy()
            for ring in rings:
                target[ring.vertices] = ring.nearest_places(laid[ring.vertices])
            for arm, below_arm in under.items():
                armhole, wrist = lines[arm][-3:-1]
                along = np.interp(np.abs(laid[below_arm, 0]), np.abs([armhole[0], wrist[0]]), [armhole[1], wrist[1]])
                target[below_arm, 1] = np.minimum(target[below_arm, 1], along - (armhole[1] - armpits[arm]))
            laid = rigid.step(laid, target)
    # Ways along a mesh are longer than in the cloth, so that lower rings drew the waist down.
    for hung, ring in tops:
        laid[hung, 1] += ring.centre[1] - laid[ring.vertices, 1].mean()
    return Laid(positions=laid, limbs=limbs, hooded=hooded, level=level)


def _kinds(openings: Sequence[Opening], far: FloatArray, up: FloatArray, waist: float) -> list[str]:
    """Return what each opening is: "neck", "waist", "hem", "arm", "leg", or "" for a hole.

    Args:
        openings: of one garment.
        far: #O by #V, how far each vertex is from each opening along the cloth [m].
        up: #V, how high each vertex lies in its piece [m].
        waist: the body's [m].
    """
    length = np.array([each.length for each in openings])
    apart = np.array([[row[each.vertices].min() for each in openings] for row in far])
    open_ones = [k for k, each in enumerate(openings) if not each.is_hole]
    # The longest five are those of limbs.
    found = open_ones[:5] if len(open_ones) > 1 else list(range(min(2, len(openings))))

    def differ(pair: tuple[int, int]) -> float:
        i, j = pair
        others = [k for k in found if k not in pair]
        return float(
            abs(length[i] - length[j]) / length[j]
            + sum(abs(apart[i, k] - apart[j, k]) / max(apart[i, k] + apart[j, k], 1e-9) for k in others)
        )

    if len(found) == 5:
        # Two pairs of twins and the neck; the arms are nearer to it.
        splits = [(k, (a, b), (c, d)) for k, a, b, c, d in permutations(found) if a < b and a < c < d]

        def unlike(split: tuple[int, tuple[int, int], tuple[int, int]]) -> float:
            single, *pairs = split
            return sum(
                abs(length[i] - length[j]) / length[j] + abs(apart[i, single] - apart[j, single]) for i, j in pairs
            )

        single, *pairs = min(splits, key=unlike)
        arms, legs = sorted(pairs, key=lambda pair: float(apart[single, list(pair)].sum()))
        named = {single: "neck", **dict.fromkeys(arms, "arm"), **dict.fromkeys(legs, "leg")}
    elif len(found) > 2:
        twins = min(combinations(found, 2), key=differ)
        others = sorted((k for k in found if k not in twins), key=lambda k: float(apart[k, list(twins)].sum()))
        if len(others) == 1 and length[others[0]] > _OPEN_FRONT * waist:
            raise InputError(
                f"slides off: its front is open, by a border of {length[others[0]]:.2f} m; close it by a seam, buttons or ties"
            )
        named = dict(zip(others, ["neck", "hem"] if len(others) == 2 else ["waist"], strict=True))
        named |= dict.fromkeys(twins, "arm" if len(others) == 2 else "leg")
    elif len(found) == 2:
        hem, high = sorted(found, key=lambda k: float(up[openings[k].vertices].mean()))
        named = {high: "waist", hem: "hem"}
    else:
        raise InputError(
            "falls off: the garment has a single opening, and goes around no part of the body; close it by a seam, buttons or ties"
        )
    return [named.get(k, "") for k in range(len(openings))]


def _name_limbs(kinds: Sequence[str], openings: Sequence[Opening], far: FloatArray, *, swapped: bool) -> list[str]:
    """Return the kinds of openings with their sides."""
    arms, legs = ([k for k, kind in enumerate(kinds) if kind == limb] for limb in ("arm", "leg"))
    if (
        arms
        and legs
        and far[arms[0]][openings[legs[0]].vertices].min() > far[arms[0]][openings[legs[1]].vertices].min()
    ):
        legs.reverse()
    left = {pair[1 if swapped else 0] for pair in (arms, legs) if pair}
    return [f"{'left' if k in left else 'right'} {kind}" if k in arms + legs else kind for k, kind in enumerate(kinds)]


def _rings(
    graph: csr_array,
    openings: Sequence[Opening],
    far: FloatArray,
    named: Sequence[str],
    hooded: bool,
    body: Mannequin,
    lines: Mapping[str, FloatArray],
    *,
    hints: FloatArray,
    high: float,
    handed: float,
) -> list[_Ring]:
    """Return the rings of a garment."""
    highest = named.index("neck" if "neck" in named else "waist")
    edge, waist, collar = openings[highest].vertices, body.line("waist"), body.line("collar").mean(axis=0)
    middle = 0.5 * (waist.min(axis=0) + waist.max(axis=0))
    left, ahead = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
    # How much nearer vertices are to the left limb than to the right one, or to the front than to the back.
    limb = next((each for each in ("arm", "leg") if f"left {each}" in named), "")
    aside = far[named.index(f"right {limb}")] - far[named.index(f"left {limb}")] if limb else None
    rings = list[_Ring]()
    for k in sorted(range(len(named)), key=lambda k: k != highest):
        each, name, reach = openings[k], named[k], float(far[k][edge].min())
        radius = each.length / (2.0 * np.pi)
        value, looks = (aside, left) if aside is not None else (hints[:, 2], ahead)
        if name == "neck":
            centre, out = collar * [1.0, 0.0, 1.0] + high * UP, UP
            if hooded:
                centre, out = lines["head"][2] - _LOWER * UP + _BEFORE_FACE * ahead, ahead
        elif name.endswith("arm"):
            line = lines[name][1:]
            # From the edge of the neck along the shoulder.
            reach += openings[highest].length / (2.0 * np.pi) if not hooded else 0.0
            beyond = max(0.0, reach - float(np.linalg.norm(line[1] - line[0])))
            out = unit(line[2] - line[1])
            centre = line[1] + beyond * out
            value, looks = (
                far[named.index("hem") if "hem" in named else named.index(name.replace("arm", "leg"))] - far[highest],
                UP,
            )
        elif name.endswith("leg"):
            line = lines[name][1:]
            height, out = min(high - reach, line[0, 1] - _BELOW), -UP
            centre = np.array([np.interp(-height, -line[:, 1], line[:, c]) for c in range(3)])
            side = 1.0 if name.startswith("left") else -1.0
            # Two wide legs lie beside each other.
            centre[0] = side * max(side * centre[0], radius)
            value, looks = -far[named.index("right leg" if side > 0.0 else "left leg")], -side * left
        elif name:
            # A slit is a part of its hem.
            reach, out = float(np.median(far[highest][each.vertices])), UP if name == "waist" else -UP
            centre = middle * [1.0, 0.0, 1.0] + (high - (0.0 if name == "waist" else reach)) * UP
        else:
            continue
        u = unit(np.cross(out, ahead if abs(out[2]) < 0.9 else UP))
        # With the cloth on its left a border runs clockwise about the way out of it.
        axes = radius * np.array([u, -handed * np.cross(out, u)])
        step = np.asarray(graph[each.vertices, np.roll(each.vertices, -1)])
        circle = np.exp(2j * np.pi * (np.cumsum(step) - step) / step.sum())
        ring = _Ring(vertices=each.vertices, circle=circle, centre=centre, axes=axes)
        if aside is None and rings:
            # What is nearest to the foremost place of the waist.
            foremost = rings[0].vertices[[rings[0].places()[:, 2].argmin(), rings[0].places()[:, 2].argmax()]]
            behind, before = dijkstra(graph, directed=False, indices=foremost)[:, each.vertices]
            rings.append(ring.turned(behind - before, looks))
        else:
            rings.append(ring.turned(value[each.vertices], looks))
    return rings


def _harmonic(rigid: AsRigid, rings: Sequence[_Ring], chosen: BoolArray) -> FloatArray:
    """Return the harmonic surface through the rings of the chosen vertices (#V), #V by 3 [m]; others are at 0."""
    places, free = np.zeros((len(chosen), 3)), chosen.copy()
    for ring in rings:
        places[ring.vertices] = ring.places()
        free[ring.vertices] = False
    pull = rigid.membrane @ places
    places[free] = factor_symmetric(rigid.membrane[free][:, free])(-pull[free])
    return places
