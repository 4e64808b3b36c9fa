"""Files of a mannequin."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from usd_validation import validate_usd

from warpflat.garment.mannequin.mannequin import Mannequin
from warpflat.garment.mannequin.output import write_mannequin


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> tuple[Mannequin, dict[str, Path]]:
    body = Mannequin.from_size("EU 38", resolution_mm=20)
    return body, write_mannequin(body, tmp_path_factory.mktemp("mannequin") / "new")


def test_nothing_but_the_four_files(written: tuple[Mannequin, dict[str, Path]]) -> None:
    folder = written[1]["usd"].parent
    assert {p.name for p in folder.iterdir()} == {"mannequin.usdc", "mannequin.obj", "metrics.json", "picture.png"}


def test_metrics_name_source_heights_and_girths(written: tuple[Mannequin, dict[str, Path]]) -> None:
    data = json.loads(written[1]["metrics"].read_text())["mannequin"]
    assert "EU 38" in data["source"]
    assert data["levels"]["bust"]["girth_m"] == pytest.approx(0.88, abs=1e-6)
    assert data["levels"]["waist"]["height_m"] == pytest.approx(written[0].levels()["waist"].height)
    assert any("underbust" in note for note in data["notes"])


def test_usd_holds_bricks_and_lines(written: tuple[Mannequin, dict[str, Path]]) -> None:
    from pxr import Usd, UsdGeom

    body, files = written
    assert validate_usd(files["usd"]) == []
    stage = Usd.Stage.Open(str(files["usd"]))
    assert UsdGeom.GetStageUpAxis(stage) == "Y"
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1.0
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/World/mannequin/body"))
    assert np.allclose(np.array(mesh.GetPointsAttr().Get()), body.vertices, atol=1e-6)
    subsets = {s.GetPrim().GetDisplayName(): s for s in UsdGeom.Subset.GetAllGeomSubsets(mesh)}
    tube = UsdGeom.Mesh(stage.GetPrimAtPath("/World/mannequin/tube"))
    assert tube.GetPurposeAttr().Get() == "guide"
    around = {s.GetPrim().GetDisplayName() for s in UsdGeom.Subset.GetAllGeomSubsets(tube)}
    assert set(subsets) | around == set(body.layout.bricks)
    assert not set(subsets) & around
    name = "waist-abdomen/front-left-centre"
    assert sorted(subsets[name].GetIndicesAttr().Get()) == body.brick(name).faces.tolist()
    covered = np.concatenate([np.array(s.GetIndicesAttr().Get()) for s in subsets.values()])
    assert sorted(covered.tolist()) == list(range(len(body.layout.body_faces)))
    curves = {p.GetDisplayName(): p for p in stage.GetPrimAtPath("/World/mannequin/lines").GetChildren()}
    assert set(curves) == set(body.lines())
    waist = UsdGeom.BasisCurves(curves["waist"])
    assert waist.GetWrapAttr().Get() == "periodic"
    assert len(waist.GetPointsAttr().Get()) == len(body.line("waist")) - 1


def test_obj_reads_back(written: tuple[Mannequin, dict[str, Path]]) -> None:
    body, files = written
    rows = files["obj"].read_text().splitlines()
    points = np.array([[float(x) for x in r.split()[1:]] for r in rows if r.startswith("v ")])
    faces = np.array([[int(x) - 1 for x in r.split()[1:]] for r in rows if r.startswith("f ")])
    assert np.array_equal(points, body.vertices)
    assert np.array_equal(faces, body.layout.faces)
    assert "g waist-abdomen/front-left-centre" in rows


def test_picture_is_a_picture(written: tuple[Mannequin, dict[str, Path]]) -> None:
    from matplotlib.image import imread

    image = imread(written[1]["picture"])
    assert image.shape[0] > 700
    assert image.shape[1] > 1200
    ink = (image[..., :3].min(axis=2) < 0.95).mean()
    assert 0.1 < ink < 0.6
