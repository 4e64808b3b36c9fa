"""The statistical body: its derivatives, its poses, its fit to meshes, and scans that are read from it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from body_tapes import armpit_and_crotch
from real_files import needs_data
from scans import posed_body, scan, scanned_body, triangles_of

from warpflat.core.errors import InputError
from warpflat.garment.mannequin.body_landmarks import PLACES, height_weights
from warpflat.garment.mannequin.body_model import BodyModel, Person, finer_body, rotation
from warpflat.garment.mannequin.closest import Mesh
from warpflat.garment.mannequin.common_body import CommonBody
from warpflat.garment.mannequin.mannequin import Mannequin
from warpflat.garment.mannequin.scan_pose import LANDMARKS, ScanOptions
from warpflat.garment.mannequin.stand_body import StandingBody, stand_body


def _person(random: np.random.Generator, spread: float, bend: float) -> Person:
    model = BodyModel.load()
    return Person(
        shape=spread * random.normal(size=len(model.shapes)),
        bend=rotation(bend * random.normal(size=(len(model.joints), 3))),
        turn=np.eye(3),
        scale=1.65,
        place=np.zeros(3),
    )


def test_derivatives_are_those_of_differences() -> None:
    model, random = BodyModel.load(), np.random.default_rng(1)
    person = replace(
        _person(random, 1.0, 0.3), turn=rotation(random.normal(size=(1, 3)))[0], place=random.normal(size=3)
    )
    rows = np.arange(0, model.count, 97)
    some = model.only(rows)
    places, jacobian = some.jacobian(person)
    np.testing.assert_allclose(places, model.vertices(person)[rows], atol=1e-12)
    step = 1e-6 * np.eye(jacobian.shape[2])
    differences = [(some.vertices(some.moved(person, s)) - some.vertices(some.moved(person, -s))) / 2e-6 for s in step]
    np.testing.assert_allclose(jacobian, np.stack(differences, axis=2), atol=2e-8)


def test_another_pose_keeps_what_lies_on_the_body() -> None:
    model, random = BodyModel.load(), np.random.default_rng(2)
    finer, triangles = finer_body()
    person = _person(random, 0.7, 0.4)
    standing = person.standing()
    on_skin = finer @ model.vertices(person)
    np.testing.assert_allclose(
        model.rebend(person, standing, finer, on_skin), finer @ model.vertices(standing), atol=1e-12
    )
    # What stands off a straight limb stands off as far in the other pose.
    calf = finer @ model.weights[:, model.joints.index("lowerleg01.L")] > 1.0 - 1e-12
    away = 0.01 * random.normal(size=on_skin.shape)
    moved = model.rebend(person, standing, finer, on_skin + away) - finer @ model.vertices(standing)
    np.testing.assert_allclose(np.linalg.norm(moved[calf], axis=1), np.linalg.norm(away[calf], axis=1), rtol=1e-9)
    mesh = trimesh.Trimesh(on_skin, triangles, process=False)
    assert mesh.is_winding_consistent
    assert mesh.volume > 0.02
    assert not len(trimesh.grouping.group_rows(mesh.edges_sorted, require_count=1))


@pytest.mark.parametrize("arms", [0.8, -0.5])
def test_a_fit_finds_a_person_of_the_model(arms: float) -> None:
    model, random = BodyModel.load(), np.random.default_rng(4)
    person = _person(random, 0.6, 0.08)
    bend = np.zeros((len(model.joints), 3))
    for side, sign in (("L", 1.0), ("R", -1.0)):
        bend[model.joints.index(f"upperarm01.{side}"), 2] = sign * arms
    person = replace(person, bend=person.bend @ rotation(bend))
    wanted = model.vertices(person)
    wanted -= [0.0, wanted[:, 1].min(), 0.0]
    stood = stand_body(wanted, model.triangles)
    fit, plain = stood.fit, ~model.detail
    found = np.isfinite(fit.distance)
    assert found[plain].mean() > 0.98
    assert fit.distance[plain & found].mean() < 0.003
    assert np.linalg.norm(model.vertices(fit.person) - wanted, axis=1)[plain].mean() < 0.012
    assert stood.unsure is None
    assert np.quantile(Mesh(wanted, model.triangles).closest(stood.posed)[2] - stood.posed, 0.9) < 0.001


def _height(laid: StandingBody, landmark: str) -> float:
    return float(height_weights(landmark) @ BodyModel.load().vertices(laid.fit.person)[:, 1])


@needs_data
def test_the_fit_follows_a_landmark_that_is_given() -> None:
    points, faces = scan("female")
    points, triangles = points - [0.0, points[:, 1].min(), 0.0], triangles_of(faces)
    free = stand_body(points, triangles)
    for moved in ({"waist": 0.03, "elbow": 0.03, "crotch": -0.02}, {"hip": -0.03, "armpit": -0.025}):
        wanted = {name: _height(free, name) + up for name, up in moved.items()}
        laid = stand_body(points, triangles, landmarks=wanted)
        assert {name: _height(laid, name) for name in moved} == pytest.approx(wanted, abs=0.004)
        # The body slides within its skin.
        assert laid.unsure is None, moved
        assert laid.fit.far < free.fit.far + 0.002, moved
        # What lies far from it stays.
        assert _height(laid, "head") == pytest.approx(_height(free, "head"), abs=0.003), moved
    # What lies beside it goes along.
    crotch = stand_body(points, triangles, landmarks={"crotch": _height(free, "crotch") - 0.02})
    assert _height(crotch, "hip") < _height(free, "hip") - 0.008


@needs_data
def test_a_scan_is_measured_at_the_landmarks_that_are_given() -> None:
    points, faces = scan("female")
    free = scanned_body("female")
    given = {"waist": free.measures["waist"].height + 0.03, "elbow left": free.measures["elbow left"].height + 0.02}
    options = ScanOptions(landmarks={name.split()[0]: height for name, height in given.items()})
    body = Mannequin.from_scan(points, faces, options=options, resolution_mm=40.0)
    for name, height in given.items():
        assert body.measures[name].height == pytest.approx(height, abs=0.005), name
        assert body.measures[name].girth != pytest.approx(free.measures[name].girth, abs=0.0005), name
    assert body.measures["waist"].guess is None
    assert body.levels()["waist"].height == pytest.approx(given["waist"])
    with pytest.raises(
        InputError, match=r"scan: underbust .* does not lie above waist \(1\.250 m\) on a body 1\.59 m tall"
    ):
        Mannequin.from_scan(points, faces, options=ScanOptions(landmarks={"waist": 1.25}), resolution_mm=20.0)
    with pytest.raises(InputError, match=r"scan: knee .* does not lie above calf \(0\.900 m\) on a body 1\.59 m tall"):
        Mannequin.from_scan(points, faces, options=ScanOptions(landmarks={"calf": 0.9}), resolution_mm=20.0)
    # All but the places on a skirt, which are no landmarks of a body, steer the fit.
    assert set(LANDMARKS) - set(PLACES) == {"thigh", "abdomen"}


@needs_data
@pytest.mark.parametrize(
    ("name", "wanted"),
    [
        ("gc_mean_female", {"bust": 0.974, "underbust": 0.807, "waist": 0.803}),
        ("hanging_bust", {"underbust": 0.650, "hip": 1.011}),
    ],
)
def test_bodies_whose_shape_does_not_show_the_levels_are_read_from_the_model(
    name: str, wanted: dict[str, float]
) -> None:
    body = scanned_body(name)
    for tape, girth in wanted.items():
        assert body.measures[tape].girth == pytest.approx(girth, abs=0.009), tape


def _without(which: Callable[[np.ndarray], np.ndarray], points: np.ndarray, faces: np.ndarray) -> np.ndarray:
    return faces[~which(points[faces[:, :3]].mean(axis=1))]


@needs_data
@pytest.mark.parametrize("case", ["arms cut off above and below on a floor", "legs apart", "legs crossed", "T-pose"])
def test_scans_that_show_less_or_more_than_a_standing_body(case: str) -> None:
    points, faces = scan("female")
    if case.startswith("arms"):
        # There are no forearms, and upper arms are meshes of their own.
        armpit, _, half = armpit_and_crotch(trimesh.Trimesh(points, triangles_of(faces), process=False))
        corners = points[np.where(faces < 0, faces[:, :1], faces)]
        beyond = np.abs(corners[..., 0]) - half - 0.16 * np.maximum(corners[..., 1] - armpit, 0.0) - 0.015
        joins = (beyond.min(axis=1) < 0.0) & (beyond.max(axis=1) > 0.0) & (corners[..., 1].min(axis=1) > armpit - 0.06)
        faces = faces[~joins & (np.abs(corners[..., 0]).mean(axis=1) < np.abs(points[:, 0]).max() - 0.17)]
        assert len(trimesh.graph.connected_components(triangles_of(faces)[:, [0, 1, 1, 2]].reshape(-1, 2))) == 3
        floor = trimesh.creation.box((0.8, 0.02, 0.8))
        for _ in range(4):
            floor = floor.subdivide()
        new = np.column_stack([floor.faces + len(points), np.full(len(floor.faces), -1)])
        points, faces = np.concatenate([points, floor.vertices - [0.0, 0.01, 0.0]]), np.concatenate([faces, new])
    elif case.startswith("legs"):
        joint = np.array([0.0, 0.53 * points[:, 1].max(), 0.0])
        for sign in (1.0, -1.0):
            c, s = np.cos(np.radians(12.0)), (-1.0 if case == "legs apart" else 1.0) * np.sin(np.radians(12.0))
            turn = np.array([[c, sign * s, 0.0], [-sign * s, c, 0.0], [0.0, 0.0, 1.0]])
            low = np.clip((joint[1] + 0.03 - points[:, 1]) / 0.12, 0.0, 1.0) * (sign * points[:, 0] > 0.0)
            low = low * (np.abs(points[:, 0]) < 0.26)
            points = points + low[:, None] * ((points - joint) @ turn.T + joint - points)
    if case == "T-pose":
        body = posed_body("female", "arms up")
    else:
        body = Mannequin.from_scan(points, faces, resolution_mm=40.0)
    wanted = {"bust": 0.845, "underbust": 0.702, "waist": 0.652, "hip": 0.904}
    if case.startswith("legs"):
        del wanted["hip"]
    for tape, girth in wanted.items():
        assert body.measures[tape].girth == pytest.approx(girth, abs=0.012), tape


@needs_data
def test_sleeves_of_a_t_pose_hang_from_the_shoulders() -> None:
    body = posed_body("female", "arms up")
    assert any("its arms are raised by" in note for note in body.notes)
    points, _ = body.scan
    wide, tall = np.abs(points[:, 0]).max(), points[:, 1].max()
    hand = points[np.abs(points[:, 0]) > 0.95 * wide]
    assert hand[:, 1].mean() < 0.72 * tall


@needs_data
def test_one_arm_is_refused_in_one_line() -> None:
    points, faces = scan("female")
    faces = _without(lambda at: (at[:, 0] > 0.2) & (at[:, 1] > 0.5 * points[:, 1].max()), points, faces)
    with pytest.raises(InputError, match="scan: the scan does not show two upper arms"):
        Mannequin.from_scan(points, faces, resolution_mm=20.0)


def _sitting(hip: float, knee: float, *, turned: float = 0.0) -> tuple[Person, np.ndarray]:
    """Return a person on a chair or a saddle, and the vertices of the finer body [m]."""
    model = BodyModel.load()
    bend = np.zeros((len(model.joints), 3))
    for side, sign in (("L", 1.0), ("R", -1.0)):
        for joint, angles in (
            ("upperleg01", (-hip, 0.0, 0.0)), ("lowerleg01", (knee, 0.0, 0.0)), ("upperarm01", (-0.3, 0.0, -0.35 * sign)),
        ):  # fmt: skip
            bend[model.joints.index(f"{joint}.{side}")] = angles
    bends = rotation(bend)
    for side, sign in (("L", 0.15), ("R", -0.15)):
        thigh = model.joints.index(f"upperleg01.{side}")
        bends[thigh] = rotation(np.array([[0.0, sign, 0.0]]))[0] @ bends[thigh]
    shape = 0.7 * np.random.default_rng(3).normal(size=len(model.shapes))
    turn = rotation(np.array([[0.0, turned, 0.0]]))[0]
    person = Person(shape=shape, bend=bends, turn=turn, scale=1.7, place=np.zeros(3))
    return person, finer_body()[0] @ model.vertices(person)


@pytest.mark.parametrize(("hip", "knee"), [(1.5, 1.4), (1.05, 1.55), (1.65, 1.65)])
def test_a_body_that_sits_is_fitted_where_its_pose_is_kept(hip: float, knee: float) -> None:
    person, vertices = _sitting(hip, knee, turned=0.5)
    options = ScanOptions(keep_pose=True)
    body = CommonBody.of_scan(vertices, finer_body()[1], name="rider", options=options)
    assert body.far < 0.003
    model = BodyModel.load()
    for joint in ("upperleg01", "lowerleg01"):
        number = model.joints.index(f"{joint}.L")
        off = body.person.bend[number].T @ person.bend[number]
        assert np.degrees(np.arccos(np.clip(0.5 * (np.trace(off) - 1.0), -1.0, 1.0))) < 5.0, joint


def test_a_body_that_sits_is_refused_unasked_and_its_mannequin_stands() -> None:
    person, vertices = _sitting(1.5, 1.4, turned=0.5)
    triangles = finer_body()[1]
    with pytest.raises(InputError, match="a standing body with feet apart is needed"):
        Mannequin.from_scan(vertices, triangles)
    with pytest.raises(InputError, match="the scan sits, and heights are those of standing bodies"):
        Mannequin.from_scan(vertices, triangles, options=ScanOptions(keep_pose=True, landmarks={"waist": 1.0}))
    sat = Mannequin.from_scan(vertices, triangles, options=ScanOptions(keep_pose=True), resolution_mm=40.0)
    upright = finer_body()[0] @ BodyModel.load().vertices(person.standing())
    stood = Mannequin.from_scan(upright, triangles, resolution_mm=40.0)
    assert sat.levels()["waist"].height == pytest.approx(stood.levels()["waist"].height, abs=0.015)
    for name, most in (
        ("bust", 0.005),
        ("waist", 0.004),
        ("calf left", 0.004),
        ("hip", 0.015),
        ("thigh left", 0.012),
    ):
        assert sat.measures[name].girth == pytest.approx(stood.measures[name].girth, abs=most), name
    # What it sits on is a guess.
    assert {name for name, each in sat.measures.items() if each.guess == "the scan sits"} >= {"hip", "thigh left"}
    assert any("warpflat fit --keep-pose" in note for note in sat.notes)
