"""Activities are reported to the listener, such as the progress bar."""

from __future__ import annotations

import io
import re
import time
from pathlib import Path
from types import SimpleNamespace

import pytest

from warpflat.app.cli.main import main
from warpflat.app.cli.progress_bar import ProgressBar
from warpflat.core.activity import activity_listener, report_activity


def test_activities_are_reported_to_the_innermost_listener():
    heard: list[str] = []
    report_activity("nothing that is heard")
    with activity_listener(heard.append):
        report_activity("sewing")
        with activity_listener(lambda words: heard.append(words.upper())):
            report_activity("sewing")
        report_activity("drafting")
    report_activity("nothing that is heard")
    assert heard == ["sewing", "SEWING", "drafting"]


def test_a_run_reports_what_it_does_besides_steps(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    Path("block.toml").write_text(
        "form = 'a_line_skirt'\nhalf = true\n[mannequin]\nsize = 'EU 38'\nresolution_mm = 40\n"
        "[marker]\nwidth = 1.5\nseconds = 1\n[output]\nframes = 0\n"
    )
    # Of what a process beside does nothing is heard.
    monkeypatch.setattr("warpflat.pattern.files.beside.thread_count", lambda: 1)
    heard: list[str] = []
    with activity_listener(heard.append):
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
        "drawing walked.png",
        "writing the review page",
    ]
    missed = [float(words.split(", ")[2].split()[0]) for words in heard if "mm amiss" in words]
    assert missed[-1] < missed[0]


def test_the_bar_shows_what_is_being_done_and_then_steps_again(monkeypatch: pytest.MonkeyPatch):
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    stream = Terminal()
    look = SimpleNamespace(stage="relax", step=7, max_steps=100, model_energy_j=0.0021, residual=0.5)
    monkeypatch.setattr("sys.stderr", stream)
    monkeypatch.setattr("warpflat.app.cli.progress_bar._REFRESH", 0.0)
    monkeypatch.setattr("warpflat.app.cli.progress_bar._TICK", 0.05)
    with ProgressBar("cap") as bar:
        report_activity("compiling kernels")
        assert re.search(r"\rcap: compiling kernels \[00:\d\d\]", stream.getvalue())
        bar(look)  # type: ignore[arg-type]
        assert "cap: relax: 7 steps" in stream.getvalue()
        report_activity("sewing")
        assert re.search(r"\rcap: sewing \[00:\d\d\]", stream.getvalue())
        begun, shown = time.monotonic(), len(stream.getvalue())
        while len(stream.getvalue()) == shown:
            assert time.monotonic() - begun < 30, "the bar stands still"
            time.sleep(0.01)
    before = stream.getvalue()
    report_activity("nothing that is shown")
    assert stream.getvalue() == before
