"""DXF read back: outline, notches and grain in millimetres, on the layers that apparel CAD expects."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from itertools import pairwise
from xml.etree import ElementTree as ET

import ezdxf
import numpy as np
import pytest
from polygons import sides
from sample_dress import sample_dress
from scipy.spatial import KDTree
from shapely.geometry import LinearRing, Point

from warpflat.core.errors import InputError
from warpflat.pattern.drafting.draft import draft_garment
from warpflat.pattern.drafting.piece_parts import Edge
from warpflat.pattern.drafting.pieces import Pattern, Piece
from warpflat.pattern.drafting.seam_words import seam_words
from warpflat.pattern.export.dxf import block_name, write_dxf

SIZES = ("36", "38", "40")


@pytest.fixture(scope="module", autouse=True)
def created():
    """All files of these tests say that they were written on 17 May 2024 at 9:30 UTC."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SOURCE_DATE_EPOCH", "1715938200")
        yield


@pytest.fixture(scope="module")
def dress():
    return draft_garment(sample_dress(SIZES))


@pytest.fixture(scope="module", params=["aama", "astm"])
def file(dress, request, tmp_path_factory):
    path = tmp_path_factory.mktemp("dxf") / "dress.dxf"
    write_dxf(dress, path, dialect=request.param)
    return path, request.param, ezdxf.readfile(path)


def points(block, layer):
    return np.array([tuple(e.dxf.location)[:2] for e in block.query(f'POINT[layer=="{layer}"]')])


def vertices(polyline):
    return np.array([tuple(v.dxf.location)[:2] for v in polyline.vertices])


def test_one_block_and_one_insert_per_piece_and_size(dress, file):
    document = file[2]
    blocks = {b.name for b in document.blocks if not b.name.startswith("*")}
    assert blocks == {f"{p.name.upper().replace(' ', '_')}_{s}" for s in SIZES for p in dress.pieces[s]}
    inserts = document.modelspace().query("INSERT")
    assert {i.dxf.name for i in inserts} == blocks
    assert len(inserts) == len(blocks)
    assert {i.dxf.layer for i in inserts} == {"1"}


def test_outline_notches_grain_and_drills_come_back_within_a_hundredth_of_a_millimetre(dress, file):
    document = file[2]
    for size in SIZES:
        for piece in dress.pieces[size]:
            block = document.blocks.get(block_name(piece, set()))
            (boundary,) = block.query('POLYLINE[layer=="1"]')
            assert boundary.is_closed
            back = vertices(boundary)
            assert len(back) == len(piece.cut_line)
            start = np.linalg.norm(piece.cut_line * 1000 - back[0], axis=1).argmin()
            assert np.abs(back - np.roll(piece.cut_line, -start, axis=0) * 1000).max() < 0.01
            bases = np.array([base for notch in piece.notches for base in notch.base]) * 1000
            assert np.abs(points(block, "4") - bases).max() < 0.01
            (grain,) = block.query('LINE[layer=="7"]')
            ends = np.array([tuple(grain.dxf.start)[:2], tuple(grain.dxf.end)[:2]])
            assert np.abs(ends - piece.grain * 1000).max() < 0.01
            if piece.drill_holes:
                assert np.abs(points(block, "13") - [h.at * 1000 for h in piece.drill_holes]).max() < 0.01


def test_notches_carry_their_angle_and_depth(dress, file):
    document = file[2]
    (piece,) = (p for p in dress.pieces["38"] if p.name == "sleeve")
    block = document.blocks.get("SLEEVE_38")
    slits = [(notch, base) for notch in piece.notches for base in notch.base]
    for entity, (notch, _) in zip(block.query('POINT[layer=="4"]'), slits, strict=True):
        angle = np.radians(entity.dxf.angle)
        assert np.array([np.cos(angle), np.sin(angle)]) == pytest.approx(notch.direction, abs=1e-6)
        assert entity.dxf.location.z == pytest.approx(notch.depth * 1000)
    assert sum(notch.double for notch in piece.notches) == 1


