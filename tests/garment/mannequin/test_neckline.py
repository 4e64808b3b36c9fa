"""Necklines wider than the base of the neck."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from armhole_curves import corner_degrees, depth_inside, sharpest_turn

from warpflat.core.errors import InputError
from warpflat.core.polyline import arc_lengths
from warpflat.flat.flattening.flatten_piece import flatten
from warpflat.garment.construction.rings import find_rings
from warpflat.garment.mannequin.closest import Mesh
from warpflat.garment.mannequin.forms import form_from_mapping, shipped_form
from warpflat.garment.mannequin.mannequin import Mannequin
from warpflat.garment.mannequin.neckline import Neckline, widen_neck


def neck_length(mannequin: Mannequin, form) -> float:
    made = mannequin.form(form)
    return find_rings(mannequin, made, {name: piece.surface.vertices for name, piece in made.pieces.items()})["neck"][1]


@pytest.mark.parametrize("size", ["EU 36", "JIS 5AR", "men 56"])
def test_neck_of_a_t_shirt_passes_the_head_at_a_jerseys_limit(size: str):
    mannequin = Mannequin.from_size(size, resolution_mm=20.0)
    shirt = shipped_form("tshirt")
    assert 1.15 * neck_length(mannequin, replace(shirt, neckline=None)) < mannequin.extremity("head")
    assert 1.15 * neck_length(mannequin, shirt) > mannequin.extremity("head")


def test_neckline_lies_on_the_form_and_leaves_the_rest_in_place():
    mannequin = Mannequin.from_size("EU 38", resolution_mm=20.0)
    plain = mannequin.form(form_from_mapping("top", {"like": "bodice"}))
    layout = mannequin.layout
    wide = widen_neck(layout, plain.vertices, Neckline(side_cm=2.0, front_cm=6.0))
    faces = layout.faces.astype(np.int64)
    middles = len(plain.vertices) + np.arange(len(faces))
    triangles = np.concatenate([np.column_stack([faces[:, [k, (k + 1) % 4]], middles]) for k in range(4)])
    surface = Mesh(np.vstack([plain.vertices, plain.vertices[faces].mean(axis=1)]), triangles)
    moved = np.flatnonzero(np.any(wide != plain.vertices, axis=1))
    assert len(moved) > 100
    # The shoulder seam is a line of the mesh; all else is brought back to its faces.
    assert np.linalg.norm(surface.closest(wide[moved])[2] - wide[moved], axis=1).max() < 1e-6
    still = np.concatenate([layout.arms["left"][0], layout.rings[layout.level_row["bust"]]])
    assert np.array_equal(wide[still], plain.vertices[still])
    mirror = layout.mirror[moved]
    assert np.abs(wide[mirror] * [-1, 1, 1] - wide[moved]).max() < 1e-6
    front = layout.front[-1, layout.front.shape[1] // 2]
    assert np.linalg.norm(wide[front] - plain.vertices[front]) == pytest.approx(0.06, abs=3e-3)


def test_form_with_a_wide_neckline_lies_outside_the_body():
    mannequin = Mannequin.from_size("men 46", resolution_mm=20.0)
    made = mannequin.form("tshirt")
    # Moved within the form's faces alone, vertices would lie 0.4 mm inside.
    assert depth_inside(made, mannequin) < 1e-4
    mirrored = made.vertices[mannequin.layout.mirror] * [-1, 1, 1]
    assert np.abs(mirrored - made.vertices).max() < 1e-9


def test_neckline_that_cannot_be_is_named():
    mannequin = Mannequin.from_size("EU 38", resolution_mm=30.0)
    with pytest.raises(InputError, match="neckline: side_cm = 9: a number from 0 to 8"):
        form_from_mapping("top", {"like": "bodice", "neckline": {"side_cm": 9}})
    narrow = replace(shipped_form("bodice"), neckline=Neckline(side_cm=12.0))
    with pytest.raises(InputError, match=r"side_cm is 12, but the shoulder is \d+\.\d cm long"):
        mannequin.form(narrow)


def test_neckline_by_shares_suits_every_body():
    """As a share of the lines that it lies along it is as deep on everybody, and in centimetres on one body the same."""
    table = {"like": "bodice", "neckline": {"side_share": 0.2, "front_share": 0.4, "back_share": 0.1}}
    for size in ("EU 38", "EU 122"):
        body, depths = Mannequin.from_size(size, resolution_mm=30.0), []
        base, made = body.form("bodice"), body.form(form_from_mapping("top", table))
        rings = body.layout.rings[body.layout.level_row["bust"] :]
        for row, column in ((body.layout.front, 0), (body.layout.back, rings.shape[1] // 2)):
            centre = np.concatenate([row[:0:-1, row.shape[1] // 2], rings[::-1, column]])
            whole, left = (arc_lengths(each.vertices[centre])[-1] for each in (base, made))
            depths.append(float(1.0 - left / whole))
        assert depths == pytest.approx([0.4, 0.1], abs=0.01), size


@pytest.mark.parametrize(
    ("power", "depth", "side"), [(1.0, 8.0, 3.0), (2.0, 10.0, 3.0), (5.0, 8.0, 3.0), (1.0, 15.0, 8.0)]
)
def test_cloth_below_a_deep_neckline_is_not_folded(power: float, depth: float, side: float):
    mannequin = Mannequin.from_size("EU 38", resolution_mm=16.0)
    neckline = {"side_cm": side, "front_cm": depth, "front_power": power}
    made = mannequin.form(form_from_mapping("top", {"like": "bodice", "neckline": neckline}))
    surface = made.pieces["front"].surface
    corners = surface.vertices[surface.faces]
    ahead, behind = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    # Every corner of every quad of the chest looks forwards.
    chest = corners.mean(axis=1)[:, 1] > mannequin.levels()["bust"].height
    middle = np.abs(corners.mean(axis=1)[:, 0]) < 0.10
    assert np.cross(ahead, behind)[chest & middle][:, :, 2].min() > 0.0


def test_v_neckline_is_straight_from_the_centre_to_the_shoulder():
    mannequin = Mannequin.from_size("EU 38", resolution_mm=16.0)
    neckline = {"side_cm": 2.0, "front_cm": 8.0, "front_power": 1.0}
    made = mannequin.form(form_from_mapping("top", {"like": "bodice", "neckline": neckline}))
    front = made.pieces["front"]
    points = front.surface.vertices[front.edges["neck"]]
    half = points[points[:, 0] > -1e-6]
    ends = half[[half[:, 0].argmin(), half[:, 0].argmax()]]
    # The cloth is not flat: the line of sight from the front shows how straight it is.
    along = (ends[1] - ends[0])[:2] / np.linalg.norm((ends[1] - ends[0])[:2])
    away = (half - ends[0])[:, :2] @ [-along[1], along[0]]
    assert np.abs(away).max() < 0.008


def test_neckline_that_would_fold_the_cloth_is_refused():
    mannequin = Mannequin.from_size("EU 38", resolution_mm=16.0)
    # Below the bust, where the rows that lie between have no place.
    deep = replace(shipped_form("bodice"), neckline=Neckline(side_cm=8.0, front_cm=25.0, front_power=1.0))
    with pytest.raises(InputError, match="the cloth folds below it"):
        mannequin.form(deep)


@pytest.mark.parametrize(("side", "depth", "most"), [(1.5, 1.0, 15.0), (3.0, 0.0, 20.0), (2.0, 12.0, 22.0)])
def test_neckline_behind_is_round_and_square_to_the_shoulder(side: float, depth: float, most: float):
    """It used to run level to the last centimetre, and to turn there by 50 degrees."""
    mannequin = Mannequin.from_size("EU 38", resolution_mm=12.0)
    neckline = {"side_cm": side, "back_cm": depth}
    made = mannequin.form(form_from_mapping("top", {"like": "bodice", "neckline": neckline}))
    back = made.pieces["back"]
    flat = flatten(back.surface, fabric="woven")
    assert flat.flipped_faces == 0
    assert sharpest_turn(flat.positions[back.edges["neck"]]) < most
    corner = corner_degrees(flat.positions, back.edges["neck"], back.edges["shoulder left"])
    assert 80.0 < corner < 120.0
    centre = mannequin.layout.back[-1, mannequin.layout.back.shape[1] // 2]
    base = mannequin.form(replace(shipped_form("bodice"), neckline=None))
    assert np.linalg.norm(made.vertices[centre] - base.vertices[centre]) == pytest.approx(0.01 * depth, abs=0.004)
