"""SVG in true size with a name for every edge; JSON with everything."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from dataclasses import replace
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from warpflat.core.errors import InputError
from warpflat.pattern.drafting.marker import Cloth, make_marker
from warpflat.pattern.export.dxf import write_dxf
from warpflat.pattern.export.garmentcode import write_garmentcode
from warpflat.pattern.export.pattern_json import pattern_json, read_pattern_json, write_pattern_json
from warpflat.pattern.export.pdf import write_pdf
from warpflat.pattern.export.plt import write_plt
from warpflat.pattern.export.svg import STYLE, write_marker_svg, write_svg

SVG = "{http://www.w3.org/2000/svg}"
CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)


@pytest.fixture(scope="module")
def svg(dress, tmp_path_factory):
    path = tmp_path_factory.mktemp("svg") / "dress.svg"
    write_svg(dress, path)
    return path


def coordinates(path):
    """End points of all commands of a path of absolute M, L and C."""
    numbers = np.array([float(n) for n in re.findall(r"-?\d+(?:\.\d+)?", path.get("d"))]).reshape(-1, 2)
    return numbers[[0, -1]], numbers


def test_the_page_is_in_millimetres(svg):
    root = ET.parse(svg).getroot()
    width, height = (float(root.get(k).removesuffix("mm")) for k in ("width", "height"))
    assert root.get("viewBox") == f"0 0 {root.get('width')[:-2]} {root.get('height')[:-2]}"
    _, all_points = coordinates(root.find(f".//{SVG}path[@class='cut']"))
    assert all_points.min() >= 0
    assert (all_points <= [width, height]).all()


def test_a_group_per_piece_and_size_and_an_id_per_edge(dress, svg):
    root = ET.parse(svg).getroot()
    ids = [e.get("id") for e in root.iter() if e.get("id")]
    assert len(ids) == len(set(ids))
    groups = {(g.get("data-piece"), g.get("data-size")): g for g in root.findall(f"{SVG}g")}
    assert len(groups) == 10
    for size, pieces in dress.pieces.items():
        for piece in pieces:
            group = groups[piece.name, size]
            names = {p.get("data-edge") for p in group.findall(f"{SVG}path")}
            assert {e.name for e in piece.edges} <= names
            assert group.get("id") == f"{piece.name}-{size}".replace(" ", "_")
            assert f"{group.get('id')}.{piece.edges[0].name}" in ids


def test_every_edge_keeps_its_shape_to_a_hundredth_of_a_millimetre(dress, svg):
    root = ET.parse(svg).getroot()
    for piece in dress.pieces["38"]:
        (group,) = (g for g in root if g.get("data-piece") == piece.name and g.get("data-size") == "38")
        paths = {p.get("data-edge"): p for p in group.findall(f"{SVG}path")}
        _, cut = coordinates(paths["cut"])
        turned = cut * [1, -1]
        shift = turned.min(axis=0) - piece.cut_line.min(axis=0) * 1000
        for edge in piece.edges:
            ends, _ = coordinates(paths[edge.name])
            assert np.abs(ends * [1, -1] - shift - edge.line[[0, -1]] * 1000).max() < 0.01


def test_nested_sizes_lie_upon_each_other(dress, tmp_path):
    write_svg(dress, tmp_path / "nest.svg")
    root = ET.parse(tmp_path / "nest.svg").getroot()
    groups = [g for g in root.findall(f"{SVG}g") if g.get("data-piece") == "skirt front"]
    boxes = [coordinates(g.find(f"{SVG}path[@class='cut']"))[1] for g in groups]
    assert len(boxes) == 2
    assert np.abs(boxes[0].min(axis=0)[0] - boxes[1].min(axis=0)[0]) < 0.01, "the fold is the fixed line of grading"
    assert boxes[1][:, 0].max() - boxes[0][:, 0].max() == pytest.approx(10, abs=0.5)
    texts = [t.text for t in root.iter(f"{SVG}text")]
    assert "Sizes 36, 38" in texts
    # Sewing lines would be a thicket in a nest; they keep their names and are not displayed.
    side = [p for p in groups[1].findall(f"{SVG}path") if p.get("data-edge") == "side"]
    assert [p.get("display") for p in side] == ["none"]
    assert all(p.get("display") is None for p in groups[1].findall(f"{SVG}path") if p.get("class") == "cut")


def test_the_marker_is_drawn_in_true_size(dress, tmp_path):
    plan = make_marker(dress, Cloth(width=1.4), sizes={"38": 1}, seconds=1)
    write_marker_svg(plan, tmp_path / "marker.svg")
    root = ET.parse(tmp_path / "marker.svg").getroot()
    # The cloth, and above it a band with what it is.
    cloth = next(path for path in root.findall(f"{SVG}path") if path.get("id") == "cloth.cloth")
    corners = np.array([float(x) for x in re.findall(r"-?[\d.]+", cloth.get("d"))]).reshape(-1, 2)
    np.testing.assert_allclose(np.ptp(corners, axis=0), [plan.length * 1000, 1400.0], atol=1e-3)
    assert float(root.get("height")[:-2]) == pytest.approx(corners[:, 1].max())
    words = [text.text for text in root.findall(f"{SVG}text")]
    assert words == [
        "Sample dress marker",
        "8 pieces, size 38",
        f"{plan.length:.3f} m of cloth 1.400 m wide, {plan.utilisation:.1%} used",
    ]
    assert float(root.get("width")[:-2]) == pytest.approx(plan.length * 1000, abs=1e-3)
    assert len(root.findall(f"{SVG}g")) == 8


@pytest.mark.skipif(CHROMIUM is None, reason="chromium is not installed: no browser opens the SVG")
def test_a_browser_shows_the_right_size(dress, svg, tmp_path):
    script = (
        "<script>addEventListener('load', () => { const box = e => e.getBoundingClientRect();"
        " const s = box(document.querySelector('svg')), c = box(document.getElementById('skirt_front-38.cut'));"
        " document.title = `size ${s.width} ${s.height} ${c.width} ${c.height}`; });</script>"
    )
    body = svg.read_text(encoding="utf-8").split("?>", 1)[1]
    page = tmp_path / "page.html"
    page.write_text(f"<!doctype html><meta charset=utf-8><body style='margin:0'>{body}{script}", encoding="utf-8")
    quiet = ("quic", "background-networking", "component-update", "sync", "gpu")
    command = [CHROMIUM, "--headless", "--no-sandbox", "--no-first-run", *(f"--disable-{each}" for each in quiet)]
    command += [f"--user-data-dir={tmp_path / 'profile'}", "--dump-dom", page.as_uri()]
    shown = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True).stdout
    seen = [float(pixels) / 96 * 25.4 for pixels in re.search(r"<title>size ([\d. ]+)</title>", shown).group(1).split()]
    root = ET.parse(svg).getroot()
    assert seen[:2] == pytest.approx([float(root.get(side)[:-2]) for side in ("width", "height")], abs=0.1)
    (piece,) = (piece for piece in dress.pieces["38"] if piece.name == "skirt front")
    assert seen[2:] == pytest.approx(np.ptp(piece.cut_line, axis=0) * 1000, abs=0.1), "the piece, in true size"


@pytest.mark.skipif(
    shutil.which("inkscape") is None, reason="inkscape is not installed: no drawing program opens the SVG"
)
def test_a_drawing_program_shows_the_right_size(dress, svg):
    sizes = []
    for side in ("width", "height"):
        query = ["inkscape", "--query-id=skirt_front-38.cut", f"--query-{side}", str(svg)]
        told = subprocess.run(query, capture_output=True, text=True, timeout=120, check=True).stdout
        sizes.append(float(told.split()[-1]) / 96 * 25.4)
    (piece,) = (piece for piece in dress.pieces["38"] if piece.name == "skirt front")
    line = STYLE["cut"][1]
    assert sizes == pytest.approx(np.ptp(piece.cut_line, axis=0) * 1000 + line, abs=0.2), "with its line's width"


def test_json_holds_every_edge_stitch_and_the_map_to_the_mesh(dress, tmp_path):
    write_pattern_json(dress, tmp_path / "pattern.json")
    data = json.loads((tmp_path / "pattern.json").read_text(encoding="utf-8"))
    assert data == json.loads(json.dumps(pattern_json(dress)))
    assert set(data["sizes"]) == {"36", "38"}
    front = data["sizes"]["38"]["front bodice"]
    assert [e["name"] for e in front["edges"]][:3] == ["waist_inner", "waist_dart_left", "waist_dart_right"]
    assert front["on_fold"] is True
    for edge, drafted in zip(front["edges"], dress.pieces["38"][0].edges, strict=True):
        assert np.array_equal(edge["line"], drafted.line)
        assert edge["length"] == drafted.length
        assert edge["mesh_vertices"] is None
    armhole = next(s for s in data["stitches"] if s["name"] == "armhole")
    assert armhole["sides"][0][1] == {"piece": "back bodice", "edge": "armhole", "reversed": True, "mirrored": False}
    darts = [s for s in data["stitches"] if s["kind"] == "dart"]
    assert {s["name"] for s in darts} == {"front bodice.waist_dart", "front bodice.bust_dart", "back bodice.waist_dart"}
    assert all(abs(s["difference_mm"]) < 0.5 and s["matches"] for s in data["seams"])


def test_stitched_sides_run_the_same_way(dress):
    """Both sides of a dart begin at the border and end in the tip; a seam's chains are connected where they are one."""
    data = pattern_json(dress)
    for stitch in (s for s in data["stitches"] if s["kind"] == "dart"):
        ends = []
        for ((part,),) in ([side] for side in stitch["sides"]):
            edges = {e["name"]: e for e in data["sizes"]["38"][part["piece"]]["edges"]}
            line = edges[part["edge"]]["line"]
            ends.append((line[::-1] if part["reversed"] else line)[-1])
        assert ends[0] == pytest.approx(ends[1])


