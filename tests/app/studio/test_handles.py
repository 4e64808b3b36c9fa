"""Points of the pattern that are dragged: the scene changes, and the point comes to lie where it was dragged."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("viser", reason="the extra `studio` (viser) is not installed")

from warpflat.app.scene.cuts import scene_with
from warpflat.app.scene.load import Scene, make_scene
from warpflat.app.studio.handles import Handle, pattern_handles
from warpflat.app.studio.solve import Solution, solve

BODY = {"mannequin": {"size": "EU 38", "resolution_mm": 20.0}, "fabric": "woven", "curves_mm": 0.0}
MESH = {"surface": {"shape": "bodice", "resolution": 33}, "datum": "centre"}


def scene_of(folder: Path, settings: dict[str, Any]) -> Scene:
    return make_scene(settings, name="trial", folder=folder, where="trial")


def handles_of(solution: Solution) -> dict[str, Handle]:
    return {f"{each.piece}: {each.name}": each for each in pattern_handles(solution)}


def test_a_mouth_that_is_dragged_leaves_the_tip_drawn_back(tmp_path: Path) -> None:
    cut = {"name": "dart", "line": "centre", "part": [0.0, 0.4], "tip_back": 0.01}
    mesh = {"surface": {"shape": "bodice", "resolution": 17}, "datum": "centre", "cuts": [cut]}
    handles = handles_of(solve(scene_of(tmp_path, mesh)))
    mouth = next(handle for name, handle in handles.items() if "mouth of dart" in name)
    (changed,) = mouth.change(mouth.place + np.array([0.01, 0.0]))["cuts"]
    assert changed["tip_back"] == 0.01
    assert changed.keys() == {"name", "tip_back", "from", "to"}


@pytest.fixture(scope="module")
def dress(tmp_path_factory: pytest.TempPathFactory) -> Solution:
    return solve(scene_of(tmp_path_factory.mktemp("dress"), {**BODY, "form": "dress", "shape": "darts"}))


@pytest.mark.parametrize(
    ("name", "by", "least"),
    [
        ("front: tip of bust dart left", (0.03, 0.0), 0.01),
        ("front: lower tip of waist dart left", (0.0, -0.04), 0.02),
        ("front: mouth of bust dart left, left", None, 0.002),
        ("back: mouth of waist dart left, right", None, 0.002),
        ("front: side left at the waist", (0.01, 0.0), 0.007),
        ("front: side right at the hip", (-0.01, 0.0), 0.004),
        ("front: neckline at the centre front", (0.0, -0.03), 0.02),
        ("back: neckline at the centre back", (0.0, -0.02), 0.01),
        ("front: neckline at the shoulder left", (0.02, -0.01), 0.01),
    ],
)
def test_what_is_dragged_follows(dress: Solution, name: str, by: tuple[float, float] | None, least: float) -> None:
    handles = handles_of(dress)
    assert name in handles, sorted(handles)
    handle = handles[name]
    if by is None:
        # A mouth opens away from its other end.
        word, side = name.rsplit(", ", 1)
        away = handle.place - handles[f"{word}, {'right' if side == 'left' else 'left'}"].place
        shift = 0.005 * away / np.linalg.norm(away)
    else:
        shift = np.array(by)
    changed = scene_with(dress.plan.scene, **handle.change(handle.place + shift))  # type: ignore[union-attr]
    after = solve(changed, dress)
    moved = handles_of(after)[name].place - handle.place
    assert moved @ shift / np.linalg.norm(shift) > least
    assert after.strain_energy != dress.strain_energy


def test_a_tip_on_a_mesh_goes_along_its_line(tmp_path: Path) -> None:
    before = solve(scene_of(tmp_path, {**MESH, "cuts": [{"line": "bust", "part": [0.0, 0.3]}]}))
    handle = handles_of(before)["trial: tip of bust"]
    mouth = handles_of(before)["trial: mouth of bust, left"].place
    shift = 0.04 * (handle.place - mouth) / np.linalg.norm(handle.place - mouth)
    after = solve(scene_with(before.scene, **handle.change(handle.place + shift)), before)
    assert after.scene.settings.cuts[0].line == "bust"
    np.testing.assert_allclose(handles_of(after)["trial: tip of bust"].place, handle.place + shift, atol=0.015)
    assert after.strain_energy < before.strain_energy
    # No tip goes back beyond its mouth.
    (cut,) = handle.change(mouth - shift)["cuts"]
    assert cut["part"][1] > cut["part"][0]


@pytest.mark.parametrize(("what", "shift"), [("tip", (0.02, 0.03)), ("mouth", (0.0, 0.04))])
def test_ends_of_a_cut_between_points_go_anywhere(tmp_path: Path, what: str, shift: tuple[float, float]) -> None:
    whole = solve(scene_of(tmp_path, MESH))
    surface = whole.pieces["trial"].surface
    bust = surface.vertices[surface.lines["bust"]]
    cut = {"name": "dart", "from": bust[0].tolist(), "to": bust[8].tolist()}
    before = solve(scene_with(whole.scene, cuts=[cut]), whole)
    name = next(key for key in handles_of(before) if key.startswith(f"trial: {what}"))
    handle = handles_of(before)[name]
    after = solve(scene_with(before.scene, **handle.change(handle.place + np.array(shift))), before)
    moved = handles_of(after)[name].place - handle.place
    # A mouth stays on the border, which curves.
    np.testing.assert_allclose(moved, shift, atol=0.02)
