"""Legs of the mannequin and the form `trousers`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from armhole_curves import depth_inside

from warpflat.core.errors import InputError
from warpflat.core.polyline import polyline_length
from warpflat.garment.mannequin.forms import form_from_mapping, shipped_form
from warpflat.garment.mannequin.mannequin import Mannequin
from warpflat.garment.mannequin.profiles import convex_girth
from warpflat.garment.mannequin.shapes import shaped_form

SIDES = ("left", "right")


@pytest.fixture(scope="module", params=["EU 38", "men 54"])
def body(request: pytest.FixtureRequest) -> Mannequin:
    return Mannequin.from_size(request.param, resolution_mm=20)


def _mesh(body: Mannequin) -> trimesh.Trimesh:
    quads = body.layout.body_faces
    return trimesh.Trimesh(body.vertices, np.concatenate([quads[:, :3], quads[:, [0, 2, 3]]]), process=False)


def test_each_leg_has_its_girths(body: Mannequin) -> None:
    levels = body.levels()
    order = [levels[f"{name} left"].height for name in ("thigh", "knee", "calf", "ankle")]
    assert order == sorted(order, reverse=True)
    assert order[0] < levels["crotch front"].height < levels["hip"].height
    for name in ("thigh", "knee", "calf", "ankle"):
        ring = body.line(f"{name} left")
        assert levels[f"{name} left"].girth == pytest.approx(levels[f"{name} right"].girth, abs=1e-9)
        assert ring[:, 0].min() > 0.0  # on its own side of the midplane
    assert levels["thigh left"].girth > 1.3 * levels["knee left"].girth


def test_the_tube_around_both_legs_holds_them(body: Mannequin) -> None:
    from scipy.spatial import ConvexHull

    for name in ("thigh", "knee", "ankle"):
        around = body.line(name)[:-1]
        height = around[0, 1]
        section = np.asarray(_mesh(body).section([0, 1, 0], [0, height, 0]).vertices)
        for part in section[np.abs(section[:, 0]) < 0.3][:, None, [0, 2]]:
            planes = ConvexHull(around[:, [0, 2]]).equations
            assert (planes[:, :2] @ part[0] + planes[:, 2]).max() < 0.006, name


def test_trousers_are_sewn_from_four_pieces_around_the_crotch(body: Mannequin) -> None:
    made = body.form("trousers")
    seams = {seam.name: seam for seam in made.seams}
    assert set(seams) == {
        "crotch front",
        "crotch back",
        *(f"{s} {side}" for s in ("inseam", "outseam") for side in SIDES),
    }

    def length(piece: str, edge: str) -> float:
        return polyline_length(made.pieces[piece].surface.vertices[made.pieces[piece].edges[edge]])

    front, back = length("front_left", "crotch front"), length("back_left", "crotch back")
    assert 1.1 * front < back < 1.6 * front
    for seam in seams.values():
        assert len(seam.runs) == 1
        for run in seam.runs:
            first, second = (
                made.pieces[p].surface.vertices[ids] for p, ids in zip(seam.pieces, run.vertices, strict=True)
            )
            assert np.array_equal(first, second)
    assert set(body.form("trousers", half=True).pieces) == {"front_left", "back_left"}


def test_trousers_take_waist_darts(body: Mannequin) -> None:
    form = body.form(shaped_form(body.layout, shipped_form("trousers"), "darts", body.vertices))
    lengths = {}
    for dart in form.darts:
        row = form.vertices[dart.row]
        assert row[0, 1] == pytest.approx(body.levels()["waist"].height, abs=0.002), dart.name
        lengths[dart.piece, dart.name] = round(polyline_length(row), 3)
    # One in the front, two in the back, the second of them shorter; the tips lie on the grid's rows of 20 mm.
    assert {piece: sum(key[0] == piece for key in lengths) for piece in form.pieces} == {
        "front_left": 1, "front_right": 1, "back_left": 2, "back_right": 2,
    }  # fmt: skip
    for side in SIDES:
        first, second = (
            lengths[f"back_{side}", f"waist dart {side}"],
            lengths[f"back_{side}", f"second waist dart {side}"],
        )
        assert lengths[f"front_{side}", f"waist dart {side}"] == pytest.approx(0.100, abs=0.012)
        assert first == pytest.approx(0.130, abs=0.012)
        assert second <= first


def test_trousers_lie_outside_the_body(body: Mannequin) -> None:
    assert depth_inside(body.form("trousers"), body) < 1e-4


def test_the_crotch_curve_moves_up_and_down_only(body: Mannequin) -> None:
    low = form_from_mapping("low", {"like": "trousers", "profiles": {"crotch": {"raise_cm": -4.0}}})
    drop = body.form("trousers").vertices - body.form(low).vertices
    assert drop[body.layout.crotch[body.layout.crotch_point], 1] == pytest.approx(0.025, abs=0.002)
    wide = form_from_mapping("wide", {"like": "trousers", "profiles": {"crotch": {"offset_cm": 4.0}}})
    with pytest.raises(InputError, match="profile crotch: it moves up or down only"):
        body.form(wide)


@pytest.mark.parametrize("given", [{}, {"bust": 0.90, "waist": 0.76, "hip": 1.16}], ids=["EU 38", "pear"])
def test_the_outseam_runs_into_the_straight_leg_without_a_corner(given: dict[str, float]) -> None:
    body = (
        Mannequin.from_size("EU 38", resolution_mm=15)
        if not given
        else Mannequin.from_measurements(resolution_mm=15, **given)
    )
    made, layout = body.form("trousers"), body.layout
    rows, column = layout.leg_row, layout.to_outseam
    ways = np.diff(made.vertices[layout.legs["left"][1 : rows["leg_knee"], column]], axis=0)
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    assert np.degrees(np.arccos((ways[1:] * ways[:-1]).sum(axis=1).min())) < 4.0
    assert depth_inside(made, body) < 0.0001


def test_straight_legs_have_the_ease_at_the_thigh_that_is_asked_for(body: Mannequin) -> None:
    """What hangs from the crotch curve would go around 2 to 4 cm more."""
    layout = body.layout
    for ease in (3.0, 12.0):
        made = body.form(replace(shipped_form("trousers"), ease={**shipped_form("trousers").ease, "leg_thigh": ease}))
        for grid in layout.legs.values():
            row = grid[layout.leg_row["leg_thigh"]]
            more = convex_girth(made.vertices[row]) - convex_girth(body.vertices[row])
            assert more == pytest.approx(0.01 * ease, abs=0.002)
