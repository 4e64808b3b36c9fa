"""`warpflat drape` with a pattern's file."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from polygons import corners_of, drafted, polygon, sewn

from warpflat.app.cli.main import main
from warpflat.pattern.drafting.drafted import DraftedGarment
from warpflat.pattern.export.pattern_json import write_pattern_json
from warpflat.pattern.export.read_svg import read_svg
from warpflat.pattern.export.svg import write_svg


def tube_of(name: str, width: float, height: float) -> DraftedGarment:
    """Two equal rectangles and their side seams."""
    pieces = [polygon(name, corners_of(width, height), first=1) for name in ("front", "back")]
    seams = [sewn(f"{a}.e2", f"{b}.e4", f"side {a}") for a, b in (("front", "back"), ("back", "front"))]
    return drafted(*pieces, seams=seams, name=name)


@pytest.fixture
def tube(tmp_path: Path) -> Path:
    write_svg(tube_of("tube", 0.5, 0.25), tmp_path / "tube.svg")
    return tmp_path / "tube.svg"


def test_a_drawing_is_draped(tube: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    table = tmp_path / "worn.toml"
    table.write_text('spacing_mm = 40\n[mannequin]\nsize = "EU 38"\nresolution_mm = 40.0\n[drape]\nmax_steps = 100\n')
    out = tmp_path / "out"
    assert main(["drape", str(tube), "--seams", str(table), "--out", str(out), "--usd", "--correct"]) == 1
    printed = capsys.readouterr()
    # The drape is kept; the correction needs one at rest.
    assert "the pattern was not corrected, as the drape is not at rest" in printed.err
    assert "the drape is not at rest after 100 steps" in printed.err
    # As of a scene, notes are one line without -v, and all of them with it.
    assert "; -v lists them" in printed.err
    assert len(printed.err.splitlines()) == 2
    assert printed.out.startswith("does not fit as draped: the draped cloth is not at rest\n")
    names = {"back.draped.obj", "drape.png", "drape.webp", "frames.usdc", "front.draped.obj", "metrics.json"}
    names |= {"worn.usdc"}
    assert {path.name for path in out.iterdir()} == names
    assert json.loads((out / "metrics.json").read_text())["drape"]["compared_with"] == "body"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["nothing.svg"], "nothing.svg: no such file"),
        (["tube.svg"], 'says nothing of a body; give --body "EU 38"'),
        (["tube.svg", "--body", "EU 3"], "--body: "),
        (["scene.toml", "--fabric", "denim"], "--fabric: is for a pattern's file"),
        (["."], "pattern.json: no such file"),
    ],
)
def test_a_mistake_is_one_line(
    tube: Path, arguments: list[str], message: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    monkeypatch.chdir(tube.parent)
    assert main(["drape", *arguments]) == 2
    error = capsys.readouterr().err.strip()
    assert message in error
    assert "\n" not in error


def test_the_scan_of_a_sewing_file_starts_in_its_folder(tube: Path, capsys: pytest.CaptureFixture[str]):
    table = tube.with_name("worn.toml")
    table.write_text('[mannequin]\nscan = "gone.obj"\n')
    assert main(["drape", str(tube), "--seams", str(table)]) == 2
    assert str(tube.with_name("gone.obj")) in capsys.readouterr().err
    # What it cannot ask for is refused.
    table.write_text('[drape]\ncorrect_fabric = "denim"\n')
    assert main(["drape", str(tube), "--seams", str(table), "--body", "EU 38"]) == 2
    assert "drape.correct_fabric belongs to a scene" in " ".join(capsys.readouterr().err.split())


def test_edges_are_listed(tube: Path, capsys: pytest.CaptureFixture[str]):
    assert main(["drape", str(tube), "--edges"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 8
    assert lines[0].startswith("front.e1: 500.0 mm, seam, from (")


def test_quiet_keeps_the_edges_and_leaves_out_the_notes(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    drawing = tmp_path / "drawing.svg"
    drawing.write_text(
        '<svg xmlns="http://www.w3.org/2000/svg" width="500mm" height="400mm" viewBox="0 0 500 400">'
        '<path id="a" d="M20 20 H180 V380 H20 Z"/><path id="b" d="M300 20 H480 V380 H300"/></svg>'
    )
    assert main(["drape", str(drawing), "--edges"]) == 0
    told = capsys.readouterr()
    assert "note: 1 open line was left out: 'b'" in told.err
    assert main(["drape", str(drawing), "--edges", "--quiet"]) == 0
    assert capsys.readouterr() == (told.out, "")


def test_json_of_a_form_is_all_that_is_printed(tmp_path: Path):
    scene = tmp_path / "skirt.toml"
    scene.write_text(
        'form = "a_line_skirt"\n[mannequin]\nsize = "EU 38"\nresolution_mm = 40\n[output]\nframes = 0\npicture = false\n',
        encoding="utf-8",
    )
    # Warp is loaded before the mannequin is built beside, as it is by the modules of a drape.
    words = (
        f"import warp; from warpflat.app.cli.main import main; main(['run', {str(scene)!r}, '--json', '--out', 'out'])"
    )
    ended = subprocess.run([sys.executable, "-c", words], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert json.loads(ended.stdout)["schema"] == 1
    assert ended.stderr == ""


def test_a_pattern_from_a_file_is_corrected(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    """A tube of 88 cm around a hip of 96 cm, in a cloth that gives 5 %."""
    write_pattern_json(tube_of("narrow", 0.44, 0.2), tmp_path / "narrow.json")
    table, out = tmp_path / "worn.toml", tmp_path / "out"
    table.write_text(
        'spacing_mm = 40\ntop = "hip"\n[mannequin]\nsize = "EU 38"\nresolution_mm = 40.0\n[drape]\ntolerance = 0.05\n'
        "max_steps = 3000\ncorrect = true\n"
    )
    command = ["drape", str(tmp_path / "narrow.json"), "--seams", str(table)]
    assert main([*command, "--out", str(out), "-v"]) == 0
    printed = capsys.readouterr()
    assert "woven is taken" in printed.err
    assert "corrected in 1 round: " in printed.err
    assert "of the cloth was stretched beyond its limit, now" in printed.err
    # Quiet, the same drape prints nothing.
    assert main([*command, "--out", str(tmp_path / "quiet"), "--quiet"]) == 0
    assert capsys.readouterr() == ("", "")
    assert {"narrow.corrected.dxf", "narrow.corrected.svg", "corrected.png"} <= {path.name for path in out.iterdir()}
    rounds = json.loads((out / "metrics.json").read_text())["drape"]["correction"]["rounds"]
    assert rounds[0]["beyond_limit"] > 0.1
    assert rounds[-1]["beyond_limit"] < 0.02
    corrected = read_svg(out / "narrow.corrected.svg")
    for piece in corrected.pieces[corrected.sample]:
        # Its outline was 1.28 m.
        assert 1.29 < sum(edge.length for edge in piece.edges) < 1.4
