"""The verdict on a block as it is, and on controls that no tailor would let go."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bodies import body_of_size

from warpflat.app.scene.load import make_scene
from warpflat.app.scene.outside_pattern import OutsideJob, RunGirth, SewingTable
from warpflat.app.scene.plan import plan_scene
from warpflat.core.toml_file import read_toml
from warpflat.flat.flattening.verdict import Verdict, judge
from warpflat.garment.construction.form_garment import FormGarment, flatten_form
from warpflat.garment.construction.garment import Garment
from warpflat.garment.construction.to_pattern import pattern_of_garment
from warpflat.garment.mannequin.mannequin import Mannequin

SCENES = Path(__file__).parents[3] / "scenes"


@pytest.fixture(scope="module")
def block() -> Garment:
    tables = read_toml(SCENES / "basic_block.toml")
    tables["mannequin"] = {**tables["mannequin"], "resolution_mm": 20.0}
    scene = make_scene(tables, name="block", folder=SCENES, where="block")
    return plan_scene(scene).flatten()


def verdict_of(garment: Garment) -> Verdict:
    found = judge(garment.metrics())
    assert found is not None
    return found


def scaled(garment: Garment, wide: float, long: float) -> Garment:
    pieces = {name: replace(piece, positions=piece.positions * [wide, long]) for name, piece in garment.pieces.items()}
    return replace(garment, pieces=pieces)


def test_a_block_fits(block: Garment):
    found = verdict_of(block)
    assert found.words == "fits by its strain"
    assert not any(finding.fails for finding in found.findings)


@pytest.mark.parametrize(
    ("wide", "long", "kind"),
    [(1.04, 1.0, "too large"), (1.06, 1.06, "too large"), (0.94, 0.94, "held")],
    ids=["4 % wider", "6 % larger", "6 % smaller"],
)
def test_controls_do_not_fit(block: Garment, wide: float, long: float, kind: str):
    found = verdict_of(scaled(block, wide, long))
    assert found.words == "does not fit by its strain"
    first = found.findings[0]
    assert (first.kind, first.fails) == (kind, True)
    assert first.remedy


def test_a_bodice_without_darts_does_not_fit():
    body = body_of_size(20.0)
    found = verdict_of(flatten_form(body, body.form("bodice"), fabric="woven"))
    assert not found.fits
    assert found.findings[0].kind == "held"


def test_folds_and_missed_ease_are_told(block: Garment):
    metrics = block.metrics()
    metrics["wear"]["slack"] = 0.2
    for piece in metrics["pieces"].values():
        piece["wear"] = {
            **piece["wear"],
            "slack": 0.2,
            "where_slack": ["slack 9.0 % along weft (limit 5 %), hem; 40 cm2"],
        }
    metrics["girths"]["bust"] = {
        **metrics["girths"]["bust"],
        "ease_wanted_m": metrics["girths"]["bust"]["ease_m"] - 0.01,
    }
    found = judge(metrics)
    assert found is not None
    assert found.fits
    kinds = {finding.kind: finding.words for finding in found.findings}
    assert kinds["folds"].startswith("20.0 % of the cloth lies in folds; ")
    assert kinds["ease"].startswith("ease: bust +")
    assert np.isclose(metrics["girths"]["bust"]["ease_m"], metrics["girths"]["bust"]["ease_wanted_m"] + 0.01)


@pytest.mark.parametrize(("size", "kind"), [("EU 34", "too large"), ("EU 38", None)])
def test_a_garment_is_too_large_for_a_smaller_body_than_its_own(block: Garment, size: str, kind: str | None):
    girths = {level: RunGirth(**girth) for level, girth in block.metrics()["girths"].items()}
    job = OutsideJob(
        path=Path("block"), name="block", pattern=pattern_of_garment({"": block}, name="block")[0], sewing=SewingTable(),
        body=Mannequin.from_size(size, resolution_mm=20.0), lifts={}, girths=girths, sources=(),
    )  # fmt: skip
    drape = {"converged": True, "places": []}
    found = judge({"pieces": {}, "drape": drape, "girths": job.girths_on_body()})
    assert found is not None
    assert [finding.kind for finding in found.findings if finding.fails][:1] == ([kind] if kind else [])
    if kind:
        assert found.findings[0].words == "too large: bust +13.0 cm, +5.0 were drafted"
        said = [finding.words.split(" ")[2] for finding in found.findings if finding.fails]
        assert said == ["bust", "waist", "hip", "neck", "armhole"]


@pytest.mark.parametrize("line", ["armhole", "neck"])
def test_an_armhole_or_a_neck_that_gapes_is_too_large(block: Garment, line: str):
    """Lengthened by 6 %, which bust, waist and hip do not show."""
    assert isinstance(block, FormGarment)
    layout = block.mannequin.layout
    rows = [layout.lines["neck"]] if line == "neck" else [arm[0] for arm in layout.arms.values()]
    pieces = {}
    for name, piece in block.pieces.items():
        points = piece.positions.copy()
        for row in rows:
            on_row = np.isin(block.form.pieces[name].grid_vertices, row)
            if on_row.any():
                points[on_row] += 0.06 * (points[on_row] - points[on_row].mean(axis=0))
        pieces[name] = replace(piece, positions=points)
    found = verdict_of(replace(block, pieces=pieces))
    large = [finding for finding in found.findings if finding.kind == "too large"]
    assert len(large) == 1
    assert large[0].words.startswith(f"too large: {line} +")
    assert large[0].remedy == f"take it in at the {line}"


def test_the_paper_says_what_a_drape_found(block: Garment):
    drape = {"converged": True, "places": [{"words": "the neck gapes by 9.0 mm", "kind": "misfit", "fails": True}]}
    draped = replace(block, drape=drape)
    assert verdict_of(draped).words == "does not fit as draped"
    worn = pattern_of_garment({"": draped}, name="block")[0].worn
    assert worn is not None
    assert worn.failing == ("misfit",)
