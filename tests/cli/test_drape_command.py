"""`warpflat drape` with a pattern's file."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from warpflat.cli.main import main
from warpflat.export.svg import write_svg
from warpflat.pattern.draft import draft_garment
from warpflat.pattern.piece_parts import Edge
from warpflat.pattern.pieces import Pattern, Piece, Seam, SeamSide


@pytest.fixture
def tube(tmp_path: Path) -> Path:
    ring = np.array([(0.0, 0.0), (0.5, 0.0), (0.5, 0.25), (0.0, 0.25), (0.0, 0.0)])
    edges = [Edge(name=f"e{k + 1}", points=ring[k : k + 2]) for k in range(4)]
    sides = (("front", "back"), ("back", "front"))
    seams = [
        Seam(name=f"side {a}", sides=((SeamSide(piece=a, edge="e2"),), (SeamSide(piece=b, edge="e4", reversed=True),)))
        for a, b in sides
    ]
    pieces = [Piece(name=name, edges=edges) for name in ("front", "back")]
    write_svg(draft_garment(Pattern(name="tube", pieces={"": pieces}, seams=seams)), tmp_path / "tube.svg")
    return tmp_path / "tube.svg"


def test_a_drawing_is_draped(tube: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    table = tmp_path / "worn.toml"
    table.write_text('spacing_mm = 40\n[mannequin]\nsize = "EU 38"\nresolution_mm = 40.0\n[drape]\nmax_steps = 100\n')
    out = tmp_path / "out"
    assert main(["drape", str(tube), "--seams", str(table), "--out", str(out), "--usd"]) == 1
    printed = capsys.readouterr()
    assert "the drape is not at rest after 100 steps" in printed.err
    assert "woven is taken" in printed.err
    assert "worn: fits: no" in printed.out
    assert "from the body" in printed.out
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


def test_edges_are_listed(tube: Path, capsys: pytest.CaptureFixture[str]):
    assert main(["drape", str(tube), "--edges"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 8
    assert lines[0].startswith("front.e1: 500.0 mm, seam, from (")


def test_json_of_a_form_is_all_that_is_printed(tmp_path: Path):
    scene = tmp_path / "skirt.toml"
    scene.write_text(
        'form = "a_line_skirt"\n[mannequin]\nsize = "EU 38"\nresolution_mm = 40\n[output]\nframes = 0\npicture = false\n',
        encoding="utf-8",
    )
    # Warp is loaded before the mannequin is built beside, as it is by the modules of a drape.
    words = f"import warp; from warpflat.cli.main import main; main(['run', {str(scene)!r}, '--json', '--out', 'out'])"
    ended = subprocess.run([sys.executable, "-c", words], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert json.loads(ended.stdout)["schema"] == 1
    assert ended.stderr == ""
