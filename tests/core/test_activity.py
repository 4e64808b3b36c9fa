"""What is being done, told to who listens, and the bar that does."""

from __future__ import annotations

import io
import re
from pathlib import Path
from types import SimpleNamespace

import pytest

from warpflat.cli.main import main
from warpflat.cli.tables import ProgressBar
from warpflat.core.activity import doing, listening


def test_only_who_listens_is_told_what_is_being_done():
    heard: list[str] = []
    doing("nothing that is heard")
    with listening(heard.append):
        doing("sewing")
        with listening(lambda words: heard.append(words.upper())):
            doing("sewing")
        doing("drafting")
    doing("nothing that is heard")
    assert heard == ["sewing", "SEWING", "drafting"]


def test_a_run_tells_what_it_does_besides_steps(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    Path("block.toml").write_text(
        "form = 'a_line_skirt'\n[mannequin]\nsize = 'EU 38'\n[marker]\nwidth = 1.5\nseconds = 1\n[output]\nframes = 0\n"
    )
    heard: list[str] = []
    with listening(heard.append):
        assert main(["run", "block.toml", "--quiet"]) == 0
    kinds = [words.partition(",")[0] for words in heard]
    assert list(dict.fromkeys(kinds)) == [
        "building the mannequin",
        "sewing",
        "measuring how it fits",
        "drawing picture.png",
        "drafting the pattern",
        *(f"writing {name}" for name in ("block.dxf", "block.svg", "pattern.pdf", "pattern.json")),
        "laying the marker",
    ]
    missed = [float(words.split(", ")[2].split()[0]) for words in heard if "mm amiss" in words]
    assert missed[-1] < missed[0]


def test_the_bar_shows_what_is_being_done_and_then_steps_again(monkeypatch: pytest.MonkeyPatch):
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    stream = Terminal()
    look = SimpleNamespace(stage="relax", step=7, max_steps=100, model_energy=0.0021, residual=0.5)
    monkeypatch.setattr("sys.stderr", stream)
    monkeypatch.setattr("warpflat.cli.tables._REFRESH", 0.0)
    with ProgressBar("cap") as bar:
        doing("compiling kernels")
        assert re.search(r"\rcap: compiling kernels \[00:\d\d\]", stream.getvalue())
        bar(look)  # type: ignore[arg-type]
        assert "cap: relax: 7 steps" in stream.getvalue()
        doing("sewing")
        assert re.search(r"\rcap: sewing \[00:\d\d\]", stream.getvalue())
    before = stream.getvalue()
    doing("nothing that is shown")
    assert stream.getvalue() == before
