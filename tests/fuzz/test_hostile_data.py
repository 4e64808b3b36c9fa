"""Hostile TOML, JSON and names: each gets one line and exit code 2, and nothing is written."""

from __future__ import annotations

import copy
import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import ezdxf
import numpy as np
import pytest
from command import Command
from polygons import drafted_piece

from warpflat.core.errors import InputError, nearest
from warpflat.core.file_names import check_label, plain_label
from warpflat.core.text import one_line, quote_value
from warpflat.core.toml_file import read_toml
from warpflat.flat.surface.paths.lines import with_lines
from warpflat.flat.surface.repair.validate import make_surface
from warpflat.flat.surface.shapes import make_shape
from warpflat.pattern.drafting.draft import draft_garment
from warpflat.pattern.drafting.piece_parts import Dart, Edge, Hole
from warpflat.pattern.drafting.pieces import Pattern, Piece, Seam, SeamSide
from warpflat.pattern.export.dxf import write_dxf
from warpflat.pattern.export.pattern_json import pattern_json
from warpflat.pattern.export.svg import SvgPage

DIGITS = "9" * 5000
CONTROLS = ("\x01", "\x1b", "\x7f", "\x85", "\u2028", "\u202e", "\u2066", "\ufffe", "\udc80")


# --- words


def test_a_message_is_one_line_of_bounded_length():
    message = str(InputError(f"front\u202e: line\r\n  'a\x1b[31mb' and {'x' * 3000} and {'y ' * 3000}"))
    assert message.startswith(r"front\u202e: line 'a\x1b[31mb' and xxx")
    assert message.isprintable()
    assert len(message) <= 1500
    assert one_line(message) == message


def test_a_path_is_told_whole():
    path = "/home/somebody/" + "a folder/" * 20 + "front.obj"
    assert one_line(f"{path}: is empty") == f"{path}: is empty"


def test_a_long_value_is_shown_by_its_ends():
    assert quote_value("waist") == "'waist'"
    assert quote_value("a" + "x" * 3000 + "b") == "'a" + "x" * 26 + "..." + "x" * 26 + "b'"
    assert quote_value(16**5000) == "a value too long to be shown"
    deep: list[Any] = []
    for _ in range(100_000):
        deep = [deep]
    assert len(quote_value(deep)) <= 60


def test_valid_words_are_listed_as_far_as_they_are_read():
    told = nearest("ab" * 2000, [f"line {k:03}" for k in range(500)] + ["z" * 3000])
    assert told.endswith("line 039 and 461 more")
    assert nearest("wiast", ["waist", "hip"]) == "did you mean 'waist'? valid: hip, waist"
    assert len(nearest("zz", ["z" * 3000])) < 200


# --- names


@pytest.mark.parametrize("control", CONTROLS)
def test_no_name_has_a_control_character(control: str):
    name = f"centre{control}front"
    with pytest.raises(InputError, match="control character"):
        check_label(name, "line")
    assert plain_label(name) == "centre_front"
    dome = make_shape("dome", resolution=5)
    with pytest.raises(InputError, match="control character"):
        with_lines(dome, {name: np.array([0, 1])})
    with pytest.raises(InputError, match="control character"):
        make_surface(dome.vertices, dome.faces, lines={name: np.array([0, 1])})
    corners = 0.2 * np.array([(0, 0), (1, 0), (1, 1), (0, 1), (0, 0)])
    edges = [Edge(name=f"{i}{name if i == 2 else ''}", points=corners[i : i + 2]) for i in range(4)]
    with pytest.raises(InputError, match="control character"):
        Piece(name="p", edges=edges)


@pytest.mark.parametrize("name", ["", " ", 3, None])
def test_an_edge_has_a_name(name: Any):
    with pytest.raises(InputError, match="is no name"):
        check_label(name, "edge")


@pytest.mark.parametrize("name", ["centre front", "Saumlänge", "دامن", "نمی‌خواهم", "裁片", "x" * 3000])
def test_letters_of_every_script_are_no_control_characters(name: str):
    assert check_label(name, "line") == plain_label(name) == name


@pytest.mark.parametrize("control", CONTROLS)
def test_an_svg_is_xml_whatever_is_written_into_it(tmp_path: Path, control: str):
    page = SvgPage(0.1, 0.1, f"a{control}b")
    ET.SubElement(page.root, "g", {"data-piece": f"a{control}b"}).text = f"a{control}b"
    page.write(tmp_path / "page.svg")
    root = ET.parse(tmp_path / "page.svg").getroot()
    assert root.find("{*}title").text == root[-1].get("data-piece") == root[-1].text == "a\ufffdb"


