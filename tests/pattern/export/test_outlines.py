"""Outlines of drawings of other programs: what lines make a piece, and that nothing is left out without a word."""

from __future__ import annotations

import re
from itertools import pairwise
from pathlib import Path
from typing import Any

import ezdxf
import numpy as np
import pytest

from warpflat.core.errors import InputError
from warpflat.pattern.drafting.draft import draft_garment
from warpflat.pattern.drafting.pieces import Pattern
from warpflat.pattern.export.read_dxf import read_dxf
from warpflat.pattern.export.read_pattern import read_drafted
from warpflat.pattern.export.read_svg import read_svg

HALF = [(0, 0), (250, 0), (250, 400), (120, 600), (80, 600), (0, 520)]
SEWN = [(0, 10), (240, 10), (240, 390), (118, 590), (82, 590), (0, 512)]
PAGE = (
    '<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" '
    'xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape" width="500mm" height="400mm" viewBox="0 0 500 400">{}</svg>'
)
A = '<path id="a" d="M20 20 H180 V380 H20 Z"/>'


class Drawing:
    """A DXF of blocks, each a piece of its name."""

    def __init__(self, version: str = "R12") -> None:
        self.document: Any = ezdxf.new(version)

    def block(self, name: str, *, size: str = "", **insert: Any) -> Any:
        block = self.document.blocks.new(f"{name}{size}")
        block.add_text(f"Piece Name: {name}", dxfattribs={"layer": "1"})
        block.add_text(f"Size: {size}", dxfattribs={"layer": "1"})
        self.document.modelspace().add_blockref(f"{name}{size}", (0, 0), dxfattribs=insert)
        return block

    def read(self, folder: Path, **options: Any) -> Pattern:
        self.document.saveas(folder / "drawn.dxf")
        return read_dxf(folder / "drawn.dxf", **options)


def line(block: Any, points: list[tuple[float, float]], layer: str, *, close: bool = False) -> None:
    block.add_polyline2d(points, close=close, dxfattribs={"layer": layer})


def svg(folder: Path, shapes: str, page: str = PAGE) -> Pattern:
    (folder / "drawn.svg").write_text(page.format(shapes))
    return read_svg(folder / "drawn.svg")


def sides(pattern: Pattern, name: str, size: str = "") -> list[float]:
    return [1e3 * edge.length for edge in pattern.piece(name, size).edges]


@pytest.mark.parametrize("turn", [0.0, 33.0, 180.0])
@pytest.mark.parametrize("drawn", ["closed", "open", "sewn"])
def test_a_half_lies_on_its_line_of_symmetry(turn: float, drawn: str, tmp_path: Path) -> None:
    drawing = Drawing()
    block = drawing.block("front", rotation=turn)
    line(block, HALF, "1", close=drawn != "open")
    if drawn == "sewn":
        line(block, SEWN, "14")
    line(block, [(0, -20), (0, 540)], "6")
    piece = drawing.read(tmp_path).piece("front", "")
    fold = [edge for edge in piece.edges if edge.kind == "fold"]
    assert [1e3 * edge.length for edge in fold] == pytest.approx([502.0 if drawn == "sewn" else 520.0])
    if drawn == "sewn":
        # Its allowance is what lies between its two lines.
        assert piece.edges[0].allowance == pytest.approx(0.010)


def test_a_whole_piece_keeps_its_line_of_symmetry_inside(tmp_path: Path) -> None:
    drawing = Drawing()
    block = drawing.block("front")
    line(block, [(-x, y) for x, y in HALF[::-1]][:-1] + HALF, "1", close=True)
    line(block, [(0, 0), (0, 520)], "6")
    piece = drawing.read(tmp_path).piece("front", "")
    assert not piece.on_fold
    assert np.ptp(piece.outline[:, 0]) == pytest.approx(0.5)


def test_a_half_is_drawn_in_by_its_allowance_but_for_the_fold(tmp_path: Path) -> None:
    drawing = Drawing()
    block = drawing.block("front")
    line(block, HALF, "1", close=True)
    line(block, [(0, 0), (0, 520)], "6")
    piece = drawing.read(tmp_path, allowance=0.01).piece("front", "")
    low, high = 1e3 * piece.outline.min(axis=0), 1e3 * piece.outline.max(axis=0)
    np.testing.assert_allclose([*low, *high], [0.0, 10.0, 240.0, 590.0], atol=0.01)
    cut = read_drafted(tmp_path / "drawn.dxf", allowance=0.01).pieces[""][0].cut_line
    np.testing.assert_allclose(np.ptp(1e3 * cut, axis=0), [250.0, 600.0], atol=0.5)


