"""The pattern files of runs, and the same files written again from `pattern.json`."""

from __future__ import annotations

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import ezdxf
import numpy as np
import pytest
import shapely
from obj_files import write_obj
from polygons import corners_of, drafted_piece, polygon, sides
from polygons import drafted as drafted_alone
from printed import drawn_faults
from sample_dress import sample_dress
from surface_meshes import quads_between

from warpflat.app.cli.main import main
from warpflat.app.scene.load import load_scene
from warpflat.app.scene.run import run_scene
from warpflat.core.errors import InputError
from warpflat.flat.flattening.flatten_piece import flatten
from warpflat.flat.surface.repair.validate import make_surface
from warpflat.flat.surface.shapes import make_shape
from warpflat.garment.construction.form_garment import flatten_form
from warpflat.garment.construction.garment import Garment as Flattened
from warpflat.garment.construction.garment_files import surface_files
from warpflat.garment.construction.to_pattern import check_edge_names, pattern_of_surface
from warpflat.garment.mannequin.forms import FormResult
from warpflat.garment.mannequin.mannequin import Mannequin
from warpflat.pattern.drafting.curves import fit_curve
from warpflat.pattern.drafting.draft import draft_garment
from warpflat.pattern.drafting.drafted import DraftedGarment
from warpflat.pattern.drafting.edge_rules import EdgeRules
from warpflat.pattern.drafting.half_pieces import halved
from warpflat.pattern.drafting.piece_parts import Dart, Edge, Hole
from warpflat.pattern.drafting.pieces import Piece
from warpflat.pattern.drafting.tile_nesting import orders
from warpflat.pattern.export.dxf import write_dxf
from warpflat.pattern.export.pattern_files import PatternOptions, export_patterns
from warpflat.pattern.export.pattern_json import pattern_from_json, pattern_json, read_pattern_json
from warpflat.pattern.export.pdf import draw_sheet, sheet_names, write_pdf
from warpflat.pattern.export.svg import write_svg

NEST = """
name = "skirt"
form = "a_line_skirt"
half = true
[mannequin]
size = "EU 38"
resolution_mm = 40
[pattern]
sizes = ["EU 44", "EU 36"]
hem_mm = 40
allowances_mm = { "front.waist" = 6 }
[output]
frames = 0
picture = false
"""