def test_a_dxf_has_every_text_in_one_line(tmp_path: Path, pattern: dict[str, Any]):
    piece = square(fabric="a\r\nb\x01\u202ec")
    write_dxf(draft_garment(Pattern(name="p", pieces={"": [piece]})), tmp_path / "p.dxf")
    assert b"FABRIC: a??b??c" in (tmp_path / "p.dxf").read_bytes()
    assert ezdxf.readfile(tmp_path / "p.dxf").blocks.get("P")


# --- TOML

BAD_TOML = {
    "digits": (f"[surface]\nshape = 'dome'\nresolution = {DIGITS}\n", "thousands of digits"),
    "hexadecimal digits": (f"[surface]\nshape = 'dome'\nresolution = 0x{DIGITS}\n", "surface.resolution: .* is too large"),
    "not 64 bits": ("[relax]\nmax_steps = 9223372036854775808\n", "relax.max_steps: 9223372036854775808 is too large"),
    "lists in lists": (f"a = {'[' * 5000}{']' * 5000}", "nested too deeply"),
    "keys in keys": ("a" + ".a" * 5000 + " = 1", "nested too deeply"),
    "a control character in a key": ('[lines]\n"a\\u0001b" = 1\n', r"lines.a\\x01b: the key has the control character"),
    "one that turns the writing": ('name = "a\\u202Eb"\n', r"name: 'a\\u202eb' has the control character"),
    "infinite": ("grain_angle = inf\n[surface]\nshape = 'dome'\n", "grain_angle: "),
    "not a number": ("[surface]\nshape = 'dome'\nsize = nan\n", "size = nan; must lie between"),
    "a normal that overflows": (
        "[surface]\nshape = 'dome'\n[lines.a.plane]\npoint = [0, 0, 0]\nnormal = [1e308, 0, 0]\n", "less than or equal to"
    ),
    "ruled is a number": ("mannequin.size = 'EU 38'\nform = { like = 'skirt', ruled = 3 }\n", "ruled = 3: a list of pairs"),
    "ruled is a table": ("mannequin.size = 'EU 38'\nform = { like = 'skirt', ruled = {} }\n", "ruled = {}: a list of pairs"),
    "ruled is a word": ("mannequin.size = 'EU 38'\nform = { like = 'skirt', ruled = 'hip' }\n", "ruled = 'hip': a list of"),
    "a line with a line break": (
        "[surface]\nshape = 'dome'\nresolution = 5\n[lines]\n\"a\\nb\" = { vertices = [0, 1] }\n", "control character '.n'"
    ),
    "a long word": (f"[surface]\nshape = '{'x' * 3000}'\n", r"x\.\.\.x"),
    "a long key": (f"{'x' * 3000} = 1\n", r"x\.\.\.x"),
}  # fmt: skip


@pytest.mark.parametrize(("text", "message"), BAD_TOML.values(), ids=BAD_TOML)
def test_a_bad_scene_is_told_in_one_line(command: Command, text: str, message: str):
    Path("bad.toml").write_text(text)
    told = command("run", "bad.toml").refusal
    assert re.search(message, told)
    assert len(told) < 1600


def test_a_bad_fabric_file_is_told_in_one_line(command: Command):
    Path("cloth.toml").write_text(f"[mine]\nbase = 'denim'\nshear_stiffness = {DIGITS}\n")
    assert "thousands of digits" in command("fabrics", "--file", "cloth.toml").refusal


def test_texts_of_several_lines_and_large_numbers_are_read(tmp_path: Path):
    file = tmp_path / "fine.toml"
    file.write_text('a = """\none\n\ttwo\n"""\nb = -9223372036854775808\nc = [[[[1]]]]\n')
    assert read_toml(file) == {"a": "one\n\ttwo\n", "b": -(2**63), "c": [[[[1]]]]}


@pytest.mark.filterwarnings("error")
def test_an_allowance_that_nothing_resolves_is_none():
    edges = [replace(edge, allowance=1e-308) for edge in square().edges]
    drafted = drafted_piece(replace(square(), edges=edges))
    np.testing.assert_array_equal(
        drafted.cut_line,
        drafted_piece(replace(square(), edges=[replace(edge, allowance=0.0) for edge in edges])).cut_line,
    )


