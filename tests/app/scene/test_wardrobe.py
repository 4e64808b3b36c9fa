"""The wardrobe: every choice makes a valid scene."""

from __future__ import annotations

from pathlib import Path

import pytest

from warpflat.app.scene.load import Scene, make_scene
from warpflat.app.scene.wardrobe import garment_offer, offers, scene_text
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


# Those whose scene is another one are left out, and those without a scene.
@pytest.mark.parametrize(
    "name",
    [
        name
        for name in offers()
        if (SCENES / f"{name}.toml").is_file() and name not in ("a_line_skirt", "trousers", "tshirt")
    ],
)
def test_shipped_scene_is_what_the_command_writes(name: str):
    written = scene_text(
        garment_offer(name), {} if name == "tote" else {"size": "EU 38"}, {}, file=f"scenes/{name}.toml"
    )
    assert (SCENES / f"{name}.toml").read_text(encoding="utf-8") == written
