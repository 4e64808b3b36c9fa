"""The wardrobe: every choice makes a valid scene."""

from __future__ import annotations

from pathlib import Path

import pytest

from warpflat.app.scene.load import Scene, make_scene
from warpflat.app.scene.wardrobe import garment_offer, offers, scene_text
from warpflat.core.errors import InputError
from warpflat.core.toml_file import tomllib

SCENES = Path(__file__).parents[3] / "scenes"


def scene_of(name: str, **chosen: str) -> Scene:
    text = scene_text(garment_offer(name), {"size": "EU 40"}, chosen, file="x.toml")
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
