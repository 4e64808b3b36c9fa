"""Garments that are pulled on, and lengths that are shares of a line: one scene for every wearer."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from warpflat.app.scene.form import scene_form
from warpflat.app.scene.load import Scene, load_scene, scene_fabric
from warpflat.app.scene.plan import plan_form_scene
from warpflat.app.scene.wardrobe import garment_offer, offer_tables, scene_text
from warpflat.core.errors import InputError
from warpflat.core.toml_file import tomllib
from warpflat.garment.construction.girths import pattern_girths
from warpflat.garment.construction.openings import opened_rings
from warpflat.garment.construction.rings import GarmentRing, measure_rings
from warpflat.garment.mannequin.neckline import Neckline

CHILD = {"measurements": {"bust": 0.64, "waist": 0.58, "hip": 0.68, "stature": 1.28}, "resolution_mm": 25.0}
TALL_MAN = {"size": "men 50", "measurements": {"stature": 1.94}, "resolution_mm": 25.0}


def scene_of(folder: Path, garment: str, body: dict[str, Any], **more: str) -> Scene:
    file = folder / "x.toml"
    file.write_text(scene_text(garment_offer(garment), body, more, file="x.toml"), encoding="utf-8")
    return load_scene(file)


def rings_on_form(scene: Scene) -> tuple[dict[str, GarmentRing], tuple[str, ...]]:
    mannequin, form = scene_form(scene)
    plan = plan_form_scene(scene, built=(mannequin, form))
    on_form = {name: piece.surface.vertices for name, piece in form.pieces.items()}
    rings = measure_rings(
        mannequin, form, on_form, strain_limit=scene_fabric(scene).strain_limit,
        girths=pattern_girths(mannequin, form, on_form), opened=opened_rings(mannequin, form, on_form, plan.openings, []),
    )  # fmt: skip
    return {ring.name: ring for ring in rings}, form.notes


@pytest.mark.parametrize(
    ("garment", "body", "ring"),
    [("tshirt", CHILD, "neck"), ("circle_dress", CHILD, "neck"), ("circle_dress", TALL_MAN, "waist")],
)
def test_ring_grows_until_it_passes_over(tmp_path: Path, garment: str, body: dict[str, Any], ring: str):
    rings, notes = rings_on_form(scene_of(tmp_path, garment, body))
    assert all(each.passes for each in rings.values())
    # No wider than it takes.
    assert rings[ring].stretched < 1.04 * rings[ring].girth
    (note,) = notes
    what = "the neckline lies" if ring == "neck" else "waist has"
    assert note.startswith(f"pulled on: {what}")
    assert note.endswith(f"passes over the {rings[ring].over} of {100 * rings[ring].girth:.1f} cm")


def test_nothing_grows_where_everything_passes(tmp_path: Path):
    rings, notes = rings_on_form(scene_of(tmp_path, "tshirt", {"size": "EU 38", "resolution_mm": 25.0}))
    assert rings["neck"].passes
    assert not notes


def test_an_opening_spares_the_neckline(tmp_path: Path):
    scene = scene_of(tmp_path, "hoodie", CHILD, closure="zip")
    form = scene_form(scene)[1]
    assert not form.notes
    assert form.recipe.neckline == Neckline(side_cm=2.0, front_cm=5.5, back_cm=1.5)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[wear]\nstretch_weft = 0.05\n", "pulled_on makes a garment as wide as it must be"),
        (
            '[[openings]]\nkind = "zip"\nseam = "centre back"\nlength_mm = 90\nlength_share = 0.5\n',
            "length_share belongs",
        ),
        (
            '[[openings]]\nkind = "slit"\nseam = "side left"\nlength_share = 0.5\n',
            "length_share belongs to a zip or buttons",
        ),
        (
            '[[pockets]]\nkind = "inseam"\nseam = "side left"\nmost_share = 0.5\n',
            "most_share belongs to a patch or welt",
        ),
    ],
)
def test_what_does_not_go_together_is_refused(tmp_path: Path, text: str, message: str):
    file = tmp_path / "x.toml"
    head = 'fabric = "interlock"\nform = "tshirt"\npulled_on = true\n[mannequin]\nsize = "EU 38"\n'
    file.write_text(head + text, encoding="utf-8")
    with pytest.raises(InputError, match=message):
        load_scene(file)


@pytest.mark.parametrize("garment", ["jumpsuit", "leotard", "unitard"])
def test_zip_is_a_share_of_its_line_in_whole_centimetres(tmp_path: Path, garment: str):
    lengths = []
    for body in (CHILD, TALL_MAN):
        (opening,) = plan_form_scene(scene_of(tmp_path, garment, body)).openings
        assert opening.length == pytest.approx(round(opening.length, 2), abs=1e-12)
        lengths.append(opening.length)
    assert 0.35 < lengths[0] < lengths[1] < 0.75


def test_an_opening_suits_each_size(tmp_path: Path):
    (tmp_path / "x.toml").write_text(
        'form = "dress"\n[mannequin]\nsize = "EU 38"\nresolution_mm = 40\n[[openings]]\nkind = "buttons"\nseam = "centre front"\n'
        'length_share = 0.5\n[pattern]\nsizes = ["EU 140"]\n'
    )
    plan = plan_form_scene(load_scene(tmp_path / "x.toml"))
    other = plan.other_sizes()["EU 140"]
    assert other.openings[0].length_mm < plan.openings[0].length_mm
    # The edges of its stand are straight as far as it reaches.
    for one in (plan, other):
        assert {each.reach for each in one.constraints} == {one.openings[0].length}


def test_length_share_before_start_is_named(tmp_path: Path):
    scene_of(tmp_path, "leotard", CHILD)
    text = (tmp_path / "x.toml").read_text().replace("length_share = 0.75", "length_share = 0.1\nstart_mm = 200")
    (tmp_path / "x.toml").write_text(text)
    with pytest.raises(
        InputError,
        match=r"^\S+\.toml: openings\[0\]: length_share = 0.1 ends \d+ mm along 'crotch back', and start_mm begins at 200",
    ):
        plan_form_scene(load_scene(tmp_path / "x.toml"))


def test_a_depth_in_centimetres_takes_the_place_of_a_share():
    tables = offer_tables(garment_offer("waistcoat"), {"neck-depth": "9"})
    assert tables["form"]["neckline"]["front_cm"] == 9
    assert tables["form"]["neckline"]["front_share"] == 0
    # The side stays a share.
    assert tables["form"]["neckline"]["side_share"] == 0.2
    assert (
        tomllib.loads(scene_text(garment_offer("waistcoat"), {"size": "EU 38"}, {}, file="x"))["form"]["neckline"][
            "front_share"
        ]
        == 0.55
    )
