"""Every garment of `warpflat new`, as it is sewn: notches meet, each edge is used up once, in an order that can be followed."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import pytest

from warpflat.app.scene.load import make_scene
from warpflat.app.scene.plan import plan_scene
from warpflat.app.scene.wardrobe import garment_offer, offers, scene_text
from warpflat.core.polyline import polyline_length
from warpflat.core.text import other_side
from warpflat.flat.fabric.library import load_library
from warpflat.garment.construction.linings import add_interfacing, add_lining
from warpflat.garment.construction.to_pattern import pattern_of_garment
from warpflat.pattern.drafting.draft import draft_garment
from warpflat.pattern.drafting.drafted import DraftedGarment
from warpflat.pattern.drafting.drawing import draw_piece
from warpflat.pattern.drafting.finished import finished_lengths
from warpflat.pattern.drafting.label import cutting_words
from warpflat.pattern.drafting.pieces import SeamSide
from warpflat.pattern.drafting.sewing_order import notions, sewing_steps, sewn_seams, tools
from warpflat.pattern.drafting.sewing_tasks import techniques
from warpflat.pattern.drafting.words import language_words, printed_in

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
    ("jacket", {"lining": "full"}),
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


def test_every_edge_is_used_up_by_one_step(drafted: DraftedGarment):
    steps = sewing_steps(drafted, "")
    finished = [place for step in steps for place in step.finished]
    assert len(finished) == len(set(finished))
    joined = {(side.piece, side.edge) for seam in drafted.garment.seams for row in seam.sides for side in row}
    assert not joined & set(finished)
    every = {
        (piece.name, edge.name)
        for piece in drafted.pieces[""]
        for edge in piece.edges
        if edge.kind not in ("fold", "dart")
    }
    assert every <= {(piece, edge) for step in steps for piece, edges in step.sewn.items() for edge in edges}
    assert every <= joined | {(piece, other_side(edge)) for piece, edge in joined} | set(finished)
    # Each dart and each seam is sewn once, and what a step takes stands in the list.
    letters = [seam.letter for seam in sewn_seams(drafted, "")]
    words = " ".join(step.words for step in steps)
    assert all(words.count(f" {letter} (") == 1 for letter in letters)
    assert [each for step in steps for each in step.notions] == list(notions(drafted, "")[1:])
    # Nothing is left to the maker, but the lower edge of a hat that is lined.
    assert {step.technique for step in steps} & {"bind_raw", "raw"} <= (
        {"bind_raw"} if drafted.name == "sun_hat" else set()
    )


def test_a_seam_comes_after_those_that_end_on_its_line(drafted: DraftedGarment):
    """Along each side of a seam the ends of its edges that meet have been sewn together before."""
    pieces = {piece.name: [edge.name for edge in piece.edges] for piece in drafted.pieces[""]}

    def corner(side: SeamSide, *, end: bool) -> tuple[str, bool, int, int]:
        at = pieces[side.piece].index(side.edge) + (end != side.reversed)
        return side.piece, side.mirrored, side.copy, at % len(pieces[side.piece])

    number = {}
    for at, step in enumerate(sewing_steps(drafted, "")):
        for seam in drafted.garment.seams:
            places = [(side.piece, side.edge) for row in seam.sides for side in row]
            if seam.name not in number and all(edge in step.sewn.get(piece, ()) for piece, edge in places):
                number[seam.name] = at
    ends = {
        frozenset(corner(row[0 if not end else -1], end=end) for row in seam.sides): seam.name
        for seam in drafted.garment.seams
        for end in (False, True)
    }
    for seam in drafted.garment.seams:
        for row in seam.sides:
            for one, other in pairwise(row):
                crossing = ends.get(frozenset((corner(one, end=True), corner(other, end=False))))
                assert crossing is None or number[crossing] <= number[seam.name], (crossing, seam.name)


def test_facings_that_are_sewn_to_a_lining_are_not_neatened():
    for name, chosen, neatened in (("shift_dress", {}, True), ("jacket", {"lining": "full"}, False)):
        words = [step.words for step in sewing_steps(drafted_garment(name, chosen), "") if step.technique == "facing"]
        assert words
        assert [each.startswith("Neaten the inner edges of the facings. Sew") for each in words] == [neatened] * len(
            words
        )


def test_bands_and_flounces_belong_to_the_finished_length_and_an_overlap_counts_once():
    hoodie = drafted_garment("hoodie", {})
    pieces = {piece.name: piece for piece in hoodie.pieces[""]}
    lengths = finished_lengths(hoodie, "")
    (fold,) = [edge.line for edge in pieces["back"].edges if edge.kind == "fold"] or [
        pieces["back"].internal_lines["centre back"]
    ]
    band = 0.5 * pieces["hip_band"].edge("left end").length
    assert lengths["length at the centre back"] == pytest.approx(polyline_length(fold) + band, abs=1e-3)
    assert lengths["sleeve"] > 0.5
    shirt = drafted_garment("shirt", {})
    assert shirt.garment.worn is not None
    (hip,) = [each for each in shirt.garment.worn.measures[""] if each.name == "hip"]
    assert finished_lengths(shirt, "")["hem at the hip"] == pytest.approx(hip.finished, abs=0.015)


def test_a_shirt_and_trousers_are_as_long_as_their_pieces_say():
    shirt = finished_lengths(drafted_garment("shirt", {}), "")
    assert {"length at the centre back", "sleeve", "hem at the hip"} == set(shirt)
    assert 0.5 < shirt["length at the centre back"] < 0.75
    assert 0.5 < shirt["sleeve"] < 0.7
    assert 1.0 < shirt["hem at the hip"] < 1.15
    trousers = finished_lengths(drafted_garment("trousers", {}), "")
    assert {"outer leg, below the waistband", "inner leg", "hem at the ankle"} == set(trousers)
    assert 0.2 < trousers["outer leg, below the waistband"] - trousers["inner leg"] < 0.4
    assert 0.3 < trousers["hem at the ankle"] < 0.45


def test_a_leotard_has_no_inner_leg_and_pyjamas_no_waistband():
    assert set(finished_lengths(drafted_garment("leotard", {}), "")) == {"side, below the armhole"}
    leggings = finished_lengths(drafted_garment("leggings", {}), "")
    # Without a side seam, from the band down.
    assert 0.15 < leggings["outer leg, below the waistband"] - leggings["inner leg"] < 0.25
    assert {"outer leg", "inner leg"} < set(finished_lengths(drafted_garment("pyjama_trousers", {}), ""))


class Misses(dict[str, str]):
    """Words of a language, with those that were asked for in vain."""

    def __init__(self, words: Mapping[str, str]) -> None:
        super().__init__(words)
        self.missed: set[str] = set()

    def get(self, key: str, default: str = "") -> str:  # type: ignore[override]
        self.missed |= set() if super().__contains__(key) else {key}
        return super().get(key, default)

    def __contains__(self, key: object) -> bool:
        found = super().__contains__(key)
        # A run of words that is not there is tried shorter; one word stays English, and so does a number.
        word = str(key).strip("0123456789.,+()")
        self.missed |= {str(key)} if not found and word and " " not in word else set()
        return found


def test_every_printed_word_is_german(drafted: DraftedGarment):
    words = Misses(language_words("de"))
    garment = replace(drafted, garment=replace(drafted.garment, words=words))
    with printed_in(words):
        sewing_steps(garment, "")
        notions(garment, "")
        tools(garment, "")
        finished_lengths(garment, "")
        for piece in garment.pieces[""]:
            draw_piece(piece)
            cutting_words(piece.piece)
    assert words.missed - {""} == set()


def test_the_cloths_of_a_shop_have_german_words():
    german = language_words("de")
    examples = {each for fabric in load_library().values() for each in fabric.examples}
    assert {each for each in examples if each not in german} == set()


def test_every_technique_has_a_drawing_and_german_words():
    german = language_words("de")
    for name, technique in techniques().items():
        assert technique["text"] in german, name
        strokes = [stroke.split(" ") for stroke in technique["drawing"]]
        assert strokes, name
        for style, *numbers in strokes:
            assert style in ("cloth", "other", "fold", "stitch"), name
            assert len(numbers) >= 4, name
            assert len(numbers) % 2 == 0, name
            assert all(0 <= float(x) <= 48 for x in numbers[::2]), name
            assert all(0 <= float(y) <= 30 for y in numbers[1::2]), name
