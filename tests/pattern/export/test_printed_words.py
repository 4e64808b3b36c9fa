"""Printed names of pieces and units of printed lengths: in labels, steps, DXF, SVG and back from pattern.json."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import ezdxf
import numpy as np
import pytest
from polygons import corners_of, drafted, polygon
from pypdf import PdfReader
from sample_dress import sample_dress

from warpflat.core.errors import InputError
from warpflat.pattern.drafting.draft import draft_garment
from warpflat.pattern.drafting.drafted import DraftedGarment
from warpflat.pattern.drafting.drawing import draw_piece
from warpflat.pattern.drafting.half_pieces import halved
from warpflat.pattern.drafting.measures import length_words, name_in_units
from warpflat.pattern.drafting.piece_parts import Dart, Edge
from warpflat.pattern.drafting.pieces import Pattern, Piece
from warpflat.pattern.drafting.sewing_order import sewing_steps
from warpflat.pattern.drafting.words import language_words
from warpflat.pattern.drafting.worn import Measure, NeededOpening, ViewedPiece, Worn
from warpflat.pattern.export.dxf import write_dxf
from warpflat.pattern.export.pattern_files import check_names
from warpflat.pattern.export.pattern_json import pattern_from_json, pattern_json, write_pattern_json
from warpflat.pattern.export.pdf import write_pdf
from warpflat.pattern.export.read_pattern import read_drafted
from warpflat.pattern.export.svg import write_svg


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
    steps = " ".join(step.words for step in sewing_steps(dress, "38"))
    assert "Vorderteil" in steps
    assert whole.name not in steps.replace("Vorderteil", "").split(" ")
    assert dress.pattern.units == "in"


def test_files_carry_the_printed_name_and_keep_the_key(dress: DraftedGarment, tmp_path: Path):
    write_dxf(dress, tmp_path / "a.dxf")
    document = ezdxf.readfile(tmp_path / "a.dxf")
    texts = {text.dxf.text for text in document.blocks.get("VORDERTEIL_38").query('TEXT[layer=="1"]')}
    assert "PIECE NAME: Vorderteil" in texts
    write_svg(dress, tmp_path / "a.svg")
    drawn = (tmp_path / "a.svg").read_text(encoding="utf-8")
    assert "VORDERTEIL" in drawn
    assert f'data-piece="{dress.pieces["38"][0].name}"' in drawn


def test_steps_in_inches_say_no_centimetres():
    (step,) = sewing_steps(drafted(polygon("square", corners_of(0.2, 0.3), units="in")), "")
    assert "strips cut on the bias, 1 3/8 in wide" in step.words
    assert " cm" not in step.words


def test_lengths_in_three_units_and_a_name_for_no_piece():
    assert [length_words(0.0095, units) for units in ("mm", "cm", "in")] == ["9.5 mm", "0.95 cm", "3/8 in"]
    # A tape has sixteenths; a short length, such as an allowance, is not rounded to them.
    assert [length_words(length, "in") for length in (0.7201, 0.025, 0.01)] == ["28 3/8 in", "1 in", "0.39 in"]
    with pytest.raises(InputError, match=r"names: there is no piece 'frnt'; did you mean 'front'\?"):
        check_names({"frnt": "Vorderteil"}, ["front", "back"])


def test_first_pages_tell_measures_needed_openings_and_what_is_needed(tmp_path: Path):
    square = np.array([[0.0, 0.0], [0.4, 0.0], [0.4, 0.9], [0.0, 0.9]])
    seen = (ViewedPiece(outlines=(square,), lines=(square[:2],)),)
    worn = Worn(
        views={"front": seen, "back": seen},
        measures={
            "38": (Measure(name="bust", body=0.88, finished=0.93), Measure(name="waist", body=0.72, finished=0.7))
        },
        needed=(NeededOpening(ring="neck", length=0.37, over="head", girth=0.569, depth=0.1),),
        knits=("interlock",),
    )
    told = draft_garment(replace(sample_dress(), worn=worn))
    read = pattern_from_json(pattern_json(told))
    for paper in ("A4", "A0", "Projector"):
        for number, garment in enumerate((told, read)):
            write_pdf(garment, tmp_path / f"{number}.pdf", paper=paper)
        same = (tmp_path / "0.pdf").read_bytes() == (tmp_path / "1.pdf").read_bytes()
        assert same, "and so are those of a file read back"
        pages = PdfReader(tmp_path / "0.pdf").pages
        texts = [page.extract_text() for page in pages]
        first = texts[0] if paper != "A4" else texts[1]
        for words in (
            "from the front",
            "93 cm",
            "+5 cm",
            "-2 cm",
            "sewing thread",
            "needle and stitch for knits",
            "Cloth needed",
            "56.9 cm must pass (head)",
        ):
            assert words in first, (paper, words)
        assert any("Sewing order" in text for text in texts)
        if paper != "A4":
            assert [round(float(pages[0].mediabox.width) / 72 * 25.4), len(pages[0].extract_text()) > 200] == [
                210,
                True,
            ]


@pytest.mark.parametrize("name", ["knee", "facing knee"])
@pytest.mark.parametrize("kind", ["hem", "cut"])
def test_a_lower_edge_is_printed_as_hem_turned_up_or_raw(name: str, kind: str):
    corners = np.array([[0.0, 0.0], [0.3, 0.0], [0.3, 0.5], [0.0, 0.5]])
    names = (name, "side right", "neck", "side left")
    edges = [
        Edge(name=each, points=corners[[k, (k + 1) % 4]], kind=kind if each == name else "cut")
        for k, each in enumerate(names)
    ]
    (piece,) = draft_garment(Pattern(name="stand", pieces={"": [Piece(name="facing", edges=edges)]})).pieces[""]
    printed = {words.text for words in draw_piece(piece).words}
    assert {"hem", "neck"} <= printed
    assert name not in printed


def test_a_nest_says_the_measures_of_every_size(tmp_path: Path):
    made = sample_dress()
    (sample,) = made.pieces
    sizes = [sample, "40", "42", "44", "46", "48"]
    measures = {
        size: (Measure(name="bust", body=0.88 + 0.04 * k, finished=0.93 + 0.04 * k),) for k, size in enumerate(sizes)
    }
    pieces = {size: [replace(piece, size=size) for piece in made.pieces[sample]] for size in sizes}
    nest = replace(made, pieces=pieces, worn=Worn(views={}, measures=measures, needed=()))
    write_pdf(draft_garment(nest), tmp_path / "nest.pdf", paper="A0")
    said = " ".join(page.extract_text() for page in PdfReader(tmp_path / "nest.pdf").pages)
    assert "Choose your size" in said
    for k in range(len(sizes)):
        assert f"{88 + 4 * k} cm / {93 + 4 * k} cm" in said
    one = replace(made, worn=Worn(views={}, measures={sample: measures[sample]}, needed=()))
    write_pdf(draft_garment(one), tmp_path / "one.pdf", paper="A0")
    assert all("Choose your size" not in page.extract_text() for page in PdfReader(tmp_path / "one.pdf").pages)


def test_a_length_in_a_name_has_the_units_of_the_pattern():
    assert [name_in_units("invisible zip 200 mm", units) for units in ("mm", "cm", "in")] == [
        "invisible zip 200 mm",
        "invisible zip 20 cm",
        "invisible zip 7 7/8 in",
    ]
    assert name_in_units("hem 2", "cm") == "hem 2"
    assert name_in_units("zip 12.5 mm", "in") == "zip 1/2 in"


def test_a_pattern_in_other_units_keeps_its_language(tmp_path: Path):
    german = replace(sample_dress(("38",)), words=language_words("de"))
    write_pattern_json(draft_garment(german), tmp_path / "pattern.json")
    (piece, *_) = read_drafted(tmp_path / "pattern.json", units="in").pieces["38"]
    said = [text for text, _ in piece.label.lines]
    assert any("zuschneiden" in text for text in said), said


def test_what_is_cut_from_a_cloth_is_told_with_all_mirrored_copies(tmp_path: Path):
    cuff = polygon(
        "cuff", [(0.0, 0.0), (0.2, 0.0), (0.3, 0.1)], fabric="wool", quantity=4, also={"fusible": 2, "wool": 2}
    )
    assert cuff.cloths == {"wool": 6, "fusible": 2}
    # Also on its label, and in a file for other programs.
    label = [text for text, _ in drafted(cuff).pieces[""][0].label.lines]
    assert label[1:3] == ["Cut 6, 3 mirrored - wool", "Cut 2, 1 mirrored - fusible"]
    write_dxf(drafted(cuff), tmp_path / "p.dxf")
    written = (tmp_path / "p.dxf").read_text()
    assert "QUANTITY: 6\n" in written
    assert all(f"ANNOTATION: {row}\n" in written for row in label[1:3])
    write_pdf(drafted(cuff), tmp_path / "p.pdf")
    said = " ".join(page.extract_text() for page in PdfReader(tmp_path / "p.pdf").pages)
    assert "cuff 6, 3 mirrored" in said
    assert "cuff 2, 1 mirrored" in said


def test_label_and_page_tell_the_same_allowances(tmp_path: Path):
    """A dart that is cut away has an allowance along its legs; an edge without one is not told."""
    corners = [(0, 0), (0.1, 0), (0.15, 0.1), (0.2, 0), (0.3, 0), (0.3, 0.3), (0, 0.3)]
    garment = drafted(
        polygon(
            "bodice",
            corners,
            kinds=("hem", "dart", "dart", "hem", "seam", "seam", "seam"),
            widths=(0.03, 0.008, 0.008, 0.03, 0.01, 0.0, 0.01),
            darts=[Dart(name="d", left="e1", right="e2", cut=True)],
        )
    )
    assert "Includes seam 0.8/1 cm, hem 3 cm" in [text for text, _ in garment.pieces[""][0].label.lines]
    write_pdf(garment, tmp_path / "p.pdf")
    said = " ".join(page.extract_text() for page in PdfReader(tmp_path / "p.pdf").pages)
    assert "Allowances are included: seams 0.8 cm and 1 cm, hems 3 cm." in said


def test_lines_of_another_program_are_given_no_finish(tmp_path: Path):
    """What is to become of an edge, its file does not say."""
    shapes = "".join(
        f'<rect id="{name}" x="{x}" width="250" height="350"/>' for name, x in (("front", 0), ("back", 280))
    )
    drawing = (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="600mm" height="400mm" viewBox="0 0 600 400">{shapes}</svg>'
    )
    (tmp_path / "foreign.svg").write_text(drawing)
    garment = read_drafted(tmp_path / "foreign.svg")
    assert sewing_steps(garment, "") == ()
    write_pdf(garment, tmp_path / "p.pdf")
    said = " ".join(page.extract_text() for page in PdfReader(tmp_path / "p.pdf").pages)
    assert "No allowances are included. Lay every grain" in said
    assert "Sewing order" not in said
