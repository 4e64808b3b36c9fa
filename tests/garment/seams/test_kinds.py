"""A garment is called by a name only where its size and its shape say so."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache

import numpy as np
import pytest
import seam_solids as solids

import warpflat
from warpflat.flat.surface.mesh import Surface
from warpflat.garment.seams.anatomy import Anatomy, axis_name, describe, find_anatomy
from warpflat.garment.seams.find import cloth_of


def loft(rings: Sequence[tuple[Sequence[float], float, float]], *, closed: bool = False, slope: float = 0.0) -> Surface:
    """A tube through ellipses about places, across the way between them; `closed` at its last; the first one slants along x."""
    around = 32
    turn = np.arange(around) * 2 * np.pi / around
    centres = np.array([ring[0] for ring in rings], dtype=float)
    along = np.gradient(centres, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    vertices = list[np.ndarray]()
    for (_, wide, deep), centre, way in zip(rings, centres, along, strict=True):
        across = np.cross(way, [1.0, 0.0, 0.0])
        ring = centre + wide * np.outer(np.sin(turn), [1.0, 0.0, 0.0]) + deep * np.outer(np.cos(turn), across)
        if slope and not vertices:
            ring[:, 1] += slope * ring[:, 0]
        vertices += list(ring)
    faces = [
        [r * around + k, r * around + (k + 1) % around, (r + 1) * around + (k + 1) % around, (r + 1) * around + k]
        for r in range(len(rings) - 1)
        for k in range(around)
    ]
    if closed:
        last = (len(rings) - 1) * around
        vertices.append(centres[-1] + 0.2 * rings[-1][1] * along[-1])
        faces += [[last + k, last + (k + 1) % around, len(vertices) - 1, -1] for k in range(around)]
    return warpflat.make_surface(np.array(vertices), faces)


def girths(*rows: tuple[float, float]) -> Surface:
    """A tube around the trunk, through heights and widths [m]."""
    heights = np.linspace(rows[0][0], rows[-1][0], 24)
    wide = np.interp(heights, *zip(*rows, strict=True))
    return loft([((0.0, y, 0.0), w, 0.7 * w) for y, w in zip(heights, wide, strict=True)])


def beanie() -> Surface:
    turn = np.linspace(0.0, 0.48 * np.pi, 14)
    return loft([((0.0, 0.15 * np.sin(t), 0.0), 0.09 * np.cos(t), 0.1 * np.cos(t)) for t in turn], closed=True)


def sock() -> Surface:
    leg = [((0.0, y, 0.0), 0.045, 0.045) for y in np.linspace(0.25, 0.05, 8)]
    heel = [((0.0, 0.05 - 0.05 * np.sin(t), 0.05 - 0.05 * np.cos(t)), 0.045, 0.045) for t in np.linspace(0.3, 1.5, 6)]
    foot = [((0.0, 0.0, z), 0.042, 0.04) for z in np.linspace(0.07, 0.2, 6)]
    return loft([*leg, *heel, *foot], closed=True)


def mitten() -> Surface:
    parts = [solids.rod([0, 0, 0], [0, 0.17, 0], 0.045, 0.5), solids.rod([0.02, 0.06, 0], [0.085, 0.14, 0], 0.016)]
    return solids.skin(
        solids.joined(parts, 0.006), [-0.07, -0.07, -0.05], [0.13, 0.24, 0.05], 0.009, [([0, 0.0, 0], [0, -1, 0])]
    )


def shoe_upper() -> Surface:
    """From the edge of the sole up to the ankle."""
    rows = [(0.0, 0.045, 0.13, 0.05), (0.03, 0.045, 0.12, 0.045), (0.07, 0.042, 0.06, 0.0), (0.1, 0.035, 0.04, -0.03)]
    y, wide, deep, z = np.array(rows).T
    at = np.linspace(0.0, 0.1, 14)
    return loft([((0.0, h, np.interp(h, y, z)), np.interp(h, y, wide), np.interp(h, y, deep)) for h in at.tolist()])


def mug() -> Surface:
    parts = [
        solids.rod([0, 0, 0], [0, 0.1, 0], 0.04, 0.6),
        solids.rod([0, 0.02, 0], [0.08, 0.02, 0], 0.012),
        solids.rod([0.08, 0.02, 0], [0.08, 0.09, 0], 0.012),
        solids.rod([0.08, 0.09, 0], [0, 0.09, 0], 0.012),
    ]
    return solids.skin(
        solids.joined(parts, 0.004), [-0.06, -0.06, -0.05], [0.12, 0.16, 0.05], 0.012, [([0, 0.11, 0], [0, 1, 0])]
    )


def poncho() -> Surface:
    at = np.linspace(1.0, 0.0, 20)
    return loft([((0.0, -0.55 * t**1.2, 0.0), 0.1 + 0.5 * t**0.9, 0.08 + 0.3 * t) for t in at.tolist()])


def halter() -> Surface:
    """A tube around the trunk, cut out under both arms up to the neck."""
    tube = girths((0.0, 0.16), (0.55, 0.15))
    x, y, _ = tube.vertices[tube.faces].mean(axis=1).T
    return warpflat.make_surface(tube.vertices, tube.faces[np.abs(x) < 0.16 - np.maximum(y - 0.3, 0.0) / 2])


def pouch() -> Surface:
    return loft([((0.0, y, 0.0), 0.11, 0.1) for y in np.linspace(0.3, 0.0, 12)], closed=True)


def ball_with_holes(*ways: Sequence[float]) -> Surface:
    openings = [(0.18 * np.array(way), way) for way in ways]
    return solids.skin(lambda points: np.linalg.norm(points, axis=1) - 0.2, [-0.24] * 3, [0.24] * 3, 0.02, openings)  # type: ignore[arg-type]


def ball_of_equal_holes() -> Surface:
    return ball_with_holes([0.0, -1.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [-1.0, 0.0, 0.0])


def ball_of_any_holes() -> Surface:
    return ball_with_holes([0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [-0.707, -0.707, 0.0])


def anatomy_of(surface: Surface) -> Anatomy:
    cloth = cloth_of(surface)
    return find_anatomy(cloth)


@cache
def known(make: Callable[[], Surface]) -> tuple[Surface, Anatomy]:
    """A garment by formula and what it is, each once in a process."""
    surface = make()
    return surface, anatomy_of(surface)


@pytest.mark.parametrize(
    ("kind", "make"),
    [
        ("skirt", lambda: girths((0.0, 0.24), (0.6, 0.13))),
        ("skirt", lambda: girths((0.0, 0.165), (0.4, 0.17), (0.6, 0.13))),
        ("top", lambda: girths((0.0, 0.13), (0.25, 0.165))),
        ("dress", lambda: girths((0.0, 0.3), (0.6, 0.12), (0.85, 0.165))),
        ("top", poncho),
        ("top", halter),
        ("hat", beanie),
        ("sock", sock),
        ("glove", mitten),
        ("other", shoe_upper),
        ("other", mug),
        ("other", pouch),
        ("other", ball_of_equal_holes),
        ("other", ball_of_any_holes),
    ],
    ids=[
        "skirt",
        "pencil skirt",
        "tube top",
        "strapless dress",
        "poncho",
        "halter",
        "beanie",
        "sock",
        "mitten",
        "shoe upper",
        "mug",
        "pouch",
        "ball of equal holes",
        "ball of any holes",
    ],
)
def test_what_is_not_surely_something_is_called_other(kind: str, make: Callable[[], Surface]) -> None:
    assert describe(anatomy_of(make())) == kind


def test_a_slanted_hem_does_not_turn_a_skirt_around() -> None:
    straight = girths((0.0, 0.28), (0.7, 0.14))
    slanted = loft(
        [((0.0, y, 0.0), 0.28 - 0.2 * y, 0.7 * (0.28 - 0.2 * y)) for y in np.linspace(0.0, 0.7, 24)], slope=0.6
    )
    for surface in (straight, slanted):
        anatomy = anatomy_of(surface)
        assert (anatomy.kind, axis_name(anatomy.front)) == ("skirt", "+z")


def test_one_sleeve_is_beside_the_trunk_though_it_comes_forward() -> None:
    plain = solids.shirt(arm=0.5, step=0.035)
    x = plain.vertices[:, 0]
    forward = plain.vertices + np.outer(0.8 * np.maximum(np.abs(x) - 0.2, 0.0), [0.0, 0.0, 1.0])
    kept = x[plain.faces[:, :3]].max(axis=1) < 0.22
    anatomy = anatomy_of(warpflat.make_surface(forward, plain.faces[kept], component="largest"))
    assert (describe(anatomy), axis_name(anatomy.front)) == ("top, 1 sleeve", "+z")
    assert anatomy.limbs[0].side == -1


def test_armholes_are_sleeves_on_both_sides_or_on_none() -> None:
    # What there is of its sleeves is as long as the shortest sleeve on one side, and a little shorter on the other.
    anatomy = anatomy_of(solids.shirt(arm=0.0, sleeve=0.18, step=0.045))
    assert {limb.side for limb in anatomy.limbs} in (set(), {1, -1})


@pytest.mark.parametrize("make", [solids.shirt, solids.trousers, solids.jumpsuit, solids.skirt, poncho])
def test_what_stands_on_its_head_is_turned_upright(make: Callable[[], Surface]) -> None:
    plain, upright = known(make)
    turned = warpflat.make_surface(plain.vertices * [1.0, -1.0, -1.0], plain.faces, closed=True)
    upset = anatomy_of(turned)
    assert axis_name(upright.up) == "+y"
    assert describe(upset) == describe(upright)
    assert axis_name(upset.up) == "-y"
    assert any("--up says otherwise" in note for note in upset.notes)


@pytest.mark.parametrize("make", [solids.shirt, solids.jumpsuit])
def test_a_neck_is_lower_in_front(make: Callable[[], Surface]) -> None:
    plain, ahead = known(make)
    x, y, z = plain.vertices[plain.faces[:, :3]].mean(axis=1).T
    low = plain.faces[~((y > 0.5) & (np.abs(x) < 0.1) & (z > 0.0))]
    behind = anatomy_of(warpflat.make_surface(plain.vertices * [-1.0, 1.0, -1.0], low, component="largest"))
    assert (describe(behind), axis_name(ahead.front)) == (describe(ahead), "+z")
    assert axis_name(behind.front) == "-z"


@pytest.mark.parametrize(("make", "least"), [(solids.trousers, 0.4), (solids.shirt, 0.5), (solids.jumpsuit, 0.5)])
def test_a_toys_clothes_are_no_garments_and_a_childs_are(make: Callable[[], Surface], least: float) -> None:
    plain, adult = known(make)
    child, toy = (
        anatomy_of(warpflat.make_surface(share * plain.vertices, plain.faces, closed=True)) for share in (least, 0.15)
    )
    assert child.kind == adult.kind
    assert toy.kind == "other"


def test_a_cap_with_holes_over_the_ears_is_no_pair_of_trousers() -> None:
    ways = ([0.0, -1.0, 0.0], 0.0), ([1.0, -0.5, 0.0], 0.085), ([-1.0, -0.5, 0.0], 0.085)
    openings = [(np.array(way) / np.linalg.norm(way) * at, way) for way, at in ways]
    cap = solids.skin(lambda points: np.linalg.norm(points, axis=1) - 0.095, [-0.12] * 3, [0.12] * 3, 0.012, openings)  # type: ignore[arg-type]
    assert anatomy_of(cap).kind in ("hat", "other")
