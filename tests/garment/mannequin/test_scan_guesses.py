"""Scans that show less than a whole body: what is refused, and which tapes say that they are guesses."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from body_tapes import armpit_and_crotch
from landmarks import Landmarks
from limb_tapes import arm_tapes, tape_across
from real_files import needs_data
from scans import _read, posed_body, posed_scan, scan, scanned_body, triangles_of

from warpflat.core.errors import InputError
from warpflat.garment.mannequin.body_model import BodyModel, Person, finer_body, rotation
from warpflat.garment.mannequin.mannequin import Mannequin
from warpflat.garment.mannequin.scan_levels import find_levels
from warpflat.garment.mannequin.scan_pose import across_trunk
from warpflat.garment.mannequin.slicer import Slicer


def _between(points: np.ndarray, faces: np.ndarray, low: float, high: float) -> tuple[np.ndarray, np.ndarray]:
    """The part of a body between two shares of its height."""
    share = points[faces[:, :3]][:, :, 1] / points[:, 1].max()
    return points, faces[(share.min(axis=1) > low) & (share.max(axis=1) < high)]


@needs_data
def test_a_body_without_its_head_is_refused() -> None:
    with pytest.raises(InputError, match="the head is missing"):
        Mannequin.from_scan(*_between(*scan("male"), 0.0, 0.89), resolution_mm=40.0)


@needs_data
def test_the_fullest_place_of_an_evenly_full_arm_is_a_guess() -> None:
    faces = scan("male_heavy")[1]
    landmarks = Landmarks(faces)
    for copy, is_guess in (("arms down", True), ("as it is", False)):
        posed = posed_scan("male_heavy", copy)
        body = posed_body("male_heavy", copy) if is_guess else scanned_body("male_heavy")
        mesh = trimesh.Trimesh(posed, triangles_of(faces), process=False)
        assert [body.measures[f"biceps {s}"].guess is not None for s in ("left", "right")] == [is_guess] * 2
        # Its elbow bends in a bow.
        for side in ("left", "right"):
            ours = body.measures[f"elbow {side}"]
            wrist, elbow, upper = landmarks.bones(posed, side)
            lower = (elbow - wrist) / np.linalg.norm(elbow - wrist)
            height, girth = tape_across(mesh, elbow, (lower + upper) / np.linalg.norm(lower + upper))
            assert ours.guess or (abs(ours.height - height) < 0.004 and abs(ours.girth - girth) < 0.009), (copy, side)
    assert not any("elbow" in name and m.guess for name, m in scanned_body("female").measures.items())


@needs_data
def test_fold_and_knee_of_a_mixed_body_are_right_or_guesses() -> None:
    """On bodies with one mesh a landmark's vertices on one are the landmark's on all, mixes among them."""
    (one, faces), (other, _) = scan("child"), scan("male_heavy")
    points = 0.5 * (one + other)
    body, marks = Mannequin.from_scan(points, faces, resolution_mm=40.0), Landmarks(faces)
    # Where no fold shows, its place is a guess, and near all the same.
    assert body.measures["underbust"].guess == "no fold shows under the bust"
    assert abs(body.measures["underbust"].height - marks.fold(points)) < 0.004
    # Fat moves the crease behind the knee down, and the skin over it less.
    knee = body.measures["knee left"]
    assert abs(knee.height - marks.knee(points, "left")) < 0.004 or knee.guess is not None


@needs_data
def test_the_upper_arm_is_measured_from_where_the_arm_joins_the_trunk() -> None:
    """The scan shows where; measured from the body's nearest vertex, this mix's tapes lie 3.8 mm off."""
    (woman, faces), (child, _) = scan("female"), scan("child")
    points = (0.16 * woman + 0.84 * child) * [1.05, 0.97, 1.08]
    mesh = trimesh.Trimesh(points, triangles_of(faces), process=False)
    armpit, tips, marks = armpit_and_crotch(mesh)[0], points[:, 0], Landmarks(faces)
    body = Mannequin.from_scan(points, faces, resolution_mm=40.0)
    for side, tip in (("left", np.argmax(tips)), ("right", np.argmin(tips))):
        height, girth = arm_tapes(mesh, armpit, int(tip), marks.bones(points, side))["biceps"]
        ours = body.measures[f"biceps {side}"]
        assert abs(ours.height - height) < 0.003
        assert abs(ours.girth - girth) < 0.006


def test_a_body_with_feet_as_small_as_a_childs_is_not_refused() -> None:
    model, (finer, triangles) = BodyModel.load(), finer_body()
    shape = np.random.default_rng(101).normal(size=len(model.shapes))
    straight = rotation(np.zeros((len(model.joints), 3)))
    person = Person(shape=shape, bend=straight, turn=np.eye(3), scale=1.58, place=np.zeros(3))
    body = Mannequin.from_scan(finer @ model.vertices(person), triangles, resolution_mm=40.0)
    assert "foot left" not in body.measures
    assert body.measures["ankle left"].girth > 0.15


def test_trunk_of_two_equal_parts_has_a_direction() -> None:
    """Two parts of one area are no tie that cannot be broken."""
    one = trimesh.creation.box((0.25, 2.0, 0.125))
    aside = np.array([0.5, 0.0, 0.0])
    points = np.concatenate([one.vertices - aside, one.vertices + aside])
    slicer = Slicer(points, np.concatenate([one.faces, one.faces + len(one.vertices)]))
    left = across_trunk(slicer, np.array([0.0, 1.0, 0.0]), np.array([1.0, 0.0, 0.0]))
    assert abs(left[1]) < 1e-9
    assert np.linalg.norm(left) == pytest.approx(1.0)


@needs_data
@pytest.mark.parametrize(("name", "words"), [("calf", "knee .* above calf"), ("ankle", "calf .* above ankle")])
def test_levels_of_the_leg_come_in_their_order(name: str, words: str) -> None:
    read = _read("female")
    above = {"calf": "knee", "ankle": "calf"}[name]
    with pytest.raises(InputError, match=words):
        find_levels(read.body, read.laid, 0.0, {name: read.found[f"leg_{above}"].height + 0.005})


@needs_data
def test_tapes_over_holes_in_chest_and_upper_arm_are_guesses() -> None:
    points, faces = scan("female")
    whole = scanned_body("female")
    x, y, z = points[faces[:, :3]].mean(axis=1).T
    elbow, upper = (whole.line(f"{name} left").mean(axis=0) for name in ("elbow", "biceps"))
    share = (whole.measures["biceps left"].height - elbow[1]) / (upper - elbow)[1]
    arm = elbow + share * (upper - elbow)
    in_arm = (np.linalg.norm(np.stack([x, y, z], axis=1) - arm, axis=1) < 0.06) & (x > arm[0] - 0.01)
    in_chest = (np.abs(y - whole.measures["chest, fullest"].height) < 0.03) & (np.abs(x) < 0.07) & (z > 0.0)
    body = Mannequin.from_scan(points, faces[~(in_arm | in_chest)], resolution_mm=40.0)
    for name, why in (("biceps left", "does not show the body"), ("chest, fullest", "over a hole in the scan")):
        guess = body.measures[name].guess
        assert whole.measures[name].guess is None
        assert guess is not None
        assert why in guess
    assert body.measures["biceps right"].guess is None


@needs_data
def test_tapes_of_arms_above_the_shoulders_are_guesses() -> None:
    """The shoulder's flesh comes into them: a tape laid on the mesh is 60 to 110 mm off."""
    up, level = posed_body("female", "arms up"), posed_body("female", "arms level")
    for name in ("biceps left", "biceps right"):
        assert up.measures[name].guess == "the arms are raised above the shoulders"
        assert level.measures[name].guess is None
