"""Printed names of pieces and units of printed lengths: in labels, steps, DXF, SVG and back from pattern.json."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import ezdxf
import pytest
from sample_dress import sample_dress

from warpflat.core.errors import InputError
from warpflat.export.dxf import write_dxf
from warpflat.export.pattern_json import pattern_from_json, pattern_json
from warpflat.export.svg import write_svg
from warpflat.garment.pattern_files import check_names
from warpflat.pattern.draft import draft_garment
from warpflat.pattern.drafted import DraftedGarment
from warpflat.pattern.half_pieces import halved
from warpflat.pattern.measures import length_words
from warpflat.pattern.sewing_order import sewing_steps


@pytest.fixture(scope="module")
def dress() -> DraftedGarment:
    made = sample_dress()
    first = made.pieces["38"][0].name
    pieces = [replace(p, title="Vorderteil" if p.name == first else "", units="in") for p in made.pieces["38"]]
    return draft_garment(replace(made, pieces={"38": pieces}))


def test_labels_and_steps_say_the_printed_name_in_the_asked_units(dress: DraftedGarment):
    whole, half = dress.pieces["38"][0], halved(dress).pieces["38"][0]
    for piece in (whole, half, pattern_from_json(json.loads(json.dumps(pattern_json(dress)))).pieces["38"][0]):
        assert piece.piece.printed_name == "Vorderteil"
        assert piece.label.lines[0][0] == "VORDERTEIL"
        assert any(text.startswith("Includes ") and text.endswith(" in") for text, _ in piece.label.lines)
    steps = " ".join(sewing_steps(dress, "38"))
    assert "Vorderteil" in steps
    assert whole.name not in steps.replace("Vorderteil", "").split(" ")
    assert dress.garment.units == "in"


def test_files_carry_the_printed_name_and_keep_the_key(dress: DraftedGarment, tmp_path: Path):
    write_dxf(dress, tmp_path / "a.dxf")
    document = ezdxf.readfile(tmp_path / "a.dxf")
    texts = {text.dxf.text for text in document.blocks.get("VORDERTEIL_38").query('TEXT[layer=="1"]')}
    assert "PIECE NAME: Vorderteil" in texts
    write_svg(dress, tmp_path / "a.svg")
    drawn = (tmp_path / "a.svg").read_text(encoding="utf-8")
    assert "VORDERTEIL" in drawn
    assert f'data-piece="{dress.pieces["38"][0].name}"' in drawn


def test_lengths_in_three_units_and_a_name_for_no_piece():
    assert [length_words(0.0095, units) for units in ("mm", "cm", "in")] == ["9.5 mm", "0.95 cm", "3/8 in"]
    with pytest.raises(InputError, match=r"names: there is no piece 'frnt'; did you mean 'front'\?"):
        check_names({"frnt": "Vorderteil"}, ["front", "back"])
