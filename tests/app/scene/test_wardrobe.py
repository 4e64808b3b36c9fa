"""The wardrobe: every choice makes a valid scene, and garments come out whole."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from warpflat.app.scene.load import Scene, make_scene
from warpflat.app.scene.plan import plan_garment
from warpflat.app.scene.wardrobe import garment_offer, offers, scene_text
from warpflat.core.errors import InputError
from warpflat.garment.construction.to_pattern import pattern_of_garment
from warpflat.pattern.drafting.draft import draft_garment

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

SCENES = Path(__file__).parents[3] / "scenes"


def scene_of(name: str, *, resolution_mm: float = 40.0, **chosen: str) -> Scene:
    text = scene_text(garment_offer(name), {"size": "EU 40", "resolution_mm": resolution_mm}, chosen, file="x.toml")
    return make_scene(tomllib.loads(text), name=name, folder=Path(), where=name)


@pytest.mark.parametrize("name", list(offers()))
def test_every_option_makes_a_valid_scene_of_its_own(name: str):
    offer = garment_offer(name)
    for choice, options in offer.choices.items():
        texts = set()
        for option, (about, _) in options.items():
            assert about
            scene = scene_of(name, **{choice: option})
            texts.add(scene.settings.model_dump_json(exclude={"name"}))
        assert len(texts) == len(options) > 1, choice


@pytest.mark.parametrize(
    ("name", "chosen", "pieces"),
    [
        ("shirt", {"collar": "shirt", "sleeve": "long"}, {"collar", "collar_stand", "cuff", "sleeve_placket"}),
        ("hoodie", {"closure": "zip"}, {"hood", "hood_strip", "wrist_band", "hip_band"}),
        ("circle_skirt", {"skirt": "circle"}, {"front_hip_flounce", "back_hip_flounce", "waistband"}),
        ("pyjama_trousers", {"hem": "rib"}, {"ankle_band"}),
        ("shift_dress", {"hem": "ruffle", "collar": "flat"}, {"knee_ruffle", "collar", "armhole_binding"}),
        ("polo", {}, {"neck_placket", "collar"}),
        ("wrap_dress", {"sleeve": "short"}, {"front_bodice_left", "front_skirt_left", "tie", "neck_binding"}),
        ("gored_skirt", {"hem": "slanted"}, {"godet", "godet_2", "front_side_left", "back_side_right"}),
        ("sweatshirt", {"armhole": "raglan"}, {"sleeve_left", "wrist_band"}),
    ],
)
def test_garment_comes_out_whole(name: str, chosen: dict[str, str], pieces: set[str]):
    # Collars and hoods are cut to the neck's curve, which takes finer meshes.
    plan = plan_garment(scene_of(name, resolution_mm=25.0 if {"collar", "hood"} & pieces else 40.0, **chosen))
    garment = plan.flatten()
    metrics = garment.metrics()
    assert all(each["flipped_faces"] == 0 and each["stages"][-1]["converged"] for each in metrics["pieces"].values())
    # It can be put on.
    assert all(ring["passes"] is not False for ring in metrics["rings"])
    pattern, _ = pattern_of_garment({"": garment}, name=name, rules=plan.drawing.rules)
    drafted = draft_garment(pattern)
    assert pieces <= {piece.name for piece in drafted.pieces[""]}
    assert all(seam.matches for seam in drafted.seams)


def test_unknown_names_are_told_with_the_nearest():
    with pytest.raises(InputError, match="'shrt' is unknown: did you mean 'shirt'"):
        garment_offer("shrt")
    with pytest.raises(InputError, match="a shirt has no choice 'colar': did you mean 'collar'"):
        scene_text(garment_offer("shirt"), {"size": "EU 38"}, {"colar": "stand"}, file="x.toml")
    with pytest.raises(InputError, match="collar 'stnd' is unknown: did you mean 'stand'"):
        scene_text(garment_offer("shirt"), {"size": "EU 38"}, {"collar": "stnd"}, file="x.toml")


@pytest.mark.parametrize(
    "name",
    [
        *(
            "shirt",
            "hoodie",
            "sweatshirt",
            "shirt_dress",
            "circle_dress",
            "circle_skirt",
            "pencil_skirt",
            "pyjama_trousers",
        ),
        *("polo", "chinos", "jeans", "waistcoat", "jacket", "leggings", "unitard", "jumpsuit", "pleated_skirt"),
        *("wrap_dress", "gored_skirt", "leotard", "pyjama_jacket"),
        *("apron", "tote", "sun_hat"),
    ],
)
def test_shipped_scene_is_what_the_command_writes(name: str):
    written = scene_text(
        garment_offer(name), {} if name == "tote" else {"size": "EU 38"}, {}, file=f"scenes/{name}.toml"
    )
    assert (SCENES / f"{name}.toml").read_text(encoding="utf-8") == written
