"""The film of a run: how its frames are spread, what they say of themselves, and that pieces keep time."""

from __future__ import annotations

import base64
import json
import zlib
from itertools import groupby, pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from usd_validation import validate_usd

from warpflat.app.review.film import open_film, pack_film
from warpflat.app.scene.frames import Between, FilmStage, KeyFile, frames_along, spread
from warpflat.app.scene.load import make_scene
from warpflat.app.scene.run import run_scene


def shots_of(film: Path, piece: str) -> dict[int, list[np.ndarray]]:
    """The layouts of each stage of a piece; a new topology begins another."""
    from pxr import Usd

    stage = Usd.Stage.Open(str(film))
    prim, points = (
        stage.GetPrimAtPath(f"/World/{piece}"),
        stage.GetPrimAtPath(f"/World/{piece}/{piece}_pattern").GetAttribute("points"),
    )
    found: dict[Any, list[np.ndarray]] = {}
    for at in range(int(stage.GetStartTimeCode()), int(stage.GetEndTimeCode()) + 1):
        layout = np.array(points.Get(at), dtype=np.float64)
        number = prim.GetAttribute("warpflat:stage_number").Get(at)
        found.setdefault(number, []).append(layout)
    return found


def test_no_frame_moves_a_vertex_by_more_than_a_twentieth_of_its_stage(tmp_path: Path) -> None:
    from pxr import Usd

    settings = {
        "surface": {"shape": "dome", "resolution": 17},
        "cuts": [{"name": "slit", "line": "centre", "part": [0.0, 0.5]}],
        "output": {"picture": False},
        "pattern": {"formats": []},
    }
    run_scene(make_scene(settings, name="trial", folder=tmp_path, where="trial"), tmp_path)
    shots = shots_of(tmp_path / "frames.usdc", "trial")
    assert len(shots[0]) == 60
    assert len({len(layout) for layout in shots[1]}) == 1
    assert len(shots[2]) >= 15
    assert len(shots[2][0]) > len(shots[1][0]), "the crack is open to the topology"
    for number in (0, 2):
        way = max(np.linalg.norm(layout - shots[number][0], axis=1).max() for layout in shots[number])
        moves = [np.linalg.norm(b - a, axis=1).max() for a, b in pairwise(shots[number])]
        assert way > 1e-3
        assert max(moves) < 0.0501 * way
    stage = Usd.Stage.Open(str(tmp_path / "frames.usdc"))
    prim = stage.GetPrimAtPath("/World/trial")
    types = {
        name: prim.GetAttribute(f"warpflat:{name}").GetTypeName()
        for name in ("stage", "step", "interpolated", "model_energy_j")
    }
    assert types == {"stage": "string", "step": "int", "interpolated": "bool", "model_energy_j": "double"}
    names = prim.GetAttribute("warpflat:stage")
    shown = [names.Get(at) for at in range(1, int(stage.GetEndTimeCode()) + 1)]
    order = ["relax", "steps", "relax", "cut:slit", "steps", "cut:slit", "sew"]
    assert [name for name, _ in groupby(shown)] == order
    assert (shown[59], shown[60]) == ("relax", "cut:slit")
    tags = [prim.GetAttribute("warpflat:interpolated").Get(at) for at in range(1, 61)]
    assert (tags[0], tags[1], tags[-1]) == (False, True, False)
    assert validate_usd(tmp_path / "frames.usdc") == []


def test_a_compact_film_shows_the_same_in_fewer_bytes(tmp_path: Path) -> None:
    from pxr import Usd

    settings = {"surface": {"shape": "dome", "resolution": 17}, "pattern": {"formats": []}}
    for name in ("all", "compact"):
        output = {"picture": False, "compact_film": name == "compact"}
        (tmp_path / name).mkdir()
        run_scene(
            make_scene({**settings, "output": output}, name="trial", folder=tmp_path, where="trial"), tmp_path / name
        )
    whole, compact = (shots_of(tmp_path / name / "frames.usdc", "trial") for name in ("all", "compact"))
    assert {number: len(shot) for number, shot in whole.items()} == {
        number: len(shot) for number, shot in compact.items()
    }
    np.testing.assert_allclose(np.concatenate(whole[0]), np.concatenate(compact[0]), atol=1e-6)
    samples, sizes = [], []
    for name in ("all", "compact"):
        film = tmp_path / name / "frames.usdc"
        stage = Usd.Stage.Open(str(film))
        samples.append(stage.GetPrimAtPath("/World/trial/trial_pattern").GetAttribute("points").GetNumTimeSamples())
        sizes.append(film.stat().st_size)
    assert samples[0] == 60
    assert samples[1] < 20
    assert sizes[1] < 0.6 * sizes[0]


def test_the_steps_of_the_method_are_filmed_as_they_are(tmp_path: Path) -> None:
    from pxr import Usd

    settings = {
        "surface": {"shape": "dome", "resolution": 9},
        "relax": {"solver": "paper", "max_steps": 40},
        "output": {"frame_every": 5, "picture": False},
        "pattern": {"formats": []},
    }
    run_scene(make_scene(settings, name="trial", folder=tmp_path, where="trial"), tmp_path)
    stage = Usd.Stage.Open(str(tmp_path / "frames.usdc"))
    prim = stage.GetPrimAtPath("/World/trial")
    steps = prim.GetAttribute("warpflat:step")
    assert [steps.Get(at) for at in steps.GetTimeSamples()] == [0, 5, 10, 15, 20, 25, 30, 35, 40, 40]
    tags = prim.GetAttribute("warpflat:interpolated")
    assert not any(tags.Get(at) for at in tags.GetTimeSamples())