def test_every_boundary_vertex_is_a_turn_or_a_curve_point(file):
    block = file[2].blocks.get("FRONT_BODICE_38")
    (boundary,) = block.query('POLYLINE[layer=="1"]')
    turn, curve = points(block, "2"), points(block, "3")
    assert len(turn) + len(curve) == len(boundary.vertices)
    assert 10 <= len(turn) <= 20
    assert np.abs(turn - vertices(boundary)[0]).sum(axis=1).min() < 1e-9, "the boundary begins in a turn point"
    ring = LinearRing(vertices(boundary))
    assert max(ring.distance(Point(p)) for p in np.concatenate([turn, curve])) < 1e-9


def test_sewing_lines_and_mirror_line_keep_their_names(dress, file):
    document = file[2]
    (piece,) = (p for p in dress.pieces["38"] if p.name == "front bodice")
    block = document.blocks.get("FRONT_BODICE_38")
    named = {t.dxf.text for t in block.query('TEXT[layer=="15"]')}
    sewn = {f"SEAM: {w}" for (p, _), rows in seam_words(dress.pattern.seams).items() if p == piece.name for w in rows}
    assert sewn
    assert piece.internal_lines
    inner = {f"LINE: {name}" for name in piece.internal_lines} | {f"DART: {d.dart.name}" for d in piece.darts}
    assert named == {f"EDGE: {e.name}" for e in piece.edges} | inner | sewn
    (mirror,) = block.query('LINE[layer=="6"]')
    assert abs(mirror.dxf.start.x) < 1e-6
    assert abs(mirror.dxf.end.x) < 1e-6
    sewn = [e for e in piece.edges if e.kind not in ("fold", "dart")]
    for polyline, edge in zip(block.query('POLYLINE[layer=="14"]'), sewn, strict=True):
        assert np.abs(vertices(polyline) - edge.line * 1000).max() < 0.01


def test_only_r12_entities_and_no_tables_or_layout_blocks(file):
    path, dialect, _ = file
    text = path.read_text(encoding="ascii")
    tags = [line.strip() for line in text.splitlines()]
    pairs = list(zip(tags[::2], tags[1::2], strict=True))
    entities = {value for code, value in pairs if code == "0"}
    assert entities == {
        *("SECTION", "ENDSEC", "EOF", "BLOCK", "ENDBLK", "INSERT"),
        *("POLYLINE", "VERTEX", "SEQEND", "LINE", "POINT", "TEXT"),
    }
    sections = [b[1] for a, b in pairwise(pairs) if a == ("0", "SECTION")]
    assert sections == ["HEADER", "BLOCKS", "ENTITIES"]
    assert "$MODEL_SPACE" not in text.upper()
    layers = {value for code, value in pairs if code == "8"}
    basic = {"0", "1", "2", "3", "4", "6", "7", "8", "13", "14", "15"}
    assert layers == (basic if dialect == "aama" else basic | {"84", "87"})


def test_texts_name_style_piece_size_and_units(file):
    document = file[2]
    style = [t.dxf.text for t in document.modelspace().query("TEXT")]
    for expected in ("STYLE NAME: Sample dress", "CREATION DATE: 17-05-2024", "UNITS: METRIC", "SAMPLE SIZE: 38"):
        assert expected in style
    piece = [t.dxf.text for t in document.blocks.get("SLEEVE_40").query('TEXT[layer=="1"]')]
    for expected in ("PIECE NAME: sleeve", "SIZE: 40", "QUANTITY: 2", "FABRIC: main"):
        assert expected in piece


def test_the_sample_size_is_one_that_is_written_and_notes_say_what_is_cut(dress, tmp_path):
    write_dxf(dress, tmp_path / "p.dxf", sizes=["36", "40"], rul=tmp_path / "p.rul")
    assert "SAMPLE SIZE: 36" in (tmp_path / "p.dxf").read_text()
    assert "SAMPLE SIZE: 36" in (tmp_path / "p.rul").read_text()
    edges = sides([(0, 0), (0.2, 0), (0.2, 0.2), (0, 0.2)])
    square = Piece(name="square", edges=edges, quantity=3, fabric="twill", also={"interfacing": 1})
    write_dxf(draft_garment(Pattern(name="p", pieces={"": [square]})), tmp_path / "q.dxf")
    written = (tmp_path / "q.dxf").read_text()
    assert "ANNOTATION: Cut 3 - twill" in written
    assert "ANNOTATION: Cut 1 - interfacing" in written