@pytest.fixture(scope="module")
def nest(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("nest")
    (folder / "scene.toml").write_text(NEST)
    result = run_scene(load_scene(folder / "scene.toml"), folder / "out")
    assert {"skirt.dxf", "skirt.svg", "pattern.pdf", "pattern.json"} <= set(result.files)
    return folder / "out"


@pytest.fixture(scope="module")
def dress() -> DraftedGarment:
    return draft_garment(sample_dress(("38", "40")))


# --- runs


def test_sizes_lie_in_one_file(nest: Path):
    blocks = {block.name for block in ezdxf.readfile(nest / "skirt.dxf").blocks if not block.name.startswith("$")}
    names = {f"{piece}_EU_{size}" for piece in ("FRONT", "BACK") for size in (36, 38, 44)}
    assert names <= blocks
    data = json.loads((nest / "pattern.json").read_text())
    assert list(data["sizes"]) == ["EU 36", "EU 38", "EU 44"]
    assert data["sample_size"] == "EU 38"
    widths = [np.ptp(np.array(pieces["front"]["cut_line"])[:, 0]) for pieces in data["sizes"].values()]
    assert widths == sorted(widths)
    assert widths[2] - widths[0] > 0.02
    svg = (nest / "skirt.svg").read_text()
    assert all(f'data-size="{size}"' in svg for size in data["sizes"])


@pytest.mark.parametrize("paper", ["A4", "Letter"])
def test_no_label_of_a_nest_is_cut_at_the_edge_of_a_sheet(nest: Path, dress: DraftedGarment, paper: str):
    for garment in (read_pattern_json(nest / "pattern.json"), dress):
        faults, tiling, drawings = drawn_faults(garment, paper)
        assert faults == []
        # A sheet's name lies on no line.
        lines = [
            shapely.LineString(placed.on_sheet(stroke.points))
            for placed, sizes in zip(tiling.sheet.placed, drawings, strict=True)
            for drawing in sizes
            for stroke in drawing.strokes
            if not stroke.hidden
        ]
        for place in sheet_names(tiling, drawings).values():
            assert shapely.distance(shapely.box(*place, *(place + np.array([0.012, 0.0065]))), lines).min() > 0.0


def test_a_sheet_without_a_clear_place_has_its_name_where_most_room_is(
    dress: DraftedGarment, monkeypatch: pytest.MonkeyPatch
):
    # Its names keep off words as well, so that the lay decides how much room is left beside lines.
    monkeypatch.setattr("warpflat.pattern.drafting.tile_nesting.orders", orders)
    tiling, drawings = draw_sheet(halved(dress), "A4")
    lines = shapely.union_all(
        [
            shapely.LineString(placed.on_sheet(stroke.points))
            for placed, sizes in zip(tiling.sheet.placed, drawings, strict=True)
            for drawing in sizes
            for stroke in drawing.strokes
            if not stroke.hidden
        ]
    )

    def room(place: np.ndarray) -> float:
        return float(shapely.distance(shapely.box(*place, *(place + np.array([0.012, 0.0065]))), lines))

    clear = {tile: room(place) for tile, place in sheet_names(tiling, drawings).items()}
    monkeypatch.setattr("warpflat.pattern.export.pdf.NAME_CLEAR", 10.0)
    most = {tile: room(place) for tile, place in sheet_names(tiling, drawings).items()}
    assert all(most[tile] > 0.9 * clear[tile] for tile in clear)
    assert sum(most.values()) > 1.5 * sum(clear.values())


def test_the_scene_sets_allowances(nest: Path):
    pieces = json.loads((nest / "pattern.json").read_text())["sizes"]["EU 38"]
    widths = {(name, e["name"]): e["allowance"] for name, piece in pieces.items() for e in piece["edges"]}
    assert widths["front", "waist"] == 0.006
    assert widths["back", "waist"] == 0.010
    assert widths["front", "knee"] == widths["back", "knee"] == 0.040
    assert widths["front", "centre front"] == 0.0


def test_boundaries_in_the_dxf_are_those_of_the_pattern(nest: Path):
    data = json.loads((nest / "pattern.json").read_text())["sizes"]["EU 36"]["front"]
    block = ezdxf.readfile(nest / "skirt.dxf").blocks.get("FRONT_EU_36")
    (boundary,) = block.query('POLYLINE[layer=="1"]')
    read = shapely.Polygon([(p[0], p[1]) for p in boundary.points()])
    assert read.hausdorff_distance(shapely.Polygon(np.array(data["cut_line"]) * 1000)) < 0.01
    assert len(block.query('POINT[layer=="4"]')) == sum(len(notch["base"]) for notch in data["notches"]) > 0
    assert len(block.query('LINE[layer=="6"]')) == 1, "the fold"


def test_a_surface_is_a_pattern_of_one_piece_and_formats_are_chosen(tmp_path: Path):
    (tmp_path / "cap.toml").write_text(
        "[surface]\nshape = 'dome'\nresolution = 9\n[pattern]\nformats = ['svg', 'json']\n"
        "kinds = { bottom = 'hem' }\n[output]\nframes = 0\npicture = false\n"
    )
    result = run_scene(load_scene(tmp_path / "cap.toml"), tmp_path / "out")
    assert {"cap.svg", "pattern.json"} <= set(result.files)
    assert not {"cap.dxf", "pattern.pdf"} & set(result.files)
    (piece,) = json.loads((tmp_path / "out" / "pattern.json").read_text())["sizes"][""].values()
    assert {e["name"]: e["allowance"] for e in piece["edges"]} == {
        "bottom": 0.03, "right": 0.01, "top": 0.01, "left": 0.01
    }  # fmt: skip
    assert "centre" in piece["internal_lines"]


PARTED = """
datum = "centre"
[surface]
shape = "bodice"
resolution = 17
[[cuts]]
name = "across"
plane = { point = [0.0, 0.1, 0.092], normal = [0.0, 1.0, 0.0] }
[[cuts]]
line = "bust"
part = [0.0, 0.3]
[relax]
residual_tolerance = 0.03
energy_tolerance = 1e-5
[output]
frames = 0
picture = false
[pattern]
formats = ["json"]
"""


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("allowances_mm = { botom = 20 }", r"allowances_mm: no piece has an edge 'botom'; did you mean 'bottom'\?"),
        ("kinds = { 'trial.lower.tpo' = 'hem' }", r"kinds: no piece has an edge 'trial\.lower\.tpo'"),
        # The cut leaves the top to the upper piece.
        ("kinds = { 'trial.lower.top' = 'hem' }", r"kinds: no piece has an edge 'trial\.lower\.top'"),
    ],
)
def test_a_misspelt_edge_of_a_surface_is_told_before_anything_is_flattened(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str, message: str
):
    def too_late(*_: object, **__: object) -> None:
        raise AssertionError("it was flattened first")

    monkeypatch.setattr("warpflat.app.scene.plan.flatten", too_late)
    (tmp_path / "trial.toml").write_text(PARTED + text)
    with pytest.raises(InputError, match=rf"trial\.toml: pattern: {message}"):
        run_scene(load_scene(tmp_path / "trial.toml"), tmp_path / "out")
    assert main(["run", str(tmp_path / "trial.toml"), "--out", str(tmp_path / "out")]) == 2