# --- pattern.json


def square(name: str = "p", **more: Any) -> Piece:
    corners = 0.3 * np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0), (0.0, 0.0)])
    mouth, tip = np.array([(0.12, 0.0), (0.18, 0.0)]), np.array([0.15, 0.1])
    edges = [
        Edge(name="hem left", points=np.array([corners[0], mouth[0]])),
        Edge(name="dart left", points=np.array([mouth[0], tip]), kind="dart"),
        Edge(name="dart right", points=np.array([tip, mouth[1]]), kind="dart"),
        Edge(name="hem right", points=np.array([mouth[1], corners[1]])),
        *(Edge(name=f"e{i}", points=corners[i : i + 2]) for i in (1, 2, 3)),
    ]
    hole = Hole(name="vent", points=0.2 + 0.15 * corners[:4])
    dart = Dart(name="dart", left="dart left", right="dart right")
    lines = {"placement": np.array([(0.05, 0.2), (0.1, 0.2)])}
    return Piece(name=name, edges=edges, darts=[dart], holes=[hole], internal_lines=lines, **more)


@pytest.fixture(scope="module")
def pattern() -> dict[str, Any]:
    """What a `pattern.json` holds that has something under each of its keys."""
    sides = ((SeamSide(piece="p", edge="e1"),), (SeamSide(piece="q", edge="e3", reversed=True),))
    garment = Pattern(
        name="trial", pieces={"": [square("p"), square("q")]}, seams=[Seam(name="side", sides=sides, notches=(0.5,))]
    )
    return json.loads(json.dumps(pattern_json(draft_garment(garment))))


def put(*keys: Any, to: Any) -> Callable[[dict[str, Any]], None]:
    def change(data: dict[str, Any]) -> None:
        for key in keys[:-1]:
            data = data[key]
        data[keys[-1]] = to

    return change


def rename(old: str, new: str, *keys: Any) -> Callable[[dict[str, Any]], None]:
    def change(data: dict[str, Any]) -> None:
        for key in keys:
            data = data[key]
        data[new] = data.pop(old)

    return change


P = ("sizes", "", "p")
EDGE = (*P, "edges", 0)
BAD_PATTERNS = {
    "straight one short": (put(*EDGE, "straight", to=[]), r"p\.edges\[0\]: straight has 0 entries, bezier 1"),
    "bezier empty": (put(*EDGE, "bezier", to=[]), "bezier"),
    "cut_line empty": (put(*P, "cut_line", to=[]), "p.cut_line: .*at least 3"),
    "cut_line infinite": (put(*P, "cut_line", 0, 0, to=float("inf")), "p.cut_line"),
    "line not a number": (put(*EDGE, "line", 0, 1, to=float("nan")), r"line\[0\]\[1\]: .*finite"),
    "a coordinate that is too large": (put(*EDGE, "line", 0, 1, to=1e300), r"line\[0\]\[1\]"),
    "cut_line is one point": (put(*P, "cut_line", to=[[0, 0]] * 3), "p.cut_line: encloses no area"),
    "frame of one row": (put(*P, "frame", to=[[1.0, 0.0, 0.0]]), "frame"),
    "an edge is called 3": (put(*EDGE, "name", to=3), r"edges\[0\].name: .*string, got 3"),
    "an edge has no name": (put(*EDGE, "name", to=""), "is no name"),
    "an edge's name turns the writing": (put(*EDGE, "name", to="a\u202eb"), "control character"),
    "a piece's name turns the writing": (rename("p", "\u202e", "sizes", ""), r"control character '\\u202e'"),
    "the pattern is called 1e9": (put("name", to=1e9), "name: .*string"),
    "sample_size unknown": (put("sample_size", to="EU 38"), "EU 38"),
    "no sizes": (put("sizes", to={}), "sizes"),
    "no pieces": (put("sizes", "", to={}), "sizes"),
    "label lines are numbers": (put(*P, "label", "lines", to=[1, 2, 3]), r"label.lines\[0\]"),
    "label has no lines": (put(*P, "label", to={"at": [0, 0], "lines": [], "heights": []}), "label.lines"),
    "label heights are texts": (put(*P, "label", "heights", 0, to="7"), r"label.heights\[0\]"),
    "label heights one short": (put(*P, "label", "heights", to=[0.007]), "heights has 1 entries"),
    "label at is a number": (put(*P, "label", "at", to=3), "label.at"),
    "label angle is a text": (put(*P, "label", "angle", to="0"), "label.angle"),
    "leader of one point": (put(*P, "label", "leader", to=[[0, 0]]), "label.leader"),
    "quantity is a half": (put(*P, "quantity", to=0.5), "quantity"),
    "quantity is true": (put(*P, "quantity", to=True), "quantity"),
    "notes are a text": (put(*P, "notes", to="note"), "notes"),
    "notch without base": (put(*P, "notches", to=[{}]), r"notches\[0\]"),
    "mesh_vertices one short": (put(*EDGE, "mesh_vertices", to=[0]), "mesh_vertices has 1 entries"),
    "mesh_vertices beyond 32 bits": (put(*EDGE, "mesh_vertices", to=[2**40, 1]), "mesh_vertices"),
    "fold_to unknown": (put(*P, "darts", 0, "fold_to", to="up"), "fold_to"),
    "seam of one side": (put("stitches", 0, "sides", to=[[]]), "sides"),
    "seam lengths are texts": (put("seams", 0, "length_mm", to=["a", "b"]), "length_mm"),
    "schema of thousands of digits": (put("schema", to=[["x" * 3000]]), "schema"),
}


