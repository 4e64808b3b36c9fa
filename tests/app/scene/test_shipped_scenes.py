"""Every shipped scene runs, and every garment of `warpflat new` can be sewn: notches meet, each edge is used up once, in an order that can
be followed, and each printed word is German, too.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import pytest
from printed import drawn_faults
from pypdf import PdfReader
from real_files import DATA
from usd_validation import validate_usd

from warpflat.app.scene.load import Scene, load_scene, make_scene
from warpflat.app.scene.plan import plan_scene
from warpflat.app.scene.run import run_scene
from warpflat.app.scene.wardrobe import garment_offer, offers, scene_text
from warpflat.core.polyline import polyline_length
from warpflat.core.text import other_side
from warpflat.core.toml_file import read_toml, tomllib
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
from warpflat.pattern.export.pattern_files import export_patterns
from warpflat.pattern.export.pattern_json import read_pattern_json

SCENES = Path(__file__).parents[3] / "scenes"

# Batch files name scenes; tests/app/batch loads them.
SHIPPED = [path for path in sorted(SCENES.glob("*.toml")) if not {"scenes", "forms", "tasks"} & read_toml(path).keys()]

# The kinds of openings of each.
OPENINGS = {
    path: {str(table["kind"]).removesuffix("s") for table in read_toml(path).get("openings", ())} for path in SHIPPED
}

# Pieces that only drafting makes, of garments whose seams match on these meshes.
DRAFTED = {
    "jeans": {"front_left_pocket_facing", "front_left_pocket_bag", "back_left_pocket", "yoke_left"},
    "leggings": {"leg_left", "abdomen_band"},
    "leotard": {"thigh_band", "neck_band"},
    "polo": {"neck_placket", "collar"},
    "shirt": {"collar", "collar_stand", "cuff", "sleeve_placket"},
}

# Collars are cut to the neck's curve, and matched to it on a finer mesh [mm].
FINER = {"polo": 25.0, "shirt": 25.0}

# Garments of `warpflat new` whose scene is another one.
OTHERWISE = ("a_line_skirt", "trousers", "tshirt")

# Finished lengths, and between what each, or the difference of two, lies [m]. A leotard has no inner leg, pyjamas no waistband.
LENGTHS = {
    "leggings": {
        "outer leg, below the waistband": (0.5, 1.1), "inner leg": (0.4, 0.9), "hem at the ankle": (0.1, 0.4),
        "outer leg, below the waistband - inner leg": (0.15, 0.25),
    },
    "leotard": {"side, below the armhole": (0.1, 0.7)},
    "pyjama_trousers": {"outer leg": (0.7, 1.1), "inner leg": (0.5, 0.9), "hem at the ankle": (0.3, 0.7), "hem at the waist": (0.5, 1.5)},
    "hoodie": {"length at the centre back": (0.0, 1), "sleeve": (0.5, 0.7)},
    "shirt": {"length at the centre back": (0.5, 0.75), "sleeve": (0.5, 0.7), "hem at the hip": (1.0, 1.15)},
    "trousers": {
        "outer leg, below the waistband": (0.9, 1.1), "inner leg": (0.65, 0.8), "hem at the ankle": (0.3, 0.45),
        "outer leg, below the waistband - inner leg": (0.2, 0.4),
    },
}  # fmt: skip

# Scenes that are run with all their files: a plain piece, one with a cut, one worn stretched, a garment.
DRAWN = ("dome", "fisheye_dart", "compression_sleeve", "a_line_skirt")


def made_light(scene: Scene) -> Scene:
    """A scene on a coarser mannequin, most without pictures, frames, and patterns to print; `docs/make_gallery.py` runs all as they are."""
    settings = scene.settings
    if settings.mannequin is not None and settings.mannequin.size is not None:
        settings = settings.model_copy(
            update={"mannequin": settings.mannequin.model_copy(update={"resolution_mm": FINER.get(scene.name, 40.0)})}
        )
    if settings.marker is not None:
        settings = settings.model_copy(update={"marker": settings.marker.model_copy(update={"seconds": 1})})
    if scene.name in DRAWN:
        return replace(scene, settings=settings)
    output = settings.output.model_copy(update={"frames": 0, "picture": False})
    pattern = settings.pattern.model_copy(update={"formats": ["json"]})
    return replace(scene, settings=settings.model_copy(update={"output": output, "pattern": pattern}))


# The last line of a sheet.
SHEET = re.compile(r"sheet [A-Z]+\d+  -  ")


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_every_shipped_scene_converges_unfolded(path: Path, tmp_path: Path):
    text = path.read_text()
    assert text.startswith("# ")
    if "WARPFLAT_DATA" in text and not DATA.is_dir():
        pytest.skip("WARPFLAT_DATA is not set: the folder with the real meshes")
    result = run_scene(made_light(load_scene(path)), tmp_path)
    for name, piece in result.metrics["pieces"].items():
        assert piece["stages"][-1]["converged"], name
        assert piece["flipped_faces"] == 0, name
    assert "not_drawn" not in result.metrics["pattern"]
    if path.stem in ("cone", "cylinder"):
        assert result.metrics["pieces"][path.stem]["length_error"] < 1e-6
    for name in result.files:
        assert (tmp_path / name).stat().st_size > 0
    assert ("frames.usdc" in result.files) == (path.stem in DRAWN)
    if path.stem in DRAWN:
        assert validate_usd(tmp_path / "frames.usdc") == []
    assert json.loads((tmp_path / "metrics.json").read_text())["pieces"].keys() == result.metrics["pieces"].keys()
    # The pattern as printed: nothing leaves its piece, no word is cut, and every opening is named in every file.
    pattern = read_pattern_json(tmp_path / "pattern.json")
    assert drawn_faults(pattern)[0] == []
    if path.stem in DRAFTED:
        # It can be put on.
        assert all(ring["passes"] is not False for ring in result.metrics["rings"])
        assert all(seam.matches for seam in pattern.seams)
        assert DRAFTED[path.stem] <= {piece.name for pieces in pattern.pieces.values() for piece in pieces}
    if path.stem in offers() and path.stem not in OTHERWISE:
        assert_it_can_be_sewn(pattern)
    if path.stem in LENGTHS:
        _assert_lengths(pattern, LENGTHS[path.stem])
    openings = OPENINGS[path]
    if openings:
        # A PDF is written and read for one scene of each set of openings, on large sheets: fewer pages have to be read.
        is_read = path == next(other for other in SHIPPED if OPENINGS[other] == openings)
        export_patterns(tmp_path, ["svg", "dxf", *["pdf"][: int(is_read)]], out=tmp_path / "opened", paper="A0")
        own_name = path.stem.replace("_", " ")
        texts = [(tmp_path / "opened" / f"{path.stem}.{ending}").read_text() for ending in ("svg", "dxf")]
        if is_read:
            pages = [page.extract_text() for page in PdfReader(tmp_path / "opened" / "pattern.pdf").pages]
            guide, sheets = (
                "".join(page for page in pages if bool(SHEET.search(page)) == wanted) for wanted in (False, True)
            )
            assert "Measures" in guide
            assert "from the back" in guide
            texts += [guide, sheets]
        for text in texts:
            named = set(
                re.findall(
                    r"zip|button|vent|slit|keyhole|wrap|godet", text.replace(path.stem, "").replace(own_name, "")
                )
            )
            assert openings <= named


# Garments of `warpflat new` with options that sew other seams than the shipped scenes do, what pieces they have, and how long the edges of
# their mannequins are [mm]: collars and hoods are cut to the neck's curve, which takes finer meshes.
OPTIONS: tuple[tuple[str, dict[str, str], float, set[str]], ...] = (
    *((name, {}, 40.0, set[str]()) for name in OTHERWISE),
    ("shirt", {"collar": "stand", "sleeve": "none"}, 25.0, {"collar_stand"}),
    ("shirt", {"collar": "flat", "sleeve": "three-quarter"}, 25.0, {"collar"}),
    ("hoodie", {"closure": "zip"}, 25.0, {"hood", "hood_strip", "wrist_band", "hip_band"}),
    ("sweatshirt", {"armhole": "raglan"}, 40.0, {"sleeve_left", "wrist_band"}),
    ("shift_dress", {}, 40.0, set()),
    ("shift_dress", {"hem": "ruffle", "collar": "flat"}, 25.0, {"knee_ruffle", "collar", "armhole_binding"}),
    ("gored_skirt", {"hem": "slanted"}, 40.0, {"godet", "godet_2", "front_side_left", "back_side_right"}),
    ("jacket", {"lining": "full"}, 40.0, set()),
    ("circle_skirt", {"skirt": "circle"}, 40.0, {"front_hip_flounce", "back_hip_flounce", "waistband"}),
    ("pyjama_trousers", {"hem": "rib"}, 40.0, {"ankle_band"}),
    ("wrap_dress", {"sleeve": "short"}, 40.0, {"front_bodice_left", "front_skirt_left", "tie", "neck_binding"}),
)


@pytest.mark.parametrize(
    ("name", "chosen", "resolution", "pieces"),
    OPTIONS,
    ids=[" ".join([each[0], *each[1].values()]) for each in OPTIONS],
)
def test_garment_with_options_comes_out_whole(name: str, chosen: dict[str, str], resolution: float, pieces: set[str]):
    text = scene_text(garment_offer(name), {"size": "EU 40", "resolution_mm": resolution}, chosen, file="x.toml")
    plan = plan_scene(make_scene(tomllib.loads(text), name=name, folder=Path(), where=name))
    garment, drawing = plan.flatten(), plan.drawing
    metrics = garment.metrics()
    assert all(each["flipped_faces"] == 0 and each["stages"][-1]["converged"] for each in metrics["pieces"].values())
    # It can be put on.
    assert all(ring["passes"] is not False for ring in metrics["rings"])
    pattern, _ = pattern_of_garment({"": garment}, name=name, rules=drawing.rules, cloth_width=drawing.cloth_width)
    pattern = add_lining(pattern, drawing.lining) if drawing.lining else pattern
    drafted = draft_garment(add_interfacing(pattern, drawing.interfacing) if drawing.interfacing else pattern)
    assert pieces <= {piece.name for piece in drafted.pieces[""]}
    assert all(seam.matches for seam in drafted.seams)
    if "ankle_band" not in pieces:  # of fronts that are no pair one has its band by name alone
        assert_it_can_be_sewn(drafted)
    if name in ("shift_dress", "jacket") and len(chosen) < 2:
        # Facings that are sewn to a lining are not neatened.
        words = [step.words for step in sewing_steps(drafted, "") if step.technique == "facing"]
        neatened = {each.startswith("Neaten the inner edges of the facings. Sew") for each in words}
        assert neatened == {name == "shift_dress"}


# --- how a garment is sewn


def only_size(drafted: DraftedGarment) -> str:
    (size,) = drafted.pieces
    return size


def assert_it_can_be_sewn(drafted: DraftedGarment) -> None:
    """Of a garment in one size: its notches meet, its steps are in an order, and use up all edges, its words are German, too."""
    apart = {seam.name: seam.notches_mm for seam in drafted.seams if seam.notches_mm is not None}
    assert apart or not drafted.seams
    assert {name: gap for name, gap in apart.items() if gap > 0.2} == {}
    _assert_every_edge_is_used_up_by_one_step(drafted)
    _assert_a_seam_comes_after_those_that_end_on_its_line(drafted)
    _assert_every_printed_word_is_german(drafted)


def _assert_every_edge_is_used_up_by_one_step(drafted: DraftedGarment) -> None:
    steps = sewing_steps(drafted, only_size(drafted))
    finished = [place for step in steps for place in step.finished]
    assert len(finished) == len(set(finished))
    joined = {side.place for seam in drafted.pattern.seams for side in seam.stretches}
    assert not joined & set(finished)
    every = {
        (piece.name, edge.name)
        for piece in drafted.pieces[only_size(drafted)]
        for edge in piece.edges
        if edge.kind not in ("fold", "dart")
    }
    assert every <= {(piece, edge) for step in steps for piece, edges in step.sewn.items() for edge in edges}
    assert every <= joined | {(piece, other_side(edge)) for piece, edge in joined} | set(finished)
    # Each dart and each seam is sewn once, and what a step takes stands in the list.
    letters = [seam.letter for seam in sewn_seams(sewing_steps(drafted, only_size(drafted)))]
    words = " ".join(step.words for step in steps)
    # Left and right, drawn once, have one letter.
    assert all(words.count(f" {letter} (") == letters.count(letter) for letter in letters)
    assert [each for step in steps for each in step.notions] == list(notions(steps)[1:])
    # Nothing is left to the maker, but the lower edge of a hat that is lined.
    assert {step.technique for step in steps} & {"bind_raw", "raw"} <= (
        {"bind_raw"} if drafted.name == "sun_hat" else set()
    )


def _assert_a_seam_comes_after_those_that_end_on_its_line(drafted: DraftedGarment) -> None:
    """Along each side of a seam the ends of its edges that meet have been sewn together before."""
    pieces = {piece.name: [edge.name for edge in piece.edges] for piece in drafted.pieces[only_size(drafted)]}

    def corner(side: SeamSide, *, end: bool) -> tuple[str, bool, int, int]:
        at = pieces[side.piece].index(side.edge) + (end != side.reversed)
        return side.piece, side.mirrored, side.copy, at % len(pieces[side.piece])

    number = {}
    for at, step in enumerate(sewing_steps(drafted, only_size(drafted))):
        for seam in drafted.pattern.seams:
            places = [side.place for side in seam.stretches]
            if seam.name not in number and all(edge in step.sewn.get(piece, ()) for piece, edge in places):
                number[seam.name] = at
    ends = {
        frozenset(corner(row[0 if not end else -1], end=end) for row in seam.sides): seam.name
        for seam in drafted.pattern.seams
        for end in (False, True)
    }
    for seam in drafted.pattern.seams:
        for row in seam.sides:
            for one, other in pairwise(row):
                crossing = ends.get(frozenset((corner(one, end=True), corner(other, end=False))))
                assert crossing is None or number[crossing] <= number[seam.name], (crossing, seam.name)


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


def _assert_every_printed_word_is_german(drafted: DraftedGarment) -> None:
    size, words = only_size(drafted), Misses(language_words("de"))
    garment = replace(drafted, pattern=replace(drafted.pattern, words=words))
    with printed_in(words):
        steps = sewing_steps(garment, size)
        notions(steps)
        tools(garment, steps)
        finished_lengths(garment, size)
        for piece in garment.pieces[size]:
            draw_piece(piece)
            cutting_words(piece.piece, piece.piece.quantity)
    assert words.missed - {""} == set()


def _assert_lengths(drafted: DraftedGarment, wanted: Mapping[str, tuple[float, float]]) -> None:
    """Finished lengths lie between those given [m], a band belongs to them, and an overlap counts once."""
    size = only_size(drafted)
    lengths, pieces = finished_lengths(drafted, size), {piece.name: piece for piece in drafted.pieces[size]}
    assert lengths.keys() == {name for name in wanted if " - " not in name}
    for name, (low, high) in wanted.items():
        one, *others = (lengths[each] for each in name.split(" - "))
        assert low < one - sum(others) < high, (name, lengths)
    if "hip_band" in pieces:
        back, band = pieces["back"], 0.5 * pieces["hip_band"].edge("left end").length
        (fold,) = [edge.line for edge in back.edges if edge.kind == "fold"] or [back.internal_lines["centre back"]]
        assert lengths["length at the centre back"] == pytest.approx(polyline_length(fold) + band, abs=1e-3)
    if drafted.pattern.worn is not None and "hem at the hip" in lengths:
        (hip,) = [each for each in drafted.pattern.worn.measures[size] if each.name == "hip"]
        assert lengths["hem at the hip"] == pytest.approx(hip.finished, abs=0.015)


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