def test_an_edge_that_the_plane_does_not_show_is_a_note_and_all_else_is_drawn(tmp_path: Path):
    corners = np.array([(0, 0, 0), (0.2, 0, 0), (0.2, 0.3, 0), (0, 0.3, 0)], dtype=float)
    flat = flatten(make_surface(corners, np.array([[0, 1, 2, 3]], dtype=np.int32), name="cloth"))
    rules = EdgeRules(kinds={"edge_7": "hem", "edge_1": "hem"}, allowances={"cloth.edge_9": 0.02, "edge_2": 0.007})
    check_edge_names([flat.surface], rules)
    written = surface_files([flat], tmp_path, name="cloth", options=PatternOptions(formats=("json",), rules=rules))
    assert written.files == ("pattern.json",)
    assert [note for note in written.notes if "kinds: no piece has an edge 'edge_7'; " in note and "edge_4" in note]
    assert [note for note in written.notes if "allowances_mm: no piece has an edge 'cloth.edge_9'" in note]
    ((piece,),) = read_pattern_json(tmp_path / "pattern.json").pieces.values()
    assert {edge.name: edge.width for edge in piece.edges} == {
        "edge_1": 0.03, "edge_2": 0.007, "edge_3": 0.01, "edge_4": 0.01
    }  # fmt: skip


def test_a_pattern_may_begin_with_a_byte_order_mark(tmp_path: Path):
    corners = np.array([(0, 0, 0), (0.2, 0, 0), (0.2, 0.3, 0), (0, 0.3, 0)], dtype=float)
    flat = flatten(make_surface(corners, np.array([[0, 1, 2, 3]], dtype=np.int32), name="cloth"))
    surface_files([flat], tmp_path, name="cloth", options=PatternOptions(formats=("json",)))
    file = tmp_path / "pattern.json"
    file.write_text(file.read_text(encoding="utf-8"), encoding="utf-8-sig")
    assert len(read_pattern_json(file).pieces[""]) == 1


def test_a_format_or_a_tolerance_that_there_is_not_is_refused(tmp_path: Path):
    flat = flatten(make_shape("dome", resolution=5))
    with pytest.raises(InputError, match="unknown format 'png'; valid: dxf"):
        surface_files([flat], tmp_path, name="dome", options=PatternOptions(formats=("dxf", "png")))
    with pytest.raises(InputError, match=r"tolerance = -1 is no length; give one in metres, such as 1e-4, or None"):
        surface_files([flat], tmp_path, name="dome", options=PatternOptions(tolerance=-1))
    assert not list(tmp_path.iterdir())


def test_every_edge_that_a_cut_surface_has_may_be_named(tmp_path: Path):
    (tmp_path / "trial.toml").write_text(PARTED)
    run_scene(load_scene(tmp_path / "trial.toml"), tmp_path / "out")
    (pieces,) = json.loads((tmp_path / "out" / "pattern.json").read_text())["sizes"].values()
    names = [f"{name}.{edge['name']}" for name, piece in pieces.items() for edge in piece["edges"]]
    assert len(pieces) == 2
    assert any("bust.left" in name for name in names), "a dart"
    (tmp_path / "trial.toml").write_text(
        PARTED + "[pattern.allowances_mm]\n" + "".join(f"'{name}' = 7\n" for name in names)
    )
    ruled = run_scene(load_scene(tmp_path / "trial.toml"), tmp_path / "out")
    assert not [note for note in ruled.notes if "no pattern" in note]
    (pieces,) = json.loads((tmp_path / "out" / "pattern.json").read_text())["sizes"].values()
    plain = {edge["allowance"] for piece in pieces.values() for edge in piece["edges"] if edge["kind"] == "seam"}
    assert plain == {0.007}


