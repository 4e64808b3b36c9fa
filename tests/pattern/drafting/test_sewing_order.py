"""Steps of making a garment, the seams in their order, and what is needed beside the cloth."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from polygons import corners_of, polygon, sewn

from warpflat.core.errors import InputError
from warpflat.garment.construction.details import FinishingTable
from warpflat.garment.construction.finishing import finish_edges
from warpflat.garment.construction.linings import add_interfacing, add_lining
from warpflat.pattern.drafting.draft import draft_garment
from warpflat.pattern.drafting.piece_parts import Edge
from warpflat.pattern.drafting.pieces import Elastic, Pattern, Piece, Seam, SeamOpening, SeamSide
from warpflat.pattern.drafting.seam_words import joint_words
from warpflat.pattern.drafting.sewing_order import notions, seam_letters, sewing_steps, sewn_seams
from warpflat.pattern.drafting.words import language_words, printed_in
from warpflat.pattern.export.pattern_json import pattern_from_json, pattern_json


def top(*openings: SeamOpening) -> Pattern:
    """A front and the two halves of a back, with a neck, and armholes 20 cm long above the side seams."""
    neck = np.array([[0.1, 0.5], [0.05, 0.46], [0.0, 0.45], [-0.05, 0.46], [-0.1, 0.5]])
    right = {
        "hem": [[0.0, 0.0], [0.2, 0.0]],
        "side right": [[0.2, 0.0], [0.2, 0.3]],
        "armhole right": [[0.2, 0.3], [0.2, 0.5]],
        "shoulder right": [[0.2, 0.5], [0.1, 0.5]],
    }
    half = {**right, "neck right": neck[:3], "centre back": [[0.0, 0.45], [0.0, 0.0]]}
    mirrored = {
        name.replace("right", "left"): np.array(points)[::-1] * [-1.0, 1.0] for name, points in reversed(half.items())
    }
    front = {
        "hem": [[-0.2, 0.0], [0.2, 0.0]],
        **{k: v for k, v in right.items() if k != "hem"},
        "neck": neck,
        **{k: v for k, v in mirrored.items() if k.split(" ")[0] in ("side", "armhole", "shoulder")},
    }

    def piece(name: str, lines: dict[str, Sequence[Sequence[float]]]) -> Piece:
        edges = [Edge(name=k, points=np.array(v), kind="hem" if k == "hem" else "seam") for k, v in lines.items()]
        first = next(i for i, edge in enumerate(edges) if edge.name == "hem")
        return Piece(name=name, fabric="wool", edges=[*edges[first:], *edges[:first]])

    pieces = [piece("front", front), piece("back_right", half), piece("back_left", mirrored)]
    seams = [
        Seam(
            name=f"{name} {side}",
            sides=((SeamSide(piece="front", edge=f"{name} {side}"),), (SeamSide(piece=f"back_{side}", edge=f"{name} {side}"),)),
        )
        for name in ("side", "shoulder")
        for side in ("left", "right")
    ]  # fmt: skip
    back = (
        (SeamSide(piece="back_right", edge="centre back"),),
        (SeamSide(piece="back_left", edge="centre back", reversed=True),),
    )
    centre = Seam(name="centre back", sides=back, openings=openings)
    return Pattern(name="top", pieces={"": pieces}, seams=[*seams, centre])


ZIP = SeamOpening(kind="zip", length=0.3, style="invisible")


def test_zip_is_sewn_in_first_and_everything_inside_ends_at_it():
    facing, binding = (
        FinishingTable(kind="facing", edge="neck", width_mm=50),
        FinishingTable(kind="binding", edge="armhole", width_mm=35),
    )
    pattern = finish_edges(top(ZIP), [facing, binding], gaps=["centre back"])
    drafted = draft_garment(add_lining(add_interfacing(pattern, "interfacing"), "lining"))
    steps = [step.words for step in sewing_steps(drafted, "")]
    places = {
        name: next(i for i, step in enumerate(steps) if text in step)
        for name, text in {
            "fuse": "Fuse the interfacing: front neck facing",
            "zip": "Sew the invisible zip of 30 cm to both edges of A (centre back: back right to back left), from the upper edge",
            "shoulders": "Sew while it lies flat, notch to notch: B (shoulder: front to back left)",
            "sides": "Close, right sides together, notch to notch: C (side: front to back left)",
            "facings": "Sew the facings to their edges",
            "linings": "(centre back of the lining: back right lining to back left lining, open beside the zip)",
            "at the zip": "At the zip, turn in the edges and sew them to its tape by hand: back right neck right facing",
            "baste": "Baste the lining to the shell, wrong sides together: armhole (front lining",
            "ends": "Join the ends of bands and bindings",
            "bind": "Sew the bindings on, right sides together, notch to notch",
            "hems": "Turn up and sew the hems: 3 cm (front, back right, back left)",
        }.items()
    }
    assert list(places.values()) == sorted(places.values())
    assert "Then close the seam below it" in steps[places["zip"]]
    # Nothing is finished twice, and no armhole is left raw.
    assert not any("raw edges with strips" in step for step in steps)
    assert notions(sewing_steps(drafted, "")) == ("sewing thread", "1 invisible zip of 30 cm")
    # The letters follow the steps.
    assert seam_letters(drafted)["centre back"] == "A"
    # Each step knows what it sews, in whatever words.
    sewn = [step.sewn for step in sewing_steps(drafted, "")]
    assert sewn[places["zip"]] == {"back_right": {"centre back"}, "back_left": {"centre back"}}
    assert sewn[places["baste"]] == {
        "front_lining": {"armhole right", "armhole left"},
        "back_right_lining": {"armhole right"},
        "back_left_lining": {"armhole left"},
    }
    assert sewn[places["hems"]]["front"] == {"hem"}
    # A pattern that was written and read again is sewn alike.
    again = pattern_from_json(json.loads(json.dumps(pattern_json(drafted))))
    assert sewing_steps(again, "") == sewing_steps(drafted, "")
    with printed_in(language_words("de")):
        german_steps = sewing_steps(drafted, "")
    german = " ".join(step.words for step in german_steps)
    assert [step.sewn for step in german_steps] == sewn
    assert "Reißverschluss, 30 cm, an beide Kanten von A (hintere Mitte" in german
    assert "Säume umschlagen und nähen: 3 cm (Vorderteil" in german


def test_a_zip_in_one_side_alone_is_one_zip():
    pattern = top()
    seams = [replace(seam, openings=(ZIP,)) if seam.name == "side left" else seam for seam in pattern.seams]
    drafted = draft_garment(replace(pattern, seams=seams))
    assert notions(sewing_steps(drafted, "")) == ("sewing thread", "1 invisible zip of 30 cm")
    steps = [step.words for step in sewing_steps(drafted, "")]
    (zip_in,) = [step for step in steps if "zip" in step]
    assert "(side left: front to back left)" in zip_in
    assert any("side right: front to back right" in step for step in steps)


@pytest.mark.parametrize(
    ("opening", "expected"),
    [
        (SeamOpening(kind="vent", length=0.1), "Turn in the long edges of the vent of 10 cm below C"),
        (SeamOpening(kind="slit", length=0.1), "Turn in the edges of the slit of 10 cm below C"),
        (SeamOpening(kind="buttons", length=0.2), "Close A (centre back: back right to back left) below the buttons"),
        (
            SeamOpening(kind="zip", length=0.2, begin=0.045, style="lapped"),
            "Sew the lapped zip of 20 cm to both edges of A (centre back: back right to back left), from 4.5 cm below the upper edge",
        ),
        (SeamOpening(kind="zip", length=0.45, whole=True, style="lapped"), "all along: "),
    ],
)
def test_every_opening_has_a_step(opening: SeamOpening, expected: str):
    steps = [step.words for step in sewing_steps(draft_garment(top(opening)), "")]
    assert any(expected in step for step in steps)


def test_a_zip_above_a_vent_is_closed_down_to_the_vent():
    steps = [step.words for step in sewing_steps(draft_garment(top(ZIP, SeamOpening(kind="vent", length=0.1))), "")]
    assert "Then close the seam below it, down to the vent." in steps[0]
    assert steps[1].startswith("Turn in the long edges of the vent of 10 cm")
    with pytest.raises(InputError, match=r"unknown kind of opening 'zipp'; did you mean 'zip'\?"):
        SeamOpening(kind="zipp", length=0.1)


def test_a_zip_through_two_seams_is_one_zip():
    """Of a bodice and a skirt; one of its length elsewhere, that begins above a band, is another one."""
    names = ("hem", "centre back", "top", "side")
    halves = [
        polygon(f"{part}_{half}", corners_of(0.2, 0.3), names=names if half == "left" else ("hem", "side", "top", "centre back"))
        for part in ("bodice", "skirt")
        for half in ("left", "right")
    ]  # fmt: skip
    upper = SeamOpening(kind="zip", length=0.4, whole=True, style="invisible")
    openings = {"bodice": upper, "skirt": replace(upper, begin=-0.3, whole=False)}
    seams = [
        sewn(f"{part}_left.centre back", f"{part}_right.centre back", openings=(opening,))
        for part, opening in openings.items()
    ]
    waists = [sewn(f"bodice_{half}.hem", f"skirt_{half}.top") for half in ("left", "right")]
    steps = sewing_steps(draft_garment(Pattern(name="t", pieces={"": halves}, seams=[*seams, *waists])), "")
    assert notions(steps) == ("sewing thread", "1 invisible zip of 40 cm")
    first, second = [step.words for step in steps if "Sew the invisible zip" in step.words]
    assert "all along" in first
    assert "on from the seam above" not in first
    assert "on from the seam above, down to the end of its line" in second
    alone = [replace(seam, openings=(replace(seam.openings[0], begin=-0.05, whole=False),)) for seam in seams[:1]]
    steps = sewing_steps(draft_garment(Pattern(name="t", pieces={"": halves}, seams=[*alone, *waists])), "")
    assert notions(steps) == ("sewing thread", "1 invisible zip of 40 cm")


def test_mirror_images_are_one_seam_whatever_the_numbers_of_their_edges():
    """A dart at the shoulder parts it; the facing of the neck lies along what is the second part on the left alone."""
    corners, names = corners_of(0.2, 0.05), ("neck", "shoulder right", "inner edge", "shoulder left 2")
    front = polygon("front_facing", corners, names=names, role="facing")
    back = polygon(
        "back_facing", corners, names=("neck", "centre", "inner edge", "shoulder left"), role="facing", quantity=2
    )
    left = sewn("front_facing.shoulder left 2", "back_facing.shoulder left", "shoulder left of neck facing")
    right = sewn("front_facing.shoulder right", "back_facing.shoulder left", "shoulder right of neck facing")
    right = replace(right, sides=(right.sides[0], (replace(right.sides[1][0], mirrored=True),)))
    garment = draft_garment(Pattern(name="p", pieces={"": [front, back]}, seams=[left, right]))
    assert [(seam.count, seam.letter) for seam in sewn_seams(sewing_steps(garment, ""))] == [(2, "A")]


def test_a_seam_with_the_copy_of_another_pair_is_sewn_on_both_sides():
    """A hip pocket's bag lies behind its front, turned over; the crotch joins both fronts."""
    front = polygon("front", corners_of(0.2, 0.3), quantity=2)
    bag = polygon("front_pocket_bag", corners_of(0.2, 0.3), quantity=2, role="pocket")
    seams = [sewn("front.e0", "front_pocket_bag.e0", "pocket opening"), sewn("front.e1", "front.e1", "crotch front")]
    seams = [replace(seam, sides=(seam.sides[0], (replace(seam.sides[1][0], mirrored=True),))) for seam in seams]
    garment = draft_garment(Pattern(name="p", pieces={"": [front, bag]}, seams=seams))
    assert {seam.name: seam.count for seam in sewn_seams(sewing_steps(garment, ""))} == {
        "pocket opening": 2,
        "crotch front": 1,
    }


