"""Every garment of `warpflat new`, as it is sewn: notches meet."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from warpflat.garment.linings import add_interfacing, add_lining
from warpflat.garment.to_pattern import pattern_of_garment
from warpflat.pattern.draft import draft_garment
from warpflat.pattern.drafted import DraftedGarment
from warpflat.scene.load import make_scene
from warpflat.scene.plan import plan_scene
from warpflat.scene.wardrobe import garment_offer, offers, scene_text

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

#: Garments, and options of them that sew other seams than the others do.
SEWN: tuple[tuple[str, dict[str, str]], ...] = (
    *((name, {}) for name in offers()),
    ("shirt", {"collar": "stand", "sleeve": "none"}),
    ("shirt", {"collar": "flat", "sleeve": "three-quarter"}),
    ("hoodie", {"closure": "zip"}),
    ("sweatshirt", {"armhole": "raglan"}),
    ("shift_dress", {"hem": "ruffle", "collar": "flat"}),
    ("gored_skirt", {"hem": "slanted"}),
)


def drafted_garment(name: str, chosen: dict[str, str]) -> DraftedGarment:
    offer = garment_offer(name)
    body = {"size": "EU 40"} if offer.of_body else {"size": "EU 40", "resolution_mm": 40.0} if offer.on_body else {}
    scene = make_scene(
        tomllib.loads(scene_text(offer, body, chosen, file="x.toml")), name=name, folder=Path(), where=name
    )
    plan = plan_scene(scene)
    drawing = plan.drawing
    pattern, _ = pattern_of_garment(
        {"": plan.flatten()}, name=name, rules=drawing.rules, cloth_width=drawing.cloth_width
    )
    pattern = add_lining(pattern, drawing.lining) if drawing.lining else pattern
    return draft_garment(add_interfacing(pattern, drawing.interfacing) if drawing.interfacing else pattern)


@pytest.fixture(scope="module", params=SEWN, ids=lambda each: " ".join([each[0], *each[1].values()]))
def drafted(request: pytest.FixtureRequest) -> DraftedGarment:
    return drafted_garment(*request.param)


def test_notches_meet(drafted: DraftedGarment):
    apart = {seam.name: seam.notches_mm for seam in drafted.seams if seam.notches_mm is not None}
    assert apart or not drafted.seams
    assert {name: gap for name, gap in apart.items() if gap > 0.2} == {}
