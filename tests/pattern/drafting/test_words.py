"""Printed words in other languages."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest
import shapely
from sample_dress import sample_dress

from warpflat.pattern.drafting.draft import draft_garment
from warpflat.pattern.drafting.placement import fit_label
from warpflat.pattern.drafting.words import language_words, printed_in, translate, translate_name
from warpflat.pattern.export.pattern_json import pattern_from_json, pattern_json
from warpflat.pattern.export.pdf import write_pdf


def test_longest_run_of_a_name_is_replaced():
    assert translate_name("front_neck_facing") == "front_neck_facing"
    with printed_in(language_words("de")):
        assert translate_name("front_armhole_facing") == "Vorderteil Armlochbeleg"
        assert translate_name("side left") == "Seite links"
        assert translate_name("never heard") == "never heard"
    assert translate("Cut {count}", count=2) == "Cut 2"


def test_every_phrase_has_the_places_of_the_english_one():
    for phrase, german in language_words("de").items():
        assert sorted(re.findall(r"{\w+}", phrase)) == sorted(re.findall(r"{\w+}", german)), phrase


def test_wrong_places_leave_the_english_phrase():
    with printed_in({"Cut {count}": "{number}x"}):
        assert translate("Cut {count}", count=2) == "Cut 2"


@pytest.mark.parametrize(("language", "size"), [("en", "Size EU 38"), ("de", "Größe EU 38")])
def test_the_size_stays_in_one_row_of_a_narrow_label(language, size):
    """A nest replaces the row by all sizes: it finds it as a whole only."""
    with printed_in(language_words(language)):
        label = fit_label(shapely.box(0.0, 0.0, 0.025, 0.025), [("FRONT", 0.007), (size, 0.0045)])
        other = fit_label(shapely.box(0.0, 0.0, 0.025, 0.025), [("FRONT", 0.007), ("Cut EU 38", 0.0045)])
    assert label is not None
    assert other is not None
    assert size in [row for row, _, _ in label.rows]
    assert "Cut EU 38" not in [row for row, _, _ in other.rows]


def test_pages_and_labels_are_german_and_so_are_those_of_a_file_read_back(tmp_path):
    pypdf = pytest.importorskip("pypdf")
    drafted = draft_garment(replace(sample_dress(("38",)), words=language_words("de")))
    read = pattern_from_json(pattern_json(drafted))
    for number, garment in enumerate((drafted, read)):
        write_pdf(garment, tmp_path / f"{number}.pdf")
        text = "\n".join(page.extract_text() for page in pypdf.PdfReader(tmp_path / f"{number}.pdf").pages)
        for words in (
            "Größe 38",
            "im Stoffbruch",
            "Nähreihenfolge",
            "Zusammennähen, solange alles flach liegt",
            "IM STOFFBRUCH",
            "Blatt A1",
        ):
            assert words in text, words
        for words in ("Cut ", "Sew ", "Sewing", "Size ", "on fold", "notch to notch"):
            assert words not in text, words
