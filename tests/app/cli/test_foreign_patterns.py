"""`warpflat export` and `warpflat marker` take patterns of other programs."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import ezdxf
import pytest
from command import Command
from polygons import corners_of, drafted, polygon, sewn

from warpflat.pattern.export.pattern_json import write_pattern_json
from warpflat.pattern.export.read_pattern import read_pattern

DRAWING = """<svg xmlns="http://www.w3.org/2000/svg" width="500mm" height="400mm" viewBox="0 0 500 400">
<rect id="front" x="10" y="10" width="200" height="300"/><circle id="pocket" cx="350" cy="200" r="100"/></svg>"""


@pytest.fixture
def half() -> Path:
    document = ezdxf.new("R12")
    for size, wide in (("M", 250), ("L", 270)):
        block = document.blocks.new(f"front{size}")
        for text in ("Piece Name: front", f"Size: {size}", "Quantity: 1"):
            block.add_text(text, dxfattribs={"layer": "1"})
        block.add_polyline2d([(0, 0), (wide, 0), (wide, 400), (0, 520)], close=True, dxfattribs={"layer": "1"})
        block.add_line((0, 0), (0, 520), dxfattribs={"layer": "6"})
        document.modelspace().add_blockref(f"front{size}", (0, 0))
    document.saveas("bought.dxf")
    return Path("bought.dxf")


def test_a_drawing_becomes_all_files(command: Command) -> None:
    Path("drawing.svg").write_text(DRAWING)
    ended = command(
        "export", "drawing.svg", *(word for kind in ("dxf", "svg", "pdf", "json", "plt") for word in ("--format", kind))
    )
    assert (ended.code, ended.err) == (0, "")
    made = Path("out/drawing")
    assert {path.name for path in made.iterdir()} == {
        "drawing.dxf", "drawing.svg", "pattern.pdf", "pattern.json", "drawing.plt", "metrics.json",
    }  # fmt: skip
    for file in ("drawing.dxf", "drawing.svg", "pattern.json"):
        found = read_pattern(made / file)
        assert {piece.name for piece in found.pieces[""]} == {"front", "pocket"}
        around = sum(edge.length for edge in found.piece("pocket", "").edges)
        assert around == pytest.approx(0.6283, abs=2e-4)
    assert "drawing.svg" in command("export", "drawing.svg", "--format", "svg", "--out", ".").refusal


def test_a_file_in_inches(command: Command, half: Path) -> None:
    assert command("export", f"{half}", "--format", "dxf", "--format", "json", "--units", "in").code == 0
    assert "UNITS: ENGLISH" in Path("out/bought/bought.dxf").read_text()
    assert read_pattern("out/bought/pattern.json").units == "in"
    for size, wide in (("M", 0.25), ("L", 0.27)):
        piece = read_pattern("out/bought/bought.dxf").piece("front", size)
        assert max(edge.length for edge in piece.edges if abs(edge.points[0, 1] - edge.points[-1, 1]) < 1e-6) == (
            pytest.approx(wide, abs=1e-5)
        )
        assert piece.on_fold
    # A pattern.json in other units, too.
    assert command("export", "out/bought", "--format", "json", "--units", "mm").code == 0
    assert read_pattern("out/bought/pattern.json").units == "mm"


def test_a_marker_of_a_file(command: Command, half: Path) -> None:
    ended = command("marker", f"{half}", "--width", "150", "--size", "M=2", "--size", "L", "--seconds", "1")
    assert ended.code == 0
    assert "of cloth 1.50 m wide, " in ended.err
    plan = json.loads(Path("out/bought/bought.marker.json").read_text())
    assert sorted(entry["size"] for entry in plan["placements"]) == ["L", "M", "M"]
    assert plan["width_m"] == 1.5
    # A half on the fold is laid whole.
    area = 2 * (2 * 0.25 + 0.27) * 0.46
    assert plan["utilisation"] * plan["width_m"] * plan["length_m"] == pytest.approx(area, rel=1e-3)
    assert "bought.marker.svg" in ended.out
    folded = command("marker", f"{half}", "--folded", "--json", "--out", "folded")
    (measures,) = json.loads(folded.out)["markers"]
    assert measures["folded"]
    assert folded.err == ""


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (("--width", "20"), "wide, the cloth 196 mm between its margins"),
        (("--size", "XL"), "has no size 'XL'"),
        (("--size", "M=0"), "is no size and number"),
        (("--match", "side"), "needs the repeat of the stripes"),
        (("--match", "side", "--repeat-warp", "40"), "no seam 'side'"),
    ],
)
def test_a_marker_that_cannot_be_is_one_line(command: Command, half: Path, more: tuple[str, ...], message: str) -> None:
    assert message in command("marker", f"{half}", *more).refusal
    assert not Path("out").exists()


def test_a_seam_to_be_matched_that_is_not_there_leaves_no_marker_of_another_cloth(command: Command) -> None:
    pieces = [replace(polygon(name, corners_of(0.2, 0.3)), fabric=name) for name in ("wool", "cotton")]
    write_pattern_json(drafted(*pieces, seams=[sewn("wool.e1", "cotton.e3", "side left")]), "pattern.json")
    asked = ("--repeat-warp", "40", "--match", "side lft", "--seconds", "1", "--out", "out")
    assert "no seam 'side lft'; did you mean 'side left'" in command("marker", "pattern.json", *asked).refusal
    assert not Path("out").exists()