def test_a_marker_is_made_when_asked_for(tmp_path: Path):
    (tmp_path / "cap.toml").write_text(
        "[surface]\nshape = 'dome'\nresolution = 9\n[pattern]\nformats = []\n"
        "[marker]\nwidth = 0.9\nseconds = 1\n[output]\nframes = 0\npicture = false\n"
    )
    result = run_scene(load_scene(tmp_path / "cap.toml"), tmp_path / "out")
    assert {"cap.marker.svg", "cap.marker.json"} <= set(result.files)
    marker = json.loads((tmp_path / "out" / "cap.marker.json").read_text())
    assert marker["width_m"] == 0.9
    assert 0.5 < marker["length_m"] < 0.6
    assert len(marker["placements"]) == 1
    metrics = json.loads((tmp_path / "out" / "metrics.json").read_text())
    assert metrics["marker"] == {key: marker[key] for key in metrics["marker"]}
    assert metrics["marker"]["pieces"] == 1
    assert [note for note in result.notes if note.startswith("marker: ") and note.endswith(" used by 1 piece")]
    assert ">1 piece<" in (tmp_path / "out" / "cap.marker.svg").read_text()
    assert metrics["pattern"]["fit_error_mm"] < 0.5
    assert result.metrics["marker"] == metrics["marker"]
    assert any(note.startswith("marker: 0.") and "0.90 m wide" in note for note in result.notes)


def test_mistakes_are_found_before_anything_is_flattened(tmp_path: Path):
    def told(text: str) -> str:
        (tmp_path / "bad.toml").write_text(text)
        with pytest.raises(InputError) as caught:
            run_scene(load_scene(tmp_path / "bad.toml"), tmp_path / "out", on_progress=pytest.fail)
        return str(caught.value)

    assert "'wasit'" in told(NEST.replace('"front.waist"', "wasit"))
    assert "EU 37" in told(NEST.replace("EU 44", "EU 37"))
    assert "pattern.sizes needs" in told("[surface]\nshape = 'dome'\n[pattern]\nsizes = ['EU 38']\n")
    assert "A4" in told("[surface]\nshape = 'dome'\n[pattern]\npaper = 'A5'\n")


def test_what_cannot_be_drawn_is_a_note(tmp_path: Path):
    flat = flatten(make_shape("dome", resolution=7))
    torn = flat.positions.copy()
    torn[0] = torn[-1] + [0.1, 0.1]
    written = surface_files([replace(flat, positions=torn)], tmp_path, name="cap")
    assert written.files == ()
    assert len(written.notes) == 1
    assert "no pattern was drawn" in written.notes[0]
    assert list(tmp_path.iterdir()) == []
    assert written.metrics["pattern"]["not_drawn"] in written.notes[0]


def test_what_lies_over_itself_in_the_plane_is_said_in_the_metrics_and_by_the_exit_code(tmp_path: Path, capfd):
    # A spiral ramp: developed, it goes round by more than a full turn.
    turn, out = np.meshgrid(np.linspace(0, 2.6 * np.pi, 41), np.linspace(0.1, 0.2, 5))
    ramp = np.stack([out * np.cos(turn), out * np.sin(turn), 0.03 * turn], axis=-1).reshape(-1, 3)
    quads = quads_between(turn.shape, turned=True)
    path = write_obj(tmp_path / "ramp.obj", (ramp, quads), digits="")
    parted = ["flatten", str(path), "--units", "m", "--out", str(tmp_path / "out"), "--no-picture"]
    parted += ["--frames", "0"]
    assert main([*parted, "--quiet"]) == 0
    assert capfd.readouterr().err == ""
    arguments = [*parted, "--gap", "0"]
    assert main([*arguments, "--json"]) == 1
    printed = capfd.readouterr()
    why = json.loads(printed.out)["pattern"]["not_drawn"]
    assert re.fullmatch(
        r"piece 'ramp': the outline crosses itself at \(-?[\d.]+, -?[\d.]+\) mm in the plane: flat, the piece lies over itself "
        "there; cut it apart, so that no piece does",
        why,
    )
    over, none = printed.err.splitlines()
    assert re.fullmatch(r"warpflat: ramp lies over itself by [\d.e+]+ mm2; the pattern cannot be cut as it is", over)
    assert none == f"warpflat: no pattern was drawn: {why}"
    assert json.loads((tmp_path / "out" / "metrics.json").read_text())["pattern"] == {"not_drawn": why}
    # Once, not as a note too.
    assert main(arguments) == 1
    assert capfd.readouterr().err.count("no pattern was drawn") == 1