def test_a_band_that_is_shorter_than_its_edge_is_stretched():
    band = FinishingTable(kind="band", edge="neck", width_mm=20, share=0.85)
    (step,) = [
        step.words
        for step in sewing_steps(draft_garment(finish_edges(top(), [band])), "")
        if "bands" in step.words and "edges" in step.words
    ]
    assert "stretch the neck band)" in step


def test_nothing_ends_at_a_zip_that_is_not_there():
    facing = FinishingTable(kind="facing", edge="neck", width_mm=50)
    pattern = finish_edges(top(SeamOpening(kind="buttons", length=0.2)), [facing], gaps=["centre back"])
    assert not any("zip" in step.words for step in sewing_steps(draft_garment(pattern), ""))


@pytest.mark.parametrize(
    ("openings", "expected"),
    [
        ((), ["Sew while it lies flat, notch to notch: A (side: front to back)."]),
        (
            (ZIP,),
            [
                "Sew the invisible zip of 30 cm to both edges of A (side left: front to back), from the upper edge down to the end "
                "of its line: lay its teeth open on the sewing lines, right sides together, and sew close beside them. Then close the "
                "seam below it.",
                "Close, right sides together, notch to notch: A (side right: front to back).",
            ],
        ),
    ],
)
def test_of_halves_on_the_fold_both_sides_are_sewn(openings: tuple[SeamOpening, ...], expected: list[str]):
    corners = np.array([[0.0, 0.0], [0.2, 0.0], [0.2, 0.5], [0.0, 0.5], [0.0, 0.0]])
    kinds = {"hem": "hem", "side left": "seam", "waist": "cut", "centre": "fold"}

    def half(name: str) -> Piece:
        edges = [Edge(name=edge, points=corners[k : k + 2], kind=kind) for k, (edge, kind) in enumerate(kinds.items())]
        return Piece(name=name, edges=edges)

    sides = tuple((SeamSide(piece=name, edge="side left"),) for name in ("front", "back"))
    seam = Seam(name="side left", sides=(sides[0], sides[1]), openings=openings)
    drafted = draft_garment(Pattern(name="skirt", pieces={"": [half("front"), half("back")]}, seams=[seam]))
    assert [step.words for step in sewing_steps(drafted, "")][: len(expected)] == expected
    # In the table of seams both sides have their length.
    assert {seam.length_mm for seam in sewn_seams(sewing_steps(drafted, ""))} == {(500.0, 500.0)}