def test_inches(dress, tmp_path):
    write_dxf(dress, tmp_path / "p.dxf", units="english", sizes=["38"])
    document = ezdxf.readfile(tmp_path / "p.dxf")
    (boundary,) = document.blocks.get("SKIRT_BACK_38").query('POLYLINE[layer=="1"]')
    (piece,) = (p for p in dress.pieces["38"] if p.name == "skirt back")
    assert np.ptp(vertices(boundary), axis=0) == pytest.approx(np.ptp(piece.cut_line, axis=0) / 0.0254, abs=4e-4)
    assert "UNITS: ENGLISH" in [t.dxf.text for t in document.modelspace().query("TEXT")]
    assert len([b for b in document.blocks if not b.name.startswith("*")]) == 5


def test_names_in_any_script_give_ascii_blocks_that_differ(tmp_path):
    edges = sides([(0, 0), (0.1, 0), (0.1, 0.1)], names=("é0", "é1", "é2"))
    names = ("Rückenteil links", "Ruckenteil links", "前身頃", "後身頃")
    pieces = [Piece(name=n, edges=edges) for n in names]
    write_dxf(draft_garment(Pattern(name="x", pieces={"": pieces})), tmp_path / "p.dxf")
    blocks = [b.name for b in ezdxf.readfile(tmp_path / "p.dxf").blocks if not b.name.startswith("*")]
    assert blocks == ["RUCKENTEIL_LINKS", "RUCKENTEIL_LINKS_2", "PIECE", "PIECE_2"]


def test_pieces_that_ascii_cannot_name_go_by_their_number_in_every_size(tmp_path):
    edges = sides([(0, 0), (0.1, 0), (0.1, 0.1)], names="012")
    sizes = {s: [Piece(name=n, edges=edges, size=s) for n in ("前身頃", "front", "後身頃")] for s in ("EU 36", "EU 38")}
    write_dxf(draft_garment(Pattern(name="x", pieces=sizes)), tmp_path / "p.dxf")
    document = ezdxf.readfile(tmp_path / "p.dxf")
    told = {
        block.name: next(t.dxf.text for t in block.query("TEXT") if t.dxf.text.startswith("PIECE NAME"))
        for block in document.blocks if not block.name.startswith("*")
    }  # fmt: skip
    names = {"PIECE": "piece", "FRONT": "front", "PIECE_2": "piece 2"}
    assert told == {f"{block}_EU_{n}": f"PIECE NAME: {name}" for block, name in names.items() for n in (36, 38)}


def test_the_same_pattern_gives_the_same_bytes(dress, tmp_path):
    for name in ("a.dxf", "b.dxf"):
        write_dxf(dress, tmp_path / name, sizes=["38"])
    assert (tmp_path / "a.dxf").read_bytes() == (tmp_path / "b.dxf").read_bytes()


@pytest.mark.skipif(
    not (shutil.which("librecad") and shutil.which("pdftocairo")),
    reason="librecad or pdftocairo (poppler) is not installed: no second program reads the DXF",
)
def test_another_cad_program_draws_the_outline_in_true_size(tmp_path):
    """LibreCAD prints the file on A4 in scale 1; poppler says where its lines lie, to the printer's 1200 dots per inch."""
    turn = np.linspace(0, np.pi / 2, 12)[:, None]
    arc = np.array([0.05, 0.12]) + 0.05 * np.column_stack([np.cos(turn), np.sin(turn)])
    corners = np.array([(0.05, 0.17), (0, 0.17), (0, 0), (0.1, 0), (0.1, 0.12)])
    lines = [arc, *(np.stack(pair) for pair in pairwise(corners))]
    piece = Piece(name="cuff", edges=[Edge(name=f"e{i}", points=line) for i, line in enumerate(lines)])
    drafted = draft_garment(Pattern(name="cuff", pieces={"": [piece]}))
    write_dxf(drafted, tmp_path / "cuff.dxf")
    environment = {**os.environ, "QT_QPA_PLATFORM": "offscreen"}
    printing = ["librecad", "dxf2pdf", "-c", "-s", "1", "cuff.dxf"]
    subprocess.run(printing, cwd=tmp_path, env=environment, check=True, capture_output=True, timeout=60)
    subprocess.run(["pdftocairo", "-svg", "cuff.pdf", "cuff.svg"], cwd=tmp_path, check=True, timeout=60)
    drawn = []
    for path in ET.parse(tmp_path / "cuff.svg").getroot().iter("{http://www.w3.org/2000/svg}path"):
        a, b, c, d, e, f = map(float, re.findall(r"-?[\d.]+", path.get("transform", "matrix(1,0,0,1,0,0)")))
        numbers = np.array(re.findall(r"-?\d+(?:\.\d+)?", path.get("d")), dtype=float).reshape(-1, 2)
        drawn.append((numbers @ [[a, b], [c, d]] + [e, f]) * [25.4 / 72, -25.4 / 72])
    seen = np.unique(np.round(np.concatenate(drawn), 3), axis=0)
    expected = drafted.pieces[""][0].cut_line * 1000
    near = KDTree(seen)
    # Where on the page it lies is the printer's affair: some shift brings every point of the outline to an end of a line.
    shifts = seen[np.newaxis] - expected[0]
    missed = near.query((expected[:, np.newaxis] + shifts).reshape(-1, 2))[0].reshape(len(expected), -1)
    assert missed.max(axis=0).min() < 0.05


