"""Style edits: the same keys on every garment, and one line where they make no sense."""

from __future__ import annotations

import pytest

from warpflat.app.scene.style import style_options
from warpflat.app.scene.wardrobe import garment_offer, offer_tables, offers, scene_text
from warpflat.core.errors import InputError
from warpflat.core.toml_file import tomllib
from warpflat.garment.mannequin.forms import form_from_mapping


def tables_of(name: str, **style: str) -> dict:
    chosen = {key.replace("_", "-"): text for key, text in style.items()}
    return tomllib.loads(scene_text(garment_offer(name), {"size": "EU 38"}, chosen, file="x.toml"))


def bands(tables: dict) -> set[str]:
    form = form_from_mapping("own", tables["form"])
    return {pattern.partition("/")[0] for recipe in form.pieces.values() for pattern in recipe.bricks}


def test_length_moves_the_hem_and_what_is_sewn_to_it():
    tables = tables_of("sweatshirt", length="knee+5", sleeve_length="elbow")
    assert bands(tables) == {"shoulder-knee", "armhole-elbow"}
    assert {wish["edge"] for wish in tables["finishing"]} == {"neck", "knee", "elbow"}
    form = form_from_mapping("own", tables["form"])
    assert ("hip", "knee") in form.ruled
    assert (form.profiles["knee"].like, form.profiles["knee"].raise_cm) == ("hip", -5.0)
    assert tables["ease"]["knee"] == tables["ease"]["hip"]
    assert bands(tables_of("trousers", length="calf-2")) == {"waist-hip", "crotch-leg_calf"}
    # A dress keeps the flare of its hem.
    assert tables_of("shift_dress", length="ankle")["form"]["profiles"]["ankle"]["scale"] == 1.15


def test_a_longer_sleeve_has_ease_all_the_way_down():
    ease = tables_of("tshirt", sleeve_length="wrist")["ease"]
    assert [ease[level] for level in ("biceps", "elbow", "forearm", "wrist")] == [6, 6, 6, 6]
    # What a garment says of its levels stays.
    assert tables_of("shirt", sleeve_length="forearm")["ease"]["elbow"] == 8
    assert "forearm" not in tables_of("tshirt", sleeve_length="elbow")["ease"]


def test_neckline_ease_flare_and_closure():
    tables = tables_of(
        "shift_dress", neck_depth="8", neck_width="2", ease_waist="12", flare="20", closure="zip-side", ease_bust="7"
    )
    assert tables["form"]["neckline"] == {"front_cm": 8, "side_cm": 2, "back_cm": 0, "front_power": 2}
    assert tables["ease"] == {"bust": 7, "waist": 12, "abdomen": 13, "hip": 5, "knee": 20}
    assert tables["openings"] == [{"kind": "zip", "seam": "side left", "length_mm": 180}]
    assert [each["kind"] for each in tables_of("pencil_skirt", closure="none")["openings"]] == ["vent"]
    assert tables_of("jumpsuit", closure="buttons-front")["openings"] == [
        {"kind": "buttons", "seam": "crotch front", "length_mm": 560}
    ]
    assert tables_of("tshirt", sleeve_width="9")["ease"]["biceps"] == 9
    # The neckline of the form that it is like stays where nothing is said.
    assert tables_of("tshirt", neck_depth="9")["form"]["neckline"]["side_cm"] == 2


def test_edits_do_not_hang_on_their_order():
    edits = {"flare": "20", "sleeve_width": "9", "closure": "zip-side", "length": "hip"}
    for garment, kinds in (("shift_dress", ("flare", "closure", "length")), ("sweatshirt", ("sleeve_width", "length"))):
        asked = {key: edits[key] for key in kinds}
        assert tables_of(garment, **asked) == tables_of(garment, **dict(reversed(asked.items())))


def test_hem_lies_higher_at_its_lines():
    tables = tables_of("a_line_skirt", hem_side_left="20", hem_centre_front="5")
    rises = {"side left": 200, "side right": 0, "centre front": 50, "centre back": 0}
    assert tables["finishing"][1:] == [{"kind": "hem", "edge": "knee", "shorten_mm": rises}]
    assert tables_of("unitard", hem_outseam="4")["finishing"][-1]["shorten_mm"] == {"outseam": 40, "inseam": 0}
    # It follows the hem to another level.
    assert tables_of("shift_dress", hem_side_left="9", length="thigh")["finishing"][-1]["edge"] == "thigh"


@pytest.mark.parametrize(
    ("name", "style", "message"),
    [
        ("pencil_skirt", {"neck_depth": "8"}, "--neck-depth makes no sense on a pencil_skirt: it has no neckline"),
        ("trousers", {"sleeve_length": "elbow"}, "it has no sleeves"),
        ("circle_skirt", {"length": "knee"}, "its length is that of the part sewn to its lower edge"),
        ("circle_skirt", {"flare": "9"}, "makes no sense"),
        ("shirt", {"closure": "zip-back"}, "with this collar, which opens in front"),
        ("shirt", {"closure": "zips"}, "unknown on a shirt"),
        (
            "chinos",
            {"closure": "zip-side"},
            "--closure zip-side lies where a chinos with these choices has its pockets",
        ),
        ("trousers", {"closure": "buttons-side", "pockets": "inseam"}, "has its pockets; take another side"),
        ("shirt", {"length": "shin"}, "no level at which it can end"),
        ("shirt", {"length": "hip+x"}, "a number from 0 to 30"),
        ("shirt", {"ease_knee": "3"}, "--ease-knee makes no sense on a shirt"),
        ("shirt", {"neck_depth": "40"}, "a number from 0 to 15"),
        ("shirt", {"neck_depth": "nan"}, "a number from 0 to 15"),
        ("circle_skirt", {"hem_side_left": "9"}, "its length is that of the part sewn to its lower edge"),
        ("shirt", {"hem_outseam": "9"}, "--hem-outseam makes no sense on a shirt"),
        ("shirt", {"hem_side_left": "-9"}, "a number from 0 to 80"),
        ("tshirt", {"sleeve": "none", "armhole": "raglan"}, "do not go together: .* the form has no sleeves"),
        ("tote", {"length": "knee"}, "lies on no body"),
    ],
)
def test_what_makes_no_sense_is_refused_in_one_line(name: str, style: dict[str, str], message: str):
    with pytest.raises(InputError, match=message) as raised:
        tables_of(name, **style)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("name", [name for name, offer in offers().items() if offer.on_body])
def test_every_level_that_is_offered_makes_a_form(name: str):
    offer = garment_offer(name)
    known = style_options(offer_tables(offer, {}))
    for key in {"length", "sleeve-length", "closure"} & known.keys():
        for text in known[key].split(", "):
            if key in offer.choices or (key == "closure" and text not in ("none", "zip-front")):
                continue
            tables = offer_tables(offer, {key: text})
            form = tables["form"]
            assert isinstance(form, str) or form_from_mapping("own", form).pieces