def test_pocket_and_straps_that_no_seam_takes_are_sewn_on():
    """As an apron's: nothing of them is left to be bound, and the pocket is hemmed once."""

    def strip(name: str, width: float, kinds: Sequence[str]) -> Piece:
        corners = np.array([[0.0, 0.0], [width, 0.0], [width, 0.2], [0.0, 0.2], [0.0, 0.0]])
        names = ("bottom", "right", "top", "left")
        edges = [Edge(name=n, points=corners[k : k + 2], kind=kinds[k]) for k, n in enumerate(names)]
        return Piece(name=name, edges=edges)

    pieces = (
        strip("panel", 0.5, ["hem"] * 4),
        strip("pocket", 0.2, ["seam", "seam", "hem", "seam"]),
        strip("tie", 0.1, ["cut"] * 4),
    )
    steps = [step.words for step in sewing_steps(draft_garment(Pattern(name="apron", pieces={"": pieces})), "")]
    assert [step.partition(":")[0].partition(",")[0] for step in steps] == [
        "Hem the upper edges of the patch pockets",
        "Press the long edges of the straps to their middle",
        "Turn up and sew the hems",
    ]
    assert [step.rpartition(": ")[2] for step in steps[:2]] == ["pocket.", "tie."]
    assert "pocket" not in steps[2]