@pytest.mark.parametrize(("gap", "closes"), [(0.0, True), (0.04, True), (0.06, False)])
def test_ends_meet_within_a_twentieth_of_a_millimetre(gap: float, closes: bool, tmp_path: Path) -> None:
    drawing = Drawing()
    block = drawing.block("front")
    for a, b in pairwise([*HALF, HALF[0]]):
        block.add_line((a[0], a[1] + gap * (a == HALF[0])), b, dxfattribs={"layer": "1"})
    if closes:
        assert len(sides(drawing.read(tmp_path), "front")) == 5
    else:
        with pytest.raises(InputError, match=r"front: an outline is open by 0\.1 mm"):
            drawing.read(tmp_path)
    path = f"M0 0 L300 0 L300 200 L0 200 L0 {gap}"
    if closes:
        assert sides(svg(tmp_path, f'<path id="a" d="{path}"/>'), "a") == pytest.approx([300, 200, 300, 200], abs=0.1)
    else:
        with pytest.raises(InputError, match=r"open by 0\.1 mm"):
            svg(tmp_path, f'<path id="a" d="{path}"/>')


def test_an_outline_that_crosses_itself_at_a_corner_keeps_its_outer_ring(tmp_path: Path) -> None:
    drawing = Drawing()
    over = [(0, 0), (300, 0), (300, 305), (297, 305), (297, 300), (305, 300), (305, 299), (0, 300)]
    line(drawing.block("back"), over, "1", close=True)
    outline = 1e3 * drawing.read(tmp_path).piece("back", "").outline
    assert outline.max() == pytest.approx(300.0, abs=0.05)
    line(drawing.block("bow"), [(0, 0), (300, 300), (300, 0), (0, 300)], "1", close=True)
    with pytest.raises(InputError, match=r"bow: its outline crosses itself at \(150\.0, 150\.0\) mm"):
        drawing.read(tmp_path)


def test_a_scribble_is_refused_before_its_crossings_are_sought(tmp_path: Path) -> None:
    """A star of 4,000 points, each a radian on, has some three million crossings."""
    turn = np.arange(4000.0)
    points = " L".join(f"{x:.3f} {y:.3f}" for x, y in 200.0 + 150.0 * np.column_stack([np.cos(turn), np.sin(turn)]))
    with pytest.raises(InputError, match="crosses itself all over, 575 m of it"):
        svg(tmp_path, f'<path id="a" d="M{points} Z"/>')


def test_every_block_is_a_piece_or_is_named(tmp_path: Path) -> None:
    drawing = Drawing()
    two = drawing.block("two")
    for at in (0, 400):
        line(two, [(x + at, y) for x, y in HALF], "1", close=True)
    for size in ("", "B"):
        block = drawing.document.blocks.new(f"sleeve{size}")
        block.add_text("Piece Name: sleeve")
        line(block, HALF, "01", close=True)
    line(drawing.block("notched"), HALF, "1", close=True)
    drawing.document.blocks.get("notched").add_point((250, 100), dxfattribs={"layer": "4"})
    line(drawing.block("inner"), HALF, "CUT", close=True)
    line(drawing.document.modelspace(), [(x, y + 900) for x, y in HALF], "0", close=True)
    found = drawing.read(tmp_path)
    assert [piece.name for piece in found.pieces[""]] == ["two", "two 2", "sleeve", "sleeve 2", "notched"]
    said = "\n".join(found.notes)
    for words in ("what belongs to pieces and is not read: notch", "blocks without a boundary on layer 1 were left out: 'inner'",
                  "1 closed line beside the blocks was left out"):  # fmt: skip
        assert words in said
    line(drawing.block("lost"), HALF[:3], "1")
    with pytest.raises(InputError, match="lost: its outline is open by"):
        drawing.read(tmp_path)


def test_a_sewing_line_that_is_open_is_named(tmp_path: Path) -> None:
    drawing = Drawing()
    block = drawing.block("front")
    line(block, HALF, "1", close=True)
    line(block, SEWN, "14")
    found = drawing.read(tmp_path)
    assert any("its sewing line on layer 14 is open by 502.0 mm and was left out" in note for note in found.notes)


def test_blocks_in_blocks_are_read_as_they_are_inserted(tmp_path: Path) -> None:
    drawing = Drawing()
    line(drawing.document.blocks.new("inner"), HALF, "CUT", close=True)
    drawing.document.blocks.new("outer").add_blockref("inner", (5, 5))
    drawing.document.modelspace().add_blockref("outer", (0, 0), dxfattribs={"xscale": 2, "yscale": 2})
    assert sides(drawing.read(tmp_path), "outer")[0] == pytest.approx(500.0)