def test_the_frame_leads_from_the_piece_to_the_drawing(dress):
    for piece in dress.pieces["38"]:
        data = pattern_json(dress)["sizes"]["38"][piece.name]
        frame = np.array(data["frame"])
        moved = piece.piece.edges[0].points[0] @ frame[:, :2].T + frame[:, 2]
        assert data["edges"][0]["line"][0] == pytest.approx(moved.tolist())


@pytest.mark.parametrize("size", ["39", "38"])
def test_a_size_that_is_not_drafted_is_refused(dress, size, tmp_path):
    drafted = replace(dress, pieces={"36": dress.pieces["36"]})
    for write, ending in ((write_svg, "svg"), (write_dxf, "dxf"), (write_plt, "plt"), (write_pdf, "pdf")):
        with pytest.raises(InputError, match=f"no size '{size}'"):
            write(drafted, tmp_path / f"p.{ending}", sizes=[size])
    with pytest.raises(InputError, match=f"no size '{size}'"):
        write_dxf(drafted, tmp_path / "p.dxf", sizes=[size, "36"], rul=tmp_path / "p.rul")
    with pytest.raises(InputError, match=f"no size '{size}'"):
        write_garmentcode(drafted, tmp_path / "p.json", size=size)
    assert list(tmp_path.iterdir()) == []


def test_what_is_drafted_of_some_sizes_is_read_back(dress, tmp_path):
    assert dress.sample == "38"
    write_pattern_json(dress.of_sizes(["36"]), tmp_path / "pattern.json")
    assert read_pattern_json(tmp_path / "pattern.json").sample == "36"