def test_a_waistband_above_a_zip_has_a_hook():
    band = FinishingTable(kind="waistband", edge="neck", width_mm=30)
    zipped = draft_garment(finish_edges(top(ZIP), [band], gaps=["centre back"]))
    assert "1 hook and bar" in notions(sewing_steps(zipped, ""))
    assert "1 hook and bar" not in notions(sewing_steps(draft_garment(finish_edges(top(), [band])), ""))


@pytest.mark.parametrize(
    ("kind", "more", "expected"),
    [
        (
            "band",
            {"share": 0.85},
            "Fold the bands lengthwise, wrong sides together, and sew both their edges on, notch to notch",
        ),
        ("binding", {}, "Sew the bindings on, right sides together, notch to notch: "),
        ("ruffle", {"share": 1.5}, "Sew the ruffles on, right sides together, notch to notch: "),
    ],
)
def test_each_strip_is_sewn_on_as_its_kind_is(kind: str, more: dict[str, float], expected: str):
    finishing = FinishingTable(kind=kind, edge="neck", width_mm=30, **more)
    drafted = draft_garment(finish_edges(top(), [finishing]))
    steps = [step.words for step in sewing_steps(drafted, "")]
    assert sum(step.startswith(expected) for step in steps) == 1
    with printed_in(language_words("de")):
        assert not any(expected in step.words for step in sewing_steps(drafted, ""))