def test_pieces_belong_to_sizes(tmp_path: Path) -> None:
    drawing = Drawing()
    for size, names in (("42", ("front", "yoke")), ("44", ("front",)), ("46", ("front",))):
        for name in names:
            line(drawing.block(name, size=size), HALF, "1", close=True)
    found = drawing.read(tmp_path)
    assert found.notes == ["piece 'yoke' is in size 42 only"]
    assert found.sample == "42"
    drafted = read_drafted(tmp_path / "drawn.dxf")
    assert {size: [piece.name for piece in row] for size, row in drafted.pieces.items()} == {
        "42": ["front", "yoke"], "44": ["front"], "46": ["front"],
    }  # fmt: skip


def test_a_piece_without_a_size_is_in_all(tmp_path: Path) -> None:
    drawing = Drawing()
    for name, size in (("front", "42"), ("front", "44"), ("pocket", "")):
        line(drawing.block(name, size=size), HALF, "1", close=True)
    found = drawing.read(tmp_path)
    assert {size: [piece.name for piece in row] for size, row in found.pieces.items()} == {
        "42": ["front", "pocket"], "44": ["front", "pocket"],
    }  # fmt: skip
    assert found.notes == []


def test_a_line_of_a_file_stays_as_it_is_drawn(tmp_path: Path) -> None:
    """A corner of 33 degrees is no sample of a curve."""
    drawing = Drawing()
    line(drawing.block("front"), HALF, "1", close=True)
    drawing.read(tmp_path)
    cut = 1e3 * read_drafted(tmp_path / "drawn.dxf").pieces[""][0].cut_line
    assert np.ptp(cut, axis=0) == pytest.approx([250.0, 600.0], abs=1e-3)
    assert np.linalg.norm(cut - cut.min(axis=0) - (250, 400), axis=1).min() < 1e-3


def test_a_block_that_is_drawn_within_another_one_alone_is_a_part_of_it(tmp_path: Path) -> None:
    drawing = Drawing()
    outer = drawing.block("front")
    line(drawing.document.blocks.new("half"), HALF, "1", close=True)
    outer.add_blockref("half", (0, 0), dxfattribs={"xscale": 2.0, "yscale": 2.0})
    line(drawing.block("back"), HALF, "1", close=True)
    found = drawing.read(tmp_path)
    assert found.piece_names == ("front", "back")
    assert sum(sides(found, "front")) == pytest.approx(2.0 * sum(sides(found, "back")))


SHAPES = {
    "circle": ('<circle id="a" cx="200" cy="200" r="100"/>', [628.3]),
    "ellipse": ('<ellipse id="a" cx="200" cy="200" rx="100" ry="50"/>', [484.4]),
    "rounded": ('<rect id="a" x="1" y="1" width="200" height="100" rx="20"/>', [600 - 8 * 20 + 2 * np.pi * 20]),
    "lines": (
        '<g id="a"><line x1="0" y1="0" x2="90" y2="0"/><line x1="90" y1="0" x2="90" y2="50"/><polyline points="0,0 0,50 90,50"/></g>',
        [280.0],
    ),
    "skew": ('<rect id="a" transform="skewX(45)" width="100" height="100"/>', [200 + 200 * np.sqrt(2)]),
    "used": ('<defs><path id="a" d="M0 0 H100 V50 H0 Z"/></defs><use xlink:href="#a" transform="rotate(30)" x="9"/>', [300.0]),
    "symbol": ('<symbol id="s"><path id="a" d="M0 0 H100 V50 H0 Z"/></symbol><use href="#s" x="9"/>', [300.0]),
    "symbol in its size": (
        '<symbol id="s" viewBox="5 0 10 5"><path id="a" d="M5 0 h10 v5 h-10 Z"/></symbol><use href="#s" width="100" height="50"/>', [300.0],
    ),
    "stretched": (
        '<svg width="100" height="50" viewBox="0 0 5 5" preserveAspectRatio="none"><rect id="a" width="5" height="5"/></svg>', [300.0],
    ),
    "nested": ('<svg width="100" height="50" viewBox="0 0 10 5"><rect id="a" width="10" height="5"/></svg>', [300.0]),
}  # fmt: skip


@pytest.mark.parametrize(("shape", "around"), SHAPES.values(), ids=SHAPES)
def test_all_shapes_are_lines(shape: str, around: list[float], tmp_path: Path) -> None:
    assert sum(sides(svg(tmp_path, shape), "a")) == pytest.approx(around[0], abs=0.2)


