"""Patterns are sewn around a thin body that grows: sleeves by their seams, limbs drawn out, openings linked with limbs, tangles refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bodies import body_of_size
from cloths import cylinder_body, grid, sheet
from devices import DEVICE
from plain_patterns import ARMHOLE, top

import warpflat
from warpflat.core.errors import InputError
from warpflat.flat.surface.connectivity import border_loops
from warpflat.garment.draping.check_sewn import check_sewn, pierced_edges
from warpflat.garment.draping.drape_pattern import Placement, drape_pattern
from warpflat.garment.draping.limbs import DRAWN_OUT, hangs_beyond, limb_lines, links, on_arm
from warpflat.garment.draping.mesh_pieces import mesh_pieces, sew_meshes
from warpflat.garment.draping.openings import find_openings
from warpflat.garment.draping.options import DrapeOptions
from warpflat.garment.draping.sew_around import sew_around, stretches
from warpflat.garment.draping.thin_body import ThinBody, draw_out_limbs
from warpflat.pattern.drafting.pieces import Pattern


def shirt() -> Pattern:
    """A top of two equal pieces, of which one is said to lie in front, and two sleeves; one sleeve is drawn upside down."""
    (front, *others), seams = top()
    return Pattern(name="shirt", pieces={"": [replace(front, at="front"), *others]}, seams=seams)


def test_limbs_run_on_and_a_thin_body_grows():
    body = body_of_size(30.0)
    surface = body.surface()
    vertices, faces = draw_out_limbs(surface.vertices, surface.faces)
    loops = border_loops(faces)
    assert len(loops) == len(border_loops(surface.faces))
    # Both ankles end 30 cm lower, side by side; the surface stays one, wound alike.
    assert vertices[:, 1].min() == pytest.approx(surface.vertices[:, 1].min() - 0.3)
    directed = np.concatenate([faces[:, [k, (k + 1) % 4]] for k in range(4)])
    assert len(np.unique(directed, axis=0)) == len(directed)
    # Balls in a cylinder have its radius; thin, it has .35 of it, and halfway the mean of both.
    tube = cylinder_body(radius=0.1, height=0.6, columns=40)
    thin, far = ThinBody(tube), np.array([[0.3, 0.3, 0.0]])
    for share, radius in ((0.0, 0.035), (0.5, 0.0675), (1.0, 0.1)):
        thin.grow(share)
        assert thin.nearest(far)[0][0, 0] == pytest.approx(radius, abs=4e-3)
        np.testing.assert_allclose(thin.nearest(far)[1][0], [1.0, 0.0, 0.0], atol=0.05)
    thin.grow(1.0)
    np.testing.assert_allclose(tube.nearest(far)[0][0], [0.1, 0.3, 0.0], atol=2e-3)


def test_openings_are_linked_with_the_limbs_that_they_go_around():
    body = body_of_size(30.0)
    lines, skin = limb_lines(body), body.surface().vertices
    assert (skin[on_arm(skin, lines)][:, 1] > lines["left arm"][-2][1] - 0.1).all()
    angle = np.linspace(0.0, 2.0 * np.pi, 40, endpoint=False)

    def ring(middle: np.ndarray, radius: float, axis: np.ndarray) -> np.ndarray:
        u = np.cross(axis, [0.0, 0.0, 1.0])
        u /= np.linalg.norm(u)
        v = np.cross(axis, u)
        return middle + radius * (np.outer(np.cos(angle), u) + np.outer(np.sin(angle), v / np.linalg.norm(v)))

    for limb in ("left arm", "right arm", "left leg", "right leg"):
        near, end = lines[limb][-3:-1]
        # Not quite in the middle of the ring, where a line would meet the corner that all triangles of the fan share.
        found = links(ring(0.5 * (near + end) + [0.004, 0.003, 0.002], 0.05, end - near), lines)
        assert {each: abs(count) for each, count in found.items()} == {each: int(each == limb) for each in found}
        assert not any(links(ring(0.5 * (near + end) + [0.0, 0.0, 0.2], 0.05, end - near), lines).values())
        # Beyond its end nothing is there to go around.
        way = (end - near) / np.linalg.norm(end - near)
        for beyond in (0.1, 0.4):
            aside = ring(end + beyond * way + [0.0, 0.0, 0.2], 0.05, way)
            assert hangs_beyond(aside, limb, lines) == (beyond > max(DRAWN_OUT.values()))
    up = np.array([0.0, 1.0, 0.0])
    hem, neck = (links(ring(middle, 0.4, up), lines) for middle in (lines["left leg"][1] * [0, 1, 1], lines["head"][1]))
    assert hem["left leg"] == hem["right leg"] != 0
    assert hem["left arm"] == hem["right arm"] == 0
    # Around the neck is around all else, the other way round, and so is around the face.
    assert len(set(neck.values())) == 1
    assert abs(neck["left arm"]) == 1
    face = links(ring(lines["head"][2] + [0.0, 0.0, 0.3], 0.1, np.array([0.01, 0.0, 1.0])), lines)
    assert {abs(count) for count in face.values()} == {1}


def test_a_shirt_is_sewn_by_its_seams_alone():
    """Around both arms in the end; one that lies beside its arm, or is crumpled, is refused."""
    pattern, body = shirt(), body_of_size(30.0)
    pieces = {each.name: each for each in pattern.pieces[""]}
    meshed = mesh_pieces(pieces, pattern.seams, 0.04)
    openings = find_openings(sew_meshes(meshed, warpflat.find_fabric("woven")))
    assert [each.length for each in openings] == pytest.approx([1.0, ARMHOLE, ARMHOLE, 0.36])
    assert [round(each.turn, 6) for each in openings[:3]] == [0.0, 0.0, 0.0]
    worn, _ = drape_pattern(
        pattern, body, fabric=warpflat.find_fabric("woven"), placement=Placement(spacing=0.04),
        options=DrapeOptions(max_steps=300), device=DEVICE,
    )  # fmt: skip
    lines = limb_lines(body)
    for name, limb in (("l.e0", "left arm"), ("r.e2", "right arm")):
        found = links(worn.positions[worn.cloth.lines[name][:-1]], lines)
        assert abs(found[limb]) == 1
        assert sum(map(abs, found.values())) == 1
    assert pierced_edges(worn.cloth, worn.positions)[0].mean() < 0.1
    # The same places, moved off the arm, or crumpled.
    limbs = ["", *(["left arm", "right arm"] if "l" in openings[1].pieces else ["right arm", "left arm"]), ""]
    beside = worn.positions + np.array([0.0, 0.0, 0.5])
    check = {"openings": openings, "limbs": limbs, "lines": lines}
    with pytest.raises(InputError, match="falls off: the garment goes around no part of the body"):
        check_sewn(worn.cloth, beside, **check)
    aside = worn.positions.copy()
    aside[worn.cloth.welded[worn.cloth.piece_vertices["l"]]] += [0.0, 0.0, 0.4]
    with pytest.raises(InputError, match="piece 'l': its opening of 443 mm was sewn beside the left arm"):
        check_sewn(worn.cloth, aside, **check)
    # A limb may pass through loose cloth, and lie beside what is taut, but not pass through taut cloth.
    check_sewn(worn.cloth, worn.positions - [0.0, 0.0, 0.03], [], [], lines)
    wide = worn.positions * [2.5, 1.0, 2.5]
    check_sewn(worn.cloth, wide, [], [], {"left leg": lines["left leg"]})
    with pytest.raises(
        InputError, match=r"piece '.': the left arm .* stretched by over 100 %.* too small for this body"
    ):
        check_sewn(worn.cloth, wide, [], [], {"left arm": lines["left arm"]})
    # Every other vertex on the other side.
    crumpled = worn.positions.copy()
    crumpled[::2, 2] *= -1.0
    with pytest.raises(InputError, match=r"sewn into a tangle, most at '.': .* of their edges pierce cloth"):
        check_sewn(worn.cloth, crumpled, [], [], lines)


def test_a_wide_band_is_drawn_around_a_body_without_strain():
    """It starts as a flat loop twice as far off as it is long; around the thin body it closes, and the body grows into it."""
    tube = cylinder_body(radius=0.1, height=0.3, columns=40)
    columns, rows, girth = 41, 6, 2.0 * np.pi * 0.11
    x, y = (each.ravel() for each in np.meshgrid(np.linspace(0.0, girth, columns), np.linspace(0.1, 0.2, rows)))
    angle = 2.0 * np.pi * x / girth
    space = np.column_stack([0.25 * np.sin(angle), y, 0.25 * np.cos(angle)])
    band = sheet(np.column_stack([x, y]), space, grid(rows, columns), warpflat.find_fabric("woven"))
    # Its ends are sewn: the last column is the first.
    welded = np.arange(rows * columns).reshape(rows, columns)
    welded[:, -1] = welded[:, 0]
    used, number = np.unique(welded, return_inverse=True)
    number = number.reshape(-1).astype(np.int32)
    faces = np.where(band.faces >= 0, number[band.faces], -1).astype(np.int32)
    band = replace(band, welded=number, faces=faces, designed=space[used])
    found = sew_around(band, band.designed, ThinBody(tube))
    assert np.abs(stretches(band, found)).max() < 0.05
    assert tube.gaps(found).min() > -2e-3
    assert np.hypot(found[:, 0], found[:, 2]).mean() == pytest.approx(0.11, abs=0.01)
    # Where no body holds it, it goes with its opening to the limb that is said to go through that.
    away = cylinder_body(radius=0.1, height=0.3, columns=40)
    away.move(away.vertices + np.array([5.0, 0.0, 0.0]))
    edge, limb = np.arange(columns - 1, dtype=np.int32), np.array([[0.05, -2.0, 0.0], [0.05, 2.0, 0.0]])
    free, drawn = (sew_around(band, band.designed, ThinBody(away), rings=rings) for rings in ((), [(edge, limb)]))
    assert abs(free[edge, 0].mean()) < 1e-3
    assert 0.01 < drawn[edge, 0].mean() < 0.05