def test_a_waistband_has_ends_only_above_an_opening():
    band = FinishingTable(kind="waistband", edge="neck", width_mm=30)
    for openings, gaps, ends in (((ZIP,), ["centre back"], True), ((), [], False)):
        steps = sewing_steps(draft_garment(finish_edges(top(*openings), [band], gaps=gaps)), "")
        (step,) = [step.words for step in steps if step.words.startswith("Sew the waistband on, ")]
        assert ("sew its ends" in step) == ends


def test_a_lining_is_sewn_to_its_vent():
    pattern = top()
    pieces = [
        replace(
            piece,
            edges=[
                replace(e, name=f"{e.name} vent", kind="hem") if e.name == "centre back" else e for e in piece.edges
            ],
        )
        for piece in pattern.pieces[""]
    ]
    seams = [seam for seam in pattern.seams if seam.name != "centre back"]
    drafted = draft_garment(add_lining(replace(pattern, pieces={"": pieces}, seams=seams), "lining"))
    (step,) = [step for step in sewing_steps(drafted, "") if step.words.startswith("At the vent, ")]
    assert step.sewn == {f"back_{side}_lining": frozenset({"centre back vent"}) for side in ("right", "left")}


def test_ring_is_sewn_after_the_seams_that_it_crosses():
    # A hat: two sides of 30 by 10 cm, a round crown, and a brim in two halves below the sides.
    angles = np.linspace(0.0, np.pi, 33)
    half = 0.3 / np.pi * np.column_stack([np.cos(angles), np.sin(angles)])
    crown = Piece(name="crown", edges=[Edge(name="front", points=half), Edge(name="back", points=-half)])
    box = {
        "bottom": [[0.0, 0.0], [0.3, 0.0]],
        "right": [[0.3, 0.0], [0.3, 0.1]],
        "top": [[0.3, 0.1], [0.0, 0.1]],
        "left": [[0.0, 0.1], [0.0, 0.0]],
    }
    others = [
        Piece(
            name=name,
            edges=[
                Edge(name=edge, points=np.array(points), kind="hem" if "brim" in name and edge == "bottom" else "seam")
                for edge, points in box.items()
            ],
        )
        for name in ("side_1", "side_2", "brim_1", "brim_2")
    ]

    def seam(one: str, other: str) -> Seam:
        first, second = (SeamSide(piece=each.split(".")[0], edge=each.split(".")[1]) for each in (one, other))
        made = Seam(name=f"{one} {other}", sides=((first,), (replace(second, reversed=True),)))
        return replace(made, name=f"{joint_words(made)}{' 2' if '2' in one else ''}")

    pairs = [
        ("crown.front", "side_1.top"), ("side_2.top", "crown.back"), ("side_1.bottom", "brim_1.top"),
        ("side_2.bottom", "brim_2.top"), ("side_1.right", "side_2.left"), ("side_2.right", "side_1.left"),
        ("brim_1.right", "brim_2.left"), ("brim_2.right", "brim_1.left"),
    ]  # fmt: skip
    drafted = draft_garment(Pattern(name="hat", pieces={"": [crown, *others]}, seams=[seam(*pair) for pair in pairs]))
    steps = [step.words for step in sewing_steps(drafted, "")]
    # What lies flat first: the brim to the sides, then the ring that all of it is, and the crown around.
    assert [step.partition(",")[0] for step in steps[:3]] == [
        "Join the panels",
        "Close",
        "Sew around",
    ]
    assert all(
        words in steps[0] for words in ("side 1 to side 2", "brim 1 to brim 2", "side 1 to brim 1", "side 2 to brim 2")
    )
    assert all(words in steps[1] for words in ("side 2 to side 1", "brim 2 to brim 1"))
    assert all(words in steps[2] for words in ("crown to side 1", "side 2 to crown"))
    assert "brim" not in steps[2]
    # They are called by their pieces once.
    assert "crown to side: " not in " ".join(steps)