def test_a_piece_that_ends_without_strain_has_the_colours_of_its_start(tmp_path: Path) -> None:
    from pxr import Usd, UsdGeom

    settings = {
        "surface": {"shape": "cone", "resolution": 9},
        "output": {"frames": 10, "picture": False},
        "pattern": {"formats": []},
    }
    run_scene(make_scene(settings, name="trial", folder=tmp_path, where="trial"), tmp_path)
    stage = Usd.Stage.Open(str(tmp_path / "frames.usdc"))
    pattern = UsdGeom.Mesh(stage.GetPrimAtPath("/World/trial/trial_pattern"))
    scale = pattern.GetDisplayColorAttr().GetCustomData()["rangeMax"]
    density = UsdGeom.PrimvarsAPI(pattern).GetPrimvar("strainEnergyDensity").GetAttr()
    first, last = (np.array(density.Get(at)) for at in (stage.GetStartTimeCode(), stage.GetEndTimeCode()))
    assert last.max() < 1e-6
    assert 0.5 * first.max() < scale < 2.0 * first.max()


def test_the_film_of_a_garment_refers_to_its_mannequin(tmp_path: Path) -> None:
    from pxr import Usd, UsdGeom

    settings = {
        "mannequin": {"size": "EU 38", "resolution_mm": 20},
        "form": "bodice",
        "finishing": [{"kind": "band", "edge": "waist", "width_mm": 40}],
        "output": {"frames": 3, "picture": False},
        "pattern": {"formats": []},
    }
    scene = make_scene(settings, name="trial", folder=tmp_path, where="trial")
    # The console lists the body with the film.
    assert {"frames.usdc", "mannequin.usdc"} <= set(run_scene(scene, tmp_path / "first").files)
    folder = (tmp_path / "first").rename(tmp_path / "moved")  # the reference is relative to the film

    validate_usd(folder / "frames.usdc")
    film, alone = (Usd.Stage.Open(str(folder / name)) for name in ("frames.usdc", "mannequin.usdc"))
    assert film.GetRootLayer().GetExternalReferences() == ("./mannequin.usdc",)
    shown, body = (UsdGeom.Mesh(stage.GetPrimAtPath("/World/mannequin/body")) for stage in (film, alone))
    faces = np.array(body.GetFaceVertexIndicesAttr().Get())
    assert np.array_equal(np.array(shown.GetFaceVertexIndicesAttr().Get()), faces)
    moved = np.linalg.norm(np.array(shown.GetPointsAttr().Get()) - np.array(body.GetPointsAttr().Get()), axis=1)
    assert np.allclose(moved[np.unique(faces)], 0.003, atol=1e-6)
    # The page of the review shows the same body.
    packed = pack_film(open_film(folder / "frames.usdc"))
    assert packed is not None
    told, band = packed["still"]
    assert (told["kind"], band["kind"]) == ("body", "drafted")
    data = np.frombuffer(zlib.decompress(base64.b64decode(told["data"])), dtype=np.uint8)
    planes = data[12 * told["triangles"] :].reshape(2, 3, -1).astype(np.uint16)
    points = np.array(told["space"][:3]) + (planes[0] + 256 * planes[1]).T / 65535 * told["space"][3]
    np.testing.assert_allclose(points, np.array(shown.GetPointsAttr().Get())[np.unique(faces)], atol=2e-5)
    # The band, which has no frames, hangs below the waist, 40 mm high.
    (hung,) = film.GetPrimAtPath("/World/drafted").GetChildren()
    worn = np.array(UsdGeom.Mesh(hung).GetPointsAttr().Get())
    assert 0.03 < np.ptp(worn[:, 1]) < 0.06
    assert np.abs(worn[:, [0, 2]].mean(axis=0)).max() < 0.05
    # The patterns lie beside the body, and each mesh says whose it is.
    corners = UsdGeom.BBoxCache(Usd.TimeCode(1), [UsdGeom.Tokens.default_])
    body_box = corners.ComputeWorldBound(shown.GetPrim()).ComputeAlignedRange()
    for piece in json.loads((folder / "metrics.json").read_text())["pieces"]:
        pattern = film.GetPrimAtPath(f"/World/{piece}/{piece}_pattern")
        assert corners.ComputeWorldBound(pattern).ComputeAlignedRange().GetMin()[0] > body_box.GetMax()[0]
    line = film.GetPrimAtPath("/World/mannequin/lines").GetChildren()[0]
    assert UsdGeom.Imageable(line).ComputePurpose() == UsdGeom.Tokens.guide


def test_steps_are_spread_so_that_the_longest_is_short() -> None:
    assert spread([1.0, 3.0], 8) == [2, 6]
    assert spread([1.0, 0.0], 5) == [4, 1]
    assert spread([], 3) == []


@pytest.mark.parametrize("most_keys", [1000, 5, 2])
def test_a_path_is_thinned_where_layouts_are_large(tmp_path: Path, most_keys: int) -> None:
    rng = np.random.default_rng(1)
    path = np.cumsum(rng.random((30, 4, 2)), axis=0)
    stage = FilmStage(name="relax", topology={})
    with KeyFile(tmp_path) as file:
        stage.keys = [file.append(layout, np.ones(1) * number, {}) for number, layout in enumerate(path)]
        keys, count = stage.place_frames(steps=20, at_least=60, most_keys=most_keys)
        frames = list(frames_along(keys, count, between=True))
        np.testing.assert_allclose(frames[0].positions, path[0], rtol=1e-6)
        np.testing.assert_allclose(frames[-1].positions, path[-1], rtol=1e-6)
    assert len(frames) == count >= 60
    assert len(keys) <= most_keys
    assert sum(not isinstance(frame, Between) for frame in frames) == len(keys)
    assert list(tmp_path.iterdir()) == []