EXPORT = ("export", ".", "--format", "dxf", "--format", "svg", "--format", "pdf", "-q")


@pytest.mark.parametrize(("change", "message"), BAD_PATTERNS.values(), ids=BAD_PATTERNS)
def test_a_damaged_pattern_is_told_in_one_line_and_nothing_is_written(
    command: Command, pattern: dict[str, Any], change: Callable[[dict[str, Any]], None], message: str
):
    data = copy.deepcopy(pattern)
    change(data)
    Path("pattern.json").write_text(json.dumps(data))
    told = command(*EXPORT).refusal
    assert told.startswith("pattern.json: ")
    assert re.search(message, told)
    assert len(told) < 1600


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[" * 100_000, "cannot be read as JSON"),
        ("[" * 100_000 + "]" * 100_000, "cannot be read as JSON"),
        ('{"schema": 1, "sizes": ' + DIGITS + "}", "cannot be read as JSON"),
        ('{"schema": ' + DIGITS[:4000] + ', "sizes": {}}', "has schema"),
        ('{"schema": 1, "sizes": 3}', "name: is missing"),
        ("null", "no pattern of warpflat"),
        ("", "line 1, column 1: is no JSON"),
    ],
    ids=["open lists", "lists", "digits", "schema", "sizes", "null", "empty"],
)
def test_a_file_that_is_no_pattern_is_told_in_one_line(command: Command, text: str, message: str):
    Path("pattern.json").write_text(text)
    told = command(*EXPORT).refusal
    assert told.startswith("pattern.json: ")
    assert message in told


def test_the_pattern_itself_is_exported(command: Command, pattern: dict[str, Any]):
    Path("pattern.json").write_text(json.dumps({**pattern, "of a later version": 1}))
    assert command(*EXPORT).code == 0
    assert {path.name for path in Path().iterdir()} == {"pattern.json", "pattern.pdf", "trial.dxf", "trial.svg"}


# --- command line


@pytest.mark.parametrize(
    "arguments",
    [
        ["flatten", "a\x1b[31m\u202e.obj", "--units", "m"],
        ["flatten", "x" * 3000 + ".obj"],
        ["flatten", "front.obj", "--name", "x" * 3000],
        ["flatten", "front.obj", "--component", DIGITS],
        ["flatten", "front.obj", "--datum", f"{DIGITS},{DIGITS}"],
        ["flatten", "front.obj", "--" + "x" * 3000],
        ["mannequin", "--measure", "x" * 3000 + "=0.9"],
        ["mannequin", "--measure", "bust=1e400"],
        ["mannequin", "--size", "EU 38", "--measure", "\x1b=0.9"],
        ["fabrics", "x" * 3000],
    ],
)
def test_odd_words_on_the_command_line_are_told_in_one_line(arguments: list[str], command: Command):
    assert 0 < len(command(*arguments).refusal) < 1600


def test_the_help_names_every_format_that_is_read(command: Command):
    from warpflat.flat.surface.io.read import SUFFIXES

    told = command("flatten", "--help").out.lower()
    usd = {".usd", ".usda", ".usdc", ".usdz"}
    assert [suffix for suffix in SUFFIXES if suffix not in usd and suffix[1:] not in told] == []
    assert "usd" in told