def test_a_ragged_border_gets_a_wider_tolerance_and_says_so(tmp_path: Path):
    flat = flatten(make_shape("dome", size=0.2, resolution=41))
    rim = np.unique(np.concatenate([flat.surface.lines[side] for side in ("left", "right", "top", "bottom")]))
    ragged = flat.positions.copy()
    ragged[rim] += np.random.default_rng(1).normal(0, 4e-4, (len(rim), 2))
    written = surface_files(
        [replace(flat, positions=ragged)], tmp_path, name="cap", options=PatternOptions(formats=("json",))
    )
    assert any("border is ragged" in note for note in written.notes)
    (piece,) = read_pattern_json(tmp_path / "pattern.json").pieces[""]
    assert sum(len(edge.curve.bezier) for edge in piece.edges) < 60


def test_two_ragged_sides_of_a_dart_are_smoothed_alike_and_stay_equally_long():
    """As a cut across a coarse mesh leaves them: each juts out in its own way."""
    random = np.random.default_rng(4)
    share = np.linspace(0, 1, 41)[:, None]
    tip, mouth = np.array([0.2, 0.3]), np.array([0.14, 0.0])
    bow = np.array([-0.02, 0.0]) * np.sin(np.pi * share)
    left = mouth + share * (tip - mouth) + bow
    right = np.array([0.4, 0.0]) * [1, 0] + left * [-1, 1]
    for leg in (left, right):
        leg[1:-1] += random.normal(0, 1e-3, (39, 2))
    corners = np.array([right[0], (0.4, 0.0), (0.4, 0.5), (0.0, 0.5), (0.0, 0.0), left[0]])
    edges = [Edge(name="l", points=left, kind="dart"), Edge(name="r", points=right[::-1], kind="dart")]
    edges += sides(corners, closed=False)
    piece = drafted_piece(Piece(name="p", edges=edges, darts=[Dart(name="d", left="l", right="r", cut=True)]))
    first, second = piece.edge("l"), piece.edge("r")
    assert first.tolerance == second.tolerance > 1e-4
    assert first.length == pytest.approx(second.length, abs=2e-4)
    assert max(len(first.curve.bezier), len(second.curve.bezier)) <= 12 < len(fit_curve(left).bezier)
    assert max(first.fit_error, second.fit_error) < 0.004
    assert [note for note in piece.notes if "legs differ" in note] == []


def with_vent() -> Piece:
    """A square of 300 mm with a square hole of 50 mm."""
    vent = Hole(name="vent", points=np.array(corners_of(0.05, 0.05, 0.1, 0.1)))
    return polygon("p", corners_of(0.3, 0.3), holes=[vent])


def test_holes_have_both_lines_in_every_file(tmp_path: Path):
    drafted = drafted_alone(with_vent())
    read = pattern_from_json(json.loads(json.dumps(pattern_json(drafted))))
    assert pattern_json(read) == pattern_json(drafted)
    for pattern in (drafted, read):
        write_svg(pattern, tmp_path / "p.svg")
        write_dxf(pattern, tmp_path / "p.dxf")
        text = (tmp_path / "p.svg").read_text()
        assert 'vent"' in text
        assert 'vent.sew"' in text
        (block,) = [b for b in ezdxf.readfile(tmp_path / "p.dxf").blocks if b.name == "P"]
        rings = {
            line.dxf.layer: shapely.Polygon([v.dxf.location.vec2 for v in line.vertices]).area
            for line in block.query("POLYLINE")
            if line.is_closed and line.dxf.layer in ("11", "14")
        }
        assert rings == {"11": pytest.approx(30.0**2), "14": pytest.approx(50.0**2)}


