"""Armholes and sleeves as a pattern maker cuts them, on the bodies that had the worst ones; all bodies: `benchmarks/forms.py`."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from armhole_curves import corner_degrees, depth_inside, inflections, sharpest_turn
from bodies import stood
from real_files import needs_data
from scans import scan, scanned_body

from warpflat.core.polyline import polyline_length
from warpflat.garment.construction.form_garment import flatten_form
from warpflat.garment.mannequin.forms import form_from_mapping
from warpflat.garment.mannequin.mannequin import Mannequin
from warpflat.garment.mannequin.outside import BodySurface, push_outside
from warpflat.garment.mannequin.scan_pose import ScanOptions, turn_scan_upright

BODIES = ["child", pytest.param("scan child", marks=needs_data)]


@functools.cache
def _body(name: str) -> Mannequin:
    if name.startswith("scan "):
        return scanned_body(name.removeprefix("scan "), 15.0)
    given = {"bust": 0.64, "waist": 0.58, "hip": 0.68, "stature": 1.28, "shoulder": 0.095}
    return Mannequin.from_measurements(resolution_mm=15, **given)


@pytest.mark.parametrize("name", BODIES)
def test_armholes_have_no_horns_and_sleeves_can_be_sewn(name: str) -> None:
    body = _body(name)
    for form, fabric, sharpest in (("bodice", "woven", 26.0), ("tshirt", "interlock", 46.0)):
        made = body.form(form, half=True)
        assert depth_inside(made, body) < 0.0001
        garment = flatten_form(body, made, fabric=fabric)
        corners = []
        for key, piece in made.pieces.items():
            flat = garment.pieces[key]
            assert flat.flipped_faces == 0
            curve = flat.positions[piece.edges["armhole left"]]
            if "underarm left" in piece.edges:
                assert sharpest_turn(curve) < 20.0
                # A cap bends the other way towards each end, or runs into its end straight.
                assert inflections(curve) <= 3
                seam = polyline_length(flat.positions[piece.edges["underarm left"]])
                assert seam > 0.060
            else:
                assert sharpest_turn(curve) < sharpest, key
                assert inflections(curve) <= 2, key
                corners.append(corner_degrees(flat.positions, piece.edges["armhole left"], piece.edges["side left"]))
        # Front and back meet in a smooth armhole; each is square to the side seam but for darts that are not taken.
        assert abs(sum(corners) - 180.0) < 25.0
        assert all(65.0 < corner < 120.0 for corner in corners), corners


@needs_data
@pytest.mark.parametrize("name", ["female", "male_heavy"])
def test_scanned_armholes_end_below_the_armpit(name: str) -> None:
    slicer, _ = turn_scan_upright(*scan(name), ScanOptions())
    laid = stood(slicer.vertices, slicer.triangles)
    armpits = {side: laid.vertices[vertex] for side, vertex in laid.armpits.items()}
    body = scanned_body(name)
    for side in ("left", "right"):
        hole, line = body.line(f"armhole {side}"), body.line(f"side {side}")
        assert 0.020 < armpits[side][1] - hole[0, 1] < 0.031
        # The underarm point is the lowest, and the side line runs up to it in a curve: at most so far from one row of 20 mm to the next.
        assert hole[:, 1].min() > hole[0, 1] - 0.001
        ways = np.diff(line[body.layout.level_row["underbust"] :], axis=0)
        ways /= np.linalg.norm(ways, axis=1, keepdims=True)
        assert np.degrees(np.arccos((ways[1:] * ways[:-1]).sum(axis=1).min())) < 18.0


@pytest.mark.parametrize(
    ("name", "form"), [("child", "trousers"), pytest.param("scan child", "dress", marks=needs_data)]
)
def test_forms_stay_outside_the_body(name: str, form: str) -> None:
    body = _body(name)
    assert depth_inside(body.form(form), body) < 0.0001


def test_a_dent_is_pushed_out_smoothly_and_negative_ease_is_not() -> None:
    body = _body("child")
    whole = body.form("bodice")
    layout, used = body.layout, np.unique(np.concatenate([p.grid_vertices for p in whole.pieces.values()]))
    row = layout.rings[layout.level_row["underbust"]]
    dented = body.vertices.copy()
    dented[row[2], 2] -= 0.002
    out = push_outside(dented, layout, body.vertices, used)
    assert np.linalg.norm(BodySurface(layout, body.vertices).vectors_out(out[used]), axis=1).max() < 0.0001
    pushed = np.linalg.norm(out - dented, axis=1)
    assert pushed.argmax() == row[2]
    # Neighbours follow, less and less.
    assert (np.diff(pushed[row[2:7]]) <= 0.0).all()
    assert pushed[row[3]] > 0.5 * pushed[row[2]]
    tight = body.form(form_from_mapping("tight", {"like": "bodice", "ease": {"bust": -6.0, "waist": -4.0}}))
    assert depth_inside(tight, body) > 0.003


@needs_data
@pytest.mark.parametrize("name", ["female", "male_heavy"])
def test_a_t_shirt_on_a_scan_has_no_hook_under_the_arm_and_a_round_neck(name: str) -> None:
    body = scanned_body(name, 15.0)
    made = body.form("tshirt", half=True)
    layout = body.layout
    side = made.vertices[layout.rings[layout.level_row["underbust"] :, layout.quarter]]
    # Seen from the side the seam runs straight into the armhole; seen from the front there is no ledge under the arm.
    assert np.ptp(side[:, 2]) < 0.0047
    assert abs(side[-1, 0] - side[-5, 0]) < 0.4 * (side[-1, 1] - side[-5, 1])
    garment = flatten_form(body, made, fabric="interlock")
    corners = []
    for key in ("front", "back"):
        piece, flat = made.pieces[key], garment.pieces[key]
        assert flat.flipped_faces == 0
        assert sharpest_turn(flat.positions[piece.edges["armhole left"]]) < 27.0, key
        corners.append(corner_degrees(flat.positions, piece.edges["armhole left"], piece.edges["side left"]))
        neck = next(ids for edge, ids in piece.edges.items() if "neck" in edge)
        assert sharpest_turn(flat.positions[neck]) < 27.0, key
    # Sewn together at the side the armhole runs on without a hook; a side seam that leans makes one corner sharper, one blunter.
    assert min(corners) > 65.0
    assert 165.0 < sum(corners) < 195.0