def test_both_side_seams_close_a_skirt_and_both_shoulders_do_not_close_a_top():
    box = [(0.0, 0.0), (0.5, 0.0), (0.5, 0.6), (0.0, 0.6)]
    names, kinds = ("hem", "side right", "waist", "side left"), ("hem", "seam", "seam", "seam")
    pieces = [polygon(name, box, names=names, kinds=kinds) for name in ("front", "back")]
    seams = [sewn(f"front.side {side}", f"back.side {side}", f"side {side}") for side in ("left", "right")]
    words = [
        step.words for step in sewing_steps(draft_garment(Pattern(name="p", pieces={"": pieces}, seams=seams)), "")
    ]
    assert words[0].startswith("Close, right sides together, notch to notch: A (side: front to back)")
    pattern = top()
    steps = [step.words for step in sewing_steps(draft_garment(pattern), "")]
    assert any("while it lies flat" in step and "(shoulder: " in step for step in steps)


def test_what_is_cut_twice_is_sewn_twice_and_once_where_both_seams_are_named():
    pattern = top()
    front, _, back = pattern.pieces[""]
    binding = polygon(
        "binding", [(0.0, 0.0), (0.4, 0.0), (0.4, 0.03), (0.0, 0.03)], names=("lower", "r", "upper", "l"), quantity=2,
        role="strip", paired=False,
    )  # fmt: skip
    seams = [seam for seam in pattern.seams if seam.name.endswith(" left")]
    seams += [
        sewn("binding.lower", "front.armhole left + back_left.armhole left", "binding"),
        sewn("binding.r", "binding.l", "ends"),
    ]
    made = replace(pattern, pieces={"": [front, replace(back, quantity=2), binding]}, seams=seams)
    assert {seam.name: seam.count for seam in sewn_seams(sewing_steps(draft_garment(made), ""))}.items() >= {
        "ends": 2,
        "binding": 2,
    }.items()
    # A shirt's two sleeves are one piece that is cut twice; its seams are called by the pieces that they join.
    box = [(0.0, 0.0), (0.3, 0.0), (0.3, 0.4), (0.0, 0.4)]
    sleeve = polygon("left_sleeve", box, names=("hem", "seam", "top", "seam 2"), quantity=2)
    body = polygon("body", box, names=("hem", "to left_sleeve", "neck", "to right_sleeve"))

    def joined(name: str, edge: str, other: str, *mirrored: bool) -> Seam:
        first, second = (
            SeamSide(piece=text.split(".")[0], edge=text.split(".")[1], mirrored=turned, reversed=k == 1)
            for k, (text, turned) in enumerate(zip((edge, other), mirrored, strict=True))
        )
        return Seam(name=name, sides=((first,), (second,)))

    around = [
        joined("seam of the left sleeve", "left_sleeve.seam", "left_sleeve.seam 2", False, False),
        joined("seam of the left sleeve 2", "left_sleeve.seam 2", "left_sleeve.seam", True, True),
        joined("body to left sleeve", "body.to left_sleeve", "left_sleeve.top", False, False),
        joined("body to left sleeve 2", "body.to right_sleeve", "left_sleeve.top", False, True),
    ]
    made = Pattern(name="shirt", pieces={"": [body, sleeve]}, seams=around)
    assert [seam.count for seam in sewn_seams(sewing_steps(draft_garment(made), ""))] == [2, 2]