def test_unknown_options_say_what_is_valid(dress, tmp_path):
    with pytest.raises(InputError, match="did you mean 'aama'"):
        write_dxf(dress, tmp_path / "p.dxf", dialect="aamma")
    with pytest.raises(InputError, match="valid: english, metric"):
        write_dxf(dress, tmp_path / "p.dxf", units="cm")
    with pytest.raises(InputError, match="no size '50'"):
        write_dxf(dress, tmp_path / "p.dxf", sizes=["50"])
    assert list(tmp_path.iterdir()) == []


def test_a_given_creation_time_gives_the_same_bytes(tmp_path, monkeypatch):
    dress = draft_garment(sample_dress(("38",)))
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1700000000")
    for name in ("a.dxf", "b.dxf"):
        write_dxf(dress, tmp_path / name)
    data = (tmp_path / "a.dxf").read_bytes()
    assert data == (tmp_path / "b.dxf").read_bytes()
    assert b"CREATION DATE: 14-11-2023" in data
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "yesterday")
    with pytest.raises(InputError, match="SOURCE_DATE_EPOCH"):
        write_dxf(dress, tmp_path / "c.dxf")


def test_grade_rules_move_every_numbered_point_to_its_place_in_each_size(dress, tmp_path):
    write_dxf(dress, tmp_path / "dress.dxf", rul=tmp_path / "dress.rul")
    document = ezdxf.readfile(tmp_path / "dress.dxf")
    text = (tmp_path / "dress.rul").read_text()
    (sizes,) = re.findall(r"SIZE LIST: (.+)", text)
    (sample,) = re.findall(r"SAMPLE SIZE: (\S+)", text)
    moves = {
        int(number): np.array(re.findall(r"(-?[\d.]+), *(-?[\d.]+)", body), dtype=float)
        for number, body in re.findall(r"RULE: DELTA (\d+)\n([^R]+?)(?=RULE|END)", text)
    }
    assert sizes.split() == list(SIZES)
    assert np.array_equal(moves[1], np.zeros((3, 2)))
    graded = 0
    for piece in dress.pieces[sample]:
        block = document.blocks.get(block_name(piece, set()))
        for layer in ("2", "4", "13"):
            for numbered in block.query(f'TEXT[layer=="{layer}"]'):
                at, row = np.array(tuple(numbered.dxf.insert)[:2]), moves[int(numbered.dxf.text.removeprefix("# "))]
                for size, move in zip(sizes.split(), row, strict=True):
                    other = next(p for p in dress.pieces[size] if p.name == piece.name)
                    there = document.blocks.get(block_name(other, set()))
                    if layer == "2":
                        (boundary,) = there.query('POLYLINE[layer=="1"]')
                        away = LinearRing(vertices(boundary)).distance(Point(at + move))
                    else:
                        away = np.linalg.norm(points(there, layer) - at - move, axis=1).min()
                    assert away < 0.02, (piece.name, size, layer)
                    graded += 1
    assert graded > 300
    assert "GRADE RULE TABLE: Sample dress" in [e.dxf.text for e in document.modelspace().query("TEXT")]