def test_files_from_before_holes_had_allowances_are_read(tmp_path: Path):
    data = json.loads(json.dumps(pattern_json(drafted_alone(with_vent()))))
    piece = data["sizes"][""]["p"]
    del piece["cutout_sew_lines"], piece["cutout_allowances"], piece["label"]["angle"], piece["label"]["leader"]
    (read,) = pattern_from_json(data).pieces[""]
    assert read.cutouts["vent"].width == 0.0
    np.testing.assert_array_equal(read.cutouts["vent"].sew_line, piece["cutouts"]["vent"])
    assert read.label.leader is None
    piece["holes"] = piece.pop("cutouts")
    with pytest.raises(InputError, match=r"sizes\..*p\.cutouts: is missing"):
        pattern_from_json(data)


def test_a_label_beside_its_piece_is_in_every_file(tmp_path: Path):
    opening = Hole(name="opening", points=np.array(corners_of(0.192, 0.192, 0.004, 0.004)))
    drafted = drafted_alone(polygon("rim", corners_of(0.2, 0.2), holes=[opening]))
    read = pattern_from_json(json.loads(json.dumps(pattern_json(drafted))))
    assert pattern_json(read) == pattern_json(drafted)
    write_svg(read, tmp_path / "p.svg")
    root = ET.parse(tmp_path / "p.svg").getroot()
    assert len(root.findall(".//{*}path[@class='leader']")) == 1
    name = next(text for text in root.iter("{http://www.w3.org/2000/svg}text") if text.text == "RIM")
    assert 210 < float(name.get("transform")[10:].split()[0]) < float(root.get("width")[:-2])
    tiling = write_pdf(read, tmp_path / "p.pdf")
    columns = {column for _, column in tiling.tiles}
    assert columns == {0, 1}, "the label is printed too"


def test_rules_name_holes():
    dome = make_shape("dome", resolution=17)
    around = np.linalg.norm(dome.vertices[dome.faces].mean(axis=1)[:, :2], axis=1) > 0.06
    flat = flatten(make_surface(dome.vertices, dome.faces[around], name="ring"), fabric="woven")
    for rules, width in (
        (EdgeRules(), 0.010),
        (EdgeRules(seam=0.006), 0.006),
        (EdgeRules(allowances={"hole_1": 0.004}), 0.004),
        (EdgeRules(kinds={"hole_1": "cut"}), 0.0),
    ):
        pattern, _ = pattern_of_surface([flat], name="p", rules=rules)
        ((piece,),) = draft_garment(pattern).pieces.values()
        assert piece.cutouts["hole_1"].width == width
    check_edge_names([flat.surface], EdgeRules(allowances={"hole_1": 0.004}))
    with pytest.raises(InputError, match="no piece has an edge 'hole_2'"):
        check_edge_names([flat.surface], EdgeRules(allowances={"hole_2": 0.004}))
    with pytest.raises(InputError, match=r"kinds\.hole_1: a hole cannot be of kind 'fold'"):
        pattern_of_surface([flat], name="p", rules=EdgeRules(kinds={"hole_1": "fold"}))


# --- once more, from pattern.json


def test_an_edge_read_back_is_the_line_and_keeps_its_map_to_the_mesh():
    pattern, _ = pattern_of_surface([flatten(make_shape("dome", resolution=9), fabric="woven")], name="p")
    drafted = draft_garment(pattern)
    read = pattern_from_json(json.loads(json.dumps(pattern_json(drafted))))
    assert pattern_json(read) == pattern_json(drafted)
    for edge in read.pieces[""][0].edges:
        assert edge.edge.vertices is None
        assert len(edge.edge.points) == len(edge.line) > len(edge.places) == len(edge.mesh_vertices)