@pytest.mark.parametrize(("height", "said"), [(0.02, "stretch the band"), (0.2, "ease in the body")])
def test_a_slender_ring_is_stretched_as_it_is_sewn_on(height, said):
    body = polygon("body", [(0.0, 0.0), (0.56, 0.0), (0.56, 0.4), (0.0, 0.4)], names=("hem", "right", "top", "left"))
    band = polygon("band", [(0.0, 0.0), (0.5, 0.0), (0.5, height), (0.0, height)], names=("lower", "r", "upper", "l"))
    seams = [sewn("band.lower", "body.top", ease=0.12), sewn("band.r", "band.l"), sewn("body.right", "body.left")]
    garment = draft_garment(Pattern(name="p", pieces={"": [body, band]}, seams=seams))
    assert said in " ".join(step.words for step in sewing_steps(garment, ""))


def test_hems_of_two_widths_on_one_piece_are_told_by_their_names():
    pattern = top()
    pieces = [
        replace(
            piece,
            edges=[
                replace(edge, kind="hem", allowance=0.03 if edge.name == "hem" else 0.02)
                if edge.name in ("hem", "neck")
                else edge
                for edge in piece.edges
            ],
        )
        if piece.name == "front"
        else piece
        for piece in pattern.pieces[""]
    ]
    words = {}
    for name, row in (("two", pieces), ("one", pattern.pieces[""])):
        steps = sewing_steps(draft_garment(replace(pattern, pieces={"": row})), "")
        (words[name],) = [step.words for step in steps if step.technique == "hem"]
    assert "3 cm hem (front, back right, back left), 2 cm neck (front)" in words["two"]
    assert " hem (" not in words["one"]


def test_letters_on_the_pieces_are_those_of_the_guide_in_all_sizes():
    def row(size: str, first: float, second: float) -> list[Piece]:
        """Three strips beside each other, and the heights at which they are joined [m]."""
        heights = (0.3, first, second, 0.3)
        return [
            polygon(name, [(0.0, 0.0), (0.2, 0.0), (0.2, heights[k + 1]), (0.0, heights[k])], size=size)
            for k, name in enumerate("abc")
        ]

    pattern = Pattern(
        name="top",
        pieces={"S": row("S", 0.4, 0.2), "M": row("M", 0.2, 0.4)},
        seams=[sewn("a.e1", "b.e3", "one"), sewn("b.e1", "c.e3", "two")],
        sample_size="M",
    )
    drafted = draft_garment(pattern)
    letters = seam_letters(drafted)
    for name, length in {"one": 200.0, "two": 400.0}.items():
        (seam,) = (seam for seam in sewn_seams(sewing_steps(drafted, "M")) if seam.letter == letters[name])
        assert seam.length_mm[0] == pytest.approx(length)


def test_a_pocket_sewn_to_a_waistband_and_an_elastic_along_no_edge_stop_nothing():
    bag = replace(polygon("bag", corners_of(0.1, 0.2)), role="pocket")
    band = replace(polygon("band", corners_of(0.1, 0.05)), role="waistband")
    nowhere = Elastic(edge="waist", width=0.03, lengths={"": 0.6})
    pattern = Pattern(name="skirt", pieces={"": [bag, band]}, seams=[sewn("bag.e2", "band.e0")], elastics=[nowhere])
    steps = sewing_steps(draft_garment(pattern), "")
    assert steps
    assert not any("elastic" in notion for notion in notions(steps))
    raw = Pattern(name="strap", pieces={"": [polygon("ring", corners_of(0.1, 0.2), kinds=["fold", *["seam"] * 3])]})
    alone = replace(raw, elastics=[nowhere])
    assert len(notions(sewing_steps(draft_garment(alone), ""))) == 1