def test_pieces_are_those_that_are_drawn_apart_or_named(tmp_path: Path) -> None:
    def names(shapes: str) -> tuple[set[str], str]:
        found = svg(tmp_path, shapes)
        return {piece.name for piece in found.pieces[""]}, "\n".join(found.notes)

    pocket = '<path {} d="M60 60 H120 V140 H60 Z"/>'
    frame = '<rect id="page" x="1" y="1" width="498" height="398"/>'
    assert names(A + pocket.format('inkscape:label="pocket"'))[0] == {"a", "pocket"}
    assert names(A + pocket.format('id="path12"')) == ({"a"}, "1 closed line within pieces was left out: 'path12'")
    # A sewing line follows its cutting line all around.
    assert names(A + '<path id="sewing" d="M30 30 H170 V370 H30 Z"/>')[0] == {"a"}
    assert names(frame + A) == ({"a"}, "'page' has the page's size and was taken for its frame")
    assert names(A + '<path id="b" d="M100 30 H240 V370 H100 Z"/>')[0] == {"a", "b"}
    assert names(A + '<path id="b" d="M180 20 H480 V380 H180 Z"/>')[0] == {"a", "b"}
    told = names(A + '<path id="b" style="display:none" d="M200 20 H280 V380 H200 Z"/><image/>')[1]
    assert told == "what is no line, or is hidden, was left out: hidden path, image"
    assert names(A + '<path id="b" d="M300 20 H480 V380 H300"/>')[1] == "1 open line was left out: 'b'"


def test_a_drawing_keeps_its_ratio_as_its_viewer_shows_it(tmp_path: Path) -> None:
    page = '<svg xmlns="http://www.w3.org/2000/svg" width="100mm" height="100mm" viewBox="0 0 50 100"{}>{{}}</svg>'
    shape = '<rect id="a" width="50" height="100"/>'
    assert sides(svg(tmp_path, shape, page.format("")), "a")[:2] == pytest.approx([50.0, 100.0])
    stretched = page.format(' preserveAspectRatio="none"')
    assert sides(svg(tmp_path, shape, stretched), "a")[:2] == pytest.approx([100.0, 100.0])


def test_freesewing_marks_its_folds(tmp_path: Path) -> None:
    found = svg(
        tmp_path,
        '<g id="fs-stack-own.front"><g id="fs-stack-own.front-part-own.front">'
        '<path class="fabric" d="M 0,50 C 40,50 70,30 80,0 L 130,20 L 200,200 L 200,350 L 0,350 z"/>'
        '<path class="fabric sa" d="M 0,40 C 40,40 60,20 70,-10 L 140,15 L 210,200 L 210,360 L 0,360"/>'
        '<path class="note" marker-start="url(#cutonfoldFrom)" marker-end="url(#cutonfoldTo)" d="M 0,90 L 15,90 L 15,300 L 0,300"/>'
        "</g></g>",
    )
    piece = found.piece("front", "")
    assert [round(1e3 * edge.length) for edge in piece.edges if edge.kind == "fold"] == [300]
    assert piece.grain is not None
    assert np.ptp(piece.grain[:, 0]) < 1e-9
    # The line is drawn from the neck down; the piece is not turned upside down for that.
    assert draft_garment(found, true=False).pieces[""][0].frame[:, :2] == pytest.approx(np.eye(2), abs=1e-9)
    assert piece.edges[0].allowance == pytest.approx(0.010)


def test_the_only_piece_of_a_group_has_its_name_though_it_is_one_line(tmp_path: Path) -> None:
    square = '<path d="M{0},0 h100 v100 h-100 z"/>'
    inner = '<path d="M210,10 h80 v80 h-80 z"/>'
    (tmp_path / "a.svg").write_text(
        '<svg xmlns="http://www.w3.org/2000/svg" width="900mm" height="200mm" viewBox="0 0 900 200">'
        f'<g id="SLEEVE">{square.format(0)}</g><g id="YOKE">{square.format(200)}{inner}</g>'
        f'<g id="cuffs">{square.format(400)}{square.format(600)}</g></svg>'
    )
    pattern = read_svg(tmp_path / "a.svg")
    names = [piece.name for (row,) in [pattern.pieces.values()] for piece in row]
    assert {"SLEEVE", "YOKE"} < set(names)
    assert [name.partition("_")[0] for name in names].count("piece") == 2


def test_a_group_that_holds_itself_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="one holds itself"):
        svg(tmp_path, '<g id="q"><use href="#q"/></g>')
    assert re.search("use of what the file does not have", "\n".join(svg(tmp_path, A + '<use href="#none"/>').notes))