def test_a_pattern_read_back_makes_the_same_files(
    dress: DraftedGarment, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1767225600")
    read = pattern_from_json(json.loads(json.dumps(pattern_json(dress))))
    assert pattern_json(read) == pattern_json(dress)
    for number, pattern in enumerate((dress, read)):
        write_svg(pattern, tmp_path / f"{number}.svg")
        write_dxf(pattern, tmp_path / f"{number}.dxf", dialect="astm")
    assert (tmp_path / "0.svg").read_text() == (tmp_path / "1.svg").read_text()
    assert (tmp_path / "0.dxf").read_text() == (tmp_path / "1.dxf").read_text()


def test_export_redoes_one_file(nest: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    folder = tmp_path / "run"
    shutil.copytree(nest, folder)
    (folder / "skirt.dxf").unlink()
    assert main(["export", str(folder), "--format", "dxf", "--dialect", "astm", "--size", "EU 36"]) == 0
    assert "skirt.dxf" in capsys.readouterr().out
    document = ezdxf.readfile(folder / "skirt.dxf")
    assert document.blocks.get("FRONT_EU_36").query('POLYLINE[layer=="84"]'), "ASTM's validation curves"
    assert "FRONT_EU_44" not in document.blocks
    before = (folder / "pattern.pdf").read_bytes()
    assert main(["export", str(folder), "--format", "pdf", "--paper", "Letter", "-q"]) == 0
    assert capsys.readouterr().out == ""
    assert (folder / "pattern.pdf").read_bytes() != before


def test_one_size_of_what_the_others_are_made_from_is_refused(
    nest: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    folder = tmp_path / "run"
    shutil.copytree(nest, folder)
    before = (folder / "pattern.json").read_bytes()
    assert main(["export", str(folder), "--format", "json", "--size", "EU 36"]) == 2
    assert "holds all sizes" in capsys.readouterr().err
    assert (folder / "pattern.json").read_bytes() == before
    assert main(["export", str(folder), "--format", "json"]) == 0


def test_another_size_that_went_wrong_is_a_warning(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    def flattened(mannequin: Mannequin, form: FormResult, **given: Any) -> Flattened:
        garment = flatten_form(mannequin, form, **given)
        if "EU 44" not in mannequin.source:
            return garment
        front, back = garment.pieces.values()
        last = replace(front.stages[-1], converged=False)
        front = replace(front, stages=(*front.stages[:-1], last))
        back = replace(back, positions=back.positions * [-1.0, 1.0])
        return replace(garment, pieces={"front": front, "back": back})

    monkeypatch.setattr("warpflat.app.scene.plan.flatten_form", flattened)
    (tmp_path / "scene.toml").write_text("curves_mm = 0\n" + NEST.replace("[pattern]", "[pattern]\nformats = ['svg']"))
    assert main(["run", str(tmp_path / "scene.toml"), "--out", str(tmp_path / "out"), "--quiet"]) == 1
    warnings = capsys.readouterr().err.splitlines()
    assert len(warnings) == 3
    assert warnings[2].startswith("warpflat: no pattern was drawn: piece 'back' size EU 44: ")
    assert warnings[0].startswith("warpflat: size EU 44: front did not converge within ")
    assert re.match(r"warpflat: size EU 44: back has \d+ flipped faces; the pattern cannot be cut", warnings[1])
    sizes = json.loads((tmp_path / "out" / "metrics.json").read_text())["sizes"]
    assert {size: [piece["converged"] for piece in of["pieces"].values()] for size, of in sizes.items()} == {
        "EU 44": [False, True],
        "EU 36": [True, True],
    }
    assert sizes["EU 44"]["pieces"]["back"]["flipped_faces"] > 0
    assert sizes["EU 36"]["sewing"]["converged"]


def test_a_size_of_a_pattern_without_sizes_is_told(tmp_path: Path):
    drafted = drafted_alone(polygon("plain", corners_of(0.3, 0.3)))
    (tmp_path / "pattern.json").write_text(json.dumps(pattern_json(drafted)))
    for kind in ("dxf", "svg", "pdf"):
        with pytest.raises(InputError, match="garment 'p' has no sizes: it is not graded"):
            export_patterns(tmp_path, [kind], sizes=["EU 38"])


def test_a_folder_without_a_pattern_and_unknown_formats(tmp_path: Path):
    with pytest.raises(InputError, match="no such file"):
        export_patterns(tmp_path, ["svg"])
    with pytest.raises(InputError, match="unknown format 'dwg'"):
        export_patterns(tmp_path, ["dwg"])
