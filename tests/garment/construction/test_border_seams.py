"""Seams that are named on one surface: sides of other vertices, fullness, what is refused."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import Delaunay

from warpflat.app.scene.load import make_scene
from warpflat.app.scene.run import run_scene
from warpflat.core.errors import InputError
from warpflat.core.polyline import polyline_length
from warpflat.flat.flattening.flatten_piece import flatten
from warpflat.flat.flattening.result import Flattening
from warpflat.flat.solver.options import RelaxOptions
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.paths.lines import with_lines
from warpflat.flat.surface.shapes import make_shape
from warpflat.garment.construction.border_seams import surface_seams
from warpflat.garment.construction.details import SeamTable
from warpflat.garment.construction.sew_pieces import sew_pieces
from warpflat.garment.construction.to_pattern import pattern_of_surface
from warpflat.pattern.drafting.draft import draft_garment

QUIET = {"output": {"frames": 0, "picture": False}, "pattern": {"formats": ["json"]}}
UNDERARM = SeamTable(name="underarm", sides=["front", "back"])
CENTRE_BACK = SeamTable(name="centre back", sides=["left", "right"])


def sleeve(turn: float = 2 * np.pi, counts: tuple[int, int] = (13, 20)) -> Surface:
    """A bellied tube, open along a line, with so many vertices along either side of the opening."""
    u = [np.zeros(counts[0]), np.ones(counts[1])]
    v = [np.linspace(0, 1, n) ** power for n, power in zip(counts, (1.0, 1.15), strict=True)]
    for across in np.linspace(0, 1, 13)[1:-1]:
        u.append(np.full(15, across))
        v.append(np.linspace(0, 1, 15))
    place = np.column_stack([np.concatenate(u), np.concatenate(v)])
    angle, height = turn * place[:, 0], place[:, 1]
    radius = 0.05 + 0.012 * np.sin(np.pi * height) * (
        1.0 + 0.5 * np.cos(angle) + 0.4 * np.sin(angle / 2) * (angle > np.pi)
    )
    vertices = np.column_stack([radius * np.sin(angle), 0.3 * height, radius * np.cos(angle)])
    triangles = Delaunay(place * [1.0, 0.9]).simplices
    corner = place[triangles]
    one, other = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    area = one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]
    triangles = np.where(area[:, None] > 0, triangles, triangles[:, ::-1])[np.abs(area) > 1e-9]
    faces = np.column_stack([triangles, np.full(len(triangles), -1)]).astype(np.int32)
    number = np.arange(len(vertices), dtype=np.int32)
    tube = Surface(vertices=vertices, faces=faces, name="sleeve", input_vertices=vertices, input_index=number)
    front, back = number[: counts[0]], number[counts[0] : sum(counts)]
    return with_lines(tube, {"front": front, "back": back, "middle": number[sum(counts) + 75 : sum(counts) + 90]})


def lengths(result: Flattening, line: str) -> float:
    return polyline_length(result.positions[result.network.surface.lines[line]])


@pytest.fixture(scope="module")
def alone() -> Flattening:
    return flatten(sleeve(), datum="middle", fabric="woven")


def test_sides_of_other_vertices_are_sewn_by_arc_length(alone: Flattening):
    before = abs(lengths(alone, "front") - lengths(alone, "back"))
    assert before > 5e-4, "there is something to sew"
    sewn = sew_pieces([alone], seams=[UNDERARM])
    # Of another size, too, it is told what lies over itself.
    assert sewn.summary()["pieces"]["sleeve"]["overlap_m2"] == sewn.pieces["sleeve"].overlap
    assert sewn.sewn is not None
    assert sewn.sewn.converged
    (seam,) = sewn.seams
    assert seam.sides == ("sleeve.front", "sleeve.back")
    assert abs(seam.difference) < 1e-4
    assert seam.cost is not None
    assert seam.cost > 0
    # Not only in all: from end to end both lie at the same shares of their length, or nearly so.
    result = sewn.pieces["sleeve"]
    (found,) = surface_seams(result.network.surface, [UNDERARM])
    assert found.joints is not None
    flat = [result.positions[ids] for ids in found.vertices]
    arcs = [np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(p, axis=0), axis=1))]) for p in flat]
    body = [result.network.surface.vertices[ids] for ids in found.vertices]
    own = [np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(p, axis=0), axis=1))]) for p in body]
    shares = np.linspace(0, 1, 7)[1:-1]
    reached = [np.interp(shares * o[-1], o, a) for o, a in zip(own, arcs, strict=True)]
    np.testing.assert_allclose(*reached, atol=2e-4)


def test_the_pattern_sews_and_notches_what_was_named(alone: Flattening):
    sewn = sew_pieces([alone], seams=[UNDERARM])
    pattern, _ = pattern_of_surface([sewn.pieces["sleeve"]], name="sleeve", seams=[UNDERARM])
    assert [seam.name for seam in pattern.seams] == ["underarm"]
    drafted = draft_garment(pattern)
    assert abs(drafted.seams[0].difference_mm) < 0.5
    (piece,) = drafted.pieces[""]
    marks = [[n.length for n in piece.notches if n.edge == side] for side in ("front", "back")]
    assert len(marks[0]) == len(marks[1]) > 0
    np.testing.assert_allclose(*marks, atol=5e-4)


def test_the_two_sides_of_one_curve_are_told_by_their_places():
    """The tube is closed: both sides are one curve, drawn through other points."""
    whole = sleeve()
    (seam,) = surface_seams(whole, [UNDERARM])
    one, other = (whole.vertices[ids] for ids in seam.vertices)
    np.testing.assert_allclose(one[[0, -1]], other[[0, -1]], atol=1e-12)
    assert seam.joints is not None
    assert seam.joints[0].tolist() == [0, 0]
    assert seam.joints[-1].tolist() == [len(one) - 1, len(other) - 1]
    assert (np.diff(seam.joints, axis=0) > 0).all()
    (alike,) = surface_seams(sleeve(5.8, (14, 14)), [UNDERARM])
    assert alike.joints is not None, "as many vertices, at other places"


def test_sides_that_do_not_fit_are_refused():
    tube = with_lines(sleeve(5.8), {"hem": np.array([13 + 20 + 15 * k for k in range(11)], dtype=np.int32)})
    with pytest.raises(
        InputError, match=r"seam 's': 'front' is \d+\.\d mm long and 'hem' \d+\.\d mm, and they are not one"
    ):
        surface_seams(tube, [SeamTable(name="s", sides=["front", "hem"])])
    with pytest.raises(InputError, match=r"seam 's': unknown line 'bakc'; did you mean 'back'"):
        surface_seams(tube, [SeamTable(name="s", sides=["front", "bakc"])])
    with pytest.raises(InputError, match=r"line 'middle' leaves the border between vertices \d+ and \d+"):
        surface_seams(tube, [SeamTable(name="s", sides=["front", "middle"])])


CONE = {"surface": {"shape": "cone", "angle": 340.0, "resolution": 13}, "datum": "centre", "fabric": "woven"}


def scene(**tables: object):
    return make_scene({**CONE, **QUIET, **tables}, name="trial", folder=Path(), where="trial.toml")


def test_a_scene_names_a_seam_with_fullness(tmp_path: Path):
    asked = [{"name": "underarm", "sides": ["left", "trial.right"], "fullness": 0.02, "longer": "left"}]
    result = run_scene(scene(seams=asked), tmp_path)
    (seam,) = result.metrics["seams"]
    assert seam["sides"] == ["trial.left", "trial.right"]
    assert seam["length_mm"][0] / seam["length_mm"][1] == pytest.approx(1.02, abs=5e-4)
    assert result.metrics["sewing"]["converged"]
    pattern = json.loads((tmp_path / "pattern.json").read_text())
    assert [(s["name"], s["ease"]) for s in pattern["stitches"]] == [("underarm", pytest.approx(1 / 1.02 - 1))]
    assert pattern["seams"][0]["matches"]


@pytest.mark.parametrize(
    ("seams", "message"),
    [
        (
            [{"name": "s", "sides": ["left", "rihgt"]}],
            r"trial.toml: seams\[0\].sides\[1\]: unknown line 'rihgt'; did you mean 'right'",
        ),
        ([{"name": "s", "sides": ["left", "left"]}], r"seams\[0\]: both sides are 'left'"),
        ([{"name": "s", "sides": ["left"]}], r"seams\[0\].sides: "),
        (
            [{"name": "s", "sides": ["left", "right"], "longer": "top", "fullness": 0.1}],
            "longer is 'top', not one of its sides",
        ),
        ([{"name": "s", "sides": ["left", "right"]}] * 2, r"seams\[1\]: seam 's' is named twice"),
        (
            [{"name": "s", "sides": ["left", "bottom"]}],
            r"trial.toml: seams: seam 's': 'left' is .* mm long and 'bottom'",
        ),
        ([{"name": "s", "fullness": 0.1}], r"seams\[0\]: on a \[surface\] give the two lines"),
    ],
)
def test_a_wrong_seam_is_told_in_one_line(tmp_path: Path, seams: list[dict[str, object]], message: str):
    with pytest.raises(InputError, match=message) as caught:
        run_scene(scene(seams=seams), tmp_path)
    assert "\n" not in str(caught.value)


def band(resolution: int) -> Flattening:
    cone = make_shape("cone", bottom=0.16, top=0.145, height=0.04, angle=355.0, resolution=resolution)
    return flatten(cone, fabric="woven", datum="centre", grain_angle=90.0)


def test_a_band_free_of_strain_is_at_rest_when_it_is_sewn():
    found = sew_pieces([band(41)], seams=[CENTRE_BACK], options=RelaxOptions(max_steps=500))
    assert found.sewn is not None
    assert found.sewn.converged
    assert found.sewn.largest_difference < 1e-6


def test_a_band_free_of_strain_is_not_at_rest_while_a_seam_pulls():
    found = sew_pieces([band(17)], seams=[CENTRE_BACK.model_copy(update={"fullness": 0.001})])
    assert found.sewn is not None
    assert found.sewn.converged
    left, right = (lengths(found.pieces["cone"], side) for side in CENTRE_BACK.lines)
    assert right / left == pytest.approx(1.001, abs=2e-5)


def test_fullness_on_a_cut_piece_is_refused(tmp_path: Path):
    asked = [{"name": "underarm", "sides": ["left", "right"], "fullness": 0.02}]
    cuts = [{"line": "centre", "part": [0.0, 0.4]}]
    with pytest.raises(InputError, match="seam 'underarm': fullness and gathers need a piece that is not cut"):
        run_scene(scene(seams=asked, cuts=cuts), tmp_path)


def test_a_forms_seams_have_their_sides():
    with pytest.raises(InputError, match=r"seams\[0\]: sides belong to a \[surface\]"):
        make_scene(
            {
                "mannequin": {"size": "EU 38"},
                "form": "dress",
                "seams": [{"name": "side left", "fullness": 0.1, "sides": ["front.side left", "back.side left"]}],
            },
            name="trial",
            folder=Path(),
            where="trial.toml",
        )
