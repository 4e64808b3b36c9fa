"""Whatever goes wrong with a picture, film, page or guide, pattern, metrics and OBJ are there, and a note says what is missing."""

from __future__ import annotations

import importlib
import json
import signal
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from warpflat.app.cli.main import main
from warpflat.core.errors import InputError

PATTERN = ("dxf", "svg", "pdf", "json")
DOME = "[surface]\nshape = 'dome'\nresolution = 9\n[wear]\nstretch_warp = 0.02\n[output]\nframes = 4\n"
HELD = "[lines.across]\nplane = { point = [0, 0, 0], normal = [1, 0, 0] }\n[drape]\nhold = ['across']\n"
SKIRT = """
form = "a_line_skirt"
half = true
[mannequin]
size = "EU 38"
resolution_mm = 40
[wear]
stretch_warp = 0.02
[output]
frames = 4
"""
# What is made to fail, by the file that goes missing: all that goes into a function, from the first line on.
SURFACE = {
    "picture.png": "warpflat.pattern.export.picture.draw_figure",
    "dome.wear.png": "warpflat.pattern.export.fit_picture.write_wear_sheet",
    "frames.usdc": "warpflat.pattern.export.usd.FrameWriter.__enter__",
    "review.html": "warpflat.app.review.page._page",
    "the guide": "warpflat.pattern.export.pdf.guide_pages",
}
DRAPE = {
    "drape.png": "warpflat.garment.draping.write.write_drape_picture",
    "drape.webp": "warpflat.garment.draping.write.write_drape_film",
    "corrected.png": "warpflat.garment.draping.picture.write_correction_picture",
}
GARMENT = {
    "picture.png": "warpflat.pattern.export.picture._Band.draw",
    "wear.png": "warpflat.pattern.export.fit_picture._scale",
    "walked.png": "warpflat.pattern.export.walked_picture.pack_boxes",
    "frames.usdc": "warpflat.app.scene.frames.KeyFile.append",
    "review.html": "warpflat.app.review.page.pack_pictures",
    "the guide": "warpflat.pattern.export.pdf.legend_page",
}


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def fail(monkeypatch: pytest.MonkeyPatch, places: Iterable[str], error: Callable[[str], BaseException]) -> None:
    """Let functions raise an error made from the place of each."""
    for place in places:
        parts = place.split(".")
        for count in range(len(parts) - 1, 0, -1):
            try:
                owner: Any = importlib.import_module(".".join(parts[:count]))
                break
            except ModuleNotFoundError:
                continue
        for part in parts[count:-1]:
            owner = getattr(owner, part)

        def broken(*_: object, place: str = place, **__: object) -> None:
            raise error(place)

        # What the layers above take by the door.
        door = importlib.import_module(".".join(parts[:2]))
        if parts[-1] in door.__all__:
            monkeypatch.setattr(door, parts[-1], broken)
        monkeypatch.setattr(owner, parts[-1], broken)


def left_out(told: str) -> list[str]:
    """What is missing in `out` by the notes of its metrics, each of which the console tells in a line of its own."""
    notes = json.loads(Path("out/metrics.json").read_text())["notes"]
    lines = told.splitlines()
    told_once = {note: lines.count(f"warpflat: note: out: {note}") == 1 for note in notes}
    whats = [note.partition(" was left out")[0] if is_told else note for note, is_told in told_once.items()]
    return sorted(what for what in whats if not Path("out", what).exists())


@pytest.mark.parametrize(
    ("scene", "places", "kind", "threads"),  # with one, files are written in this process, with two in others
    [
        (DOME, SURFACE, ValueError, "1"),
        (DOME, SURFACE, InputError, "2"),
        (DOME, SURFACE, OSError, "1"),
        (DOME, SURFACE, OSError, "2"),
        (SKIRT, GARMENT, RuntimeError, "1"),
        (SKIRT, GARMENT, RuntimeError, "2"),
    ],
)
def test_a_pattern_is_made_without_its_pictures(
    scene: str,
    places: dict[str, str],
    kind: type[Exception],
    threads: str,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setenv("WARPFLAT_THREADS", threads)
    Path("dome.toml").write_text(scene)
    fail(monkeypatch, places.values(), kind)
    assert main(["run", "dome.toml", "--out", "out"]) == 0
    told = capfd.readouterr().err
    assert left_out(told) == sorted(places)
    assert "Traceback" not in told
    assert not list(Path("out").glob(".*"))
    assert len(list(Path("out").glob("*.obj"))) == len(json.loads(Path("out/metrics.json").read_text())["pieces"])
    for file in ("dome.dxf", "dome.svg", "pattern.pdf", "pattern.json"):
        assert (Path("out") / file).stat().st_size > 500


def test_a_drape_is_done_without_its_pictures(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    Path("dome.toml").write_text(DOME + HELD + "correct = true\n")
    fail(monkeypatch, [*DRAPE.values(), "warpflat.garment.draping.write.write_drape_frames"], RuntimeError)
    assert main(["run", "dome.toml", "--out", "out", "-q"]) == 0
    assert not set(DRAPE) & {path.name for path in Path("out").iterdir()}
    notes = json.loads(Path("out/metrics.json").read_text())["notes"]
    assert [note.split(" was left out")[0] for note in notes] == [
        "drape.png",
        "the drape",
        "drape.webp",
        "corrected.png",
    ]
    assert "the drape was left out of frames.usdc: RuntimeError: " in capfd.readouterr().err
    assert Path("out/frames.usdc").stat().st_size > 1000  # how it was flattened


def test_a_corrected_pattern_is_cut_from_the_scenes_cloth() -> None:
    cloth = "[cloth]\nshrinkage_warp = 0.2\nlining = 'satin'\n[pattern]\nformats = ['svg']\n"
    bare = DOME.replace("frames = 4", "frames = 0\npicture = false")
    Path("dome.toml").write_text(bare + HELD + "correct = true\n" + cloth)
    assert main(["run", "dome.toml", "--out", "out", "-q"]) == 0
    assert all("satin" in Path("out", f"{name}.svg").read_text() for name in ("dome", "dome.corrected"))


def test_a_pattern_of_thousands_of_sheets_is_done_without_its_pages(capfd: pytest.CaptureFixture[str]) -> None:
    Path("dome.toml").write_text(
        "[surface]\nshape = 'dome'\nsize = 9.9\nradius = 20\nresolution = 9\n[output]\nframes = 0\npicture = false\n"
    )
    assert main(["run", "dome.toml", "--out", "out", "-q"]) == 0
    metrics = json.loads(Path("out/metrics.json").read_text())
    (note,) = metrics["notes"]
    assert note.startswith("pattern.pdf was left out: it would take some ")
    assert "left_out" not in metrics
    assert f"warpflat: note: out: {note}\n" == capfd.readouterr().err
    assert not Path("out/pattern.pdf").exists()


@pytest.mark.parametrize(
    "place",
    [
        "warpflat.app.scene.frames.KeyFile.__init__",
        "warpflat.app.scene.frames.FrameRecorder._keep",
        "warpflat.app.scene.frames.FilmStage.place_frames",
        "warpflat.pattern.export.usd.FrameWriter.write",
        "warpflat.pattern.export.usd.FrameWriter.__exit__",
    ],
)
def test_a_film_that_fails_anywhere_is_left_out(place: str, monkeypatch: pytest.MonkeyPatch) -> None:
    Path("dome.toml").write_text(DOME + "[pattern]\nformats = []\n")
    fail(monkeypatch, [place], RuntimeError)
    assert main(["run", "dome.toml", "--out", "out", "-q"]) == 0
    metrics = json.loads(Path("out/metrics.json").read_text())
    assert metrics["notes"] == [f"frames.usdc was left out: RuntimeError: {place}"]
    assert "frames.usdc" not in metrics["files"]["dome"]
    assert "review.html" in metrics["files"]["dome"]
    assert not Path("out/frames.usdc").exists()


@pytest.mark.parametrize(
    ("arguments", "place", "missing", "kept"),
    [
        (
            ("cuts", "bodice.toml"),
            "warpflat.pattern.export.ledger_picture.write_ledger_picture",
            "ledger.png",
            ["ledger.json"],
        ),
        (
            ("compare", "dome.toml", "--fabric", "denim", "--fabric", "jersey"),
            "warpflat.app.scene.compare_picture.write_overlay_picture",
            "compare.png",
            ["compare.json", "compare.svg"],
        ),
        (
            ("mannequin", "--size", "EU 38", "--resolution", "40"),
            "warpflat.garment.mannequin.output.write_mannequin_picture",
            "picture.png",
            ["mannequin.obj", "mannequin.usdc", "metrics.json"],
        ),
    ],
)
def test_other_commands_go_on_without_a_picture(
    arguments: tuple[str, ...],
    place: str,
    missing: str,
    kept: list[str],
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    Path("dome.toml").write_text(DOME)
    Path("bodice.toml").write_text(DOME.replace("dome", "bodice"))
    fail(monkeypatch, [place], RuntimeError)
    assert main([*arguments, "--out", "out"]) == 0
    told = capfd.readouterr()
    assert f"warpflat: note: out: {missing} was left out: RuntimeError: {place}\n" in told.err
    assert missing not in told.out
    assert sorted(path.name for path in Path("out").iterdir()) == kept


def test_a_batch_goes_on_without_its_pictures(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    bodies = [SimpleNamespace(girths={"bust": girth}) for girth in (0.8, 0.9)]
    monkeypatch.setattr("warpflat.app.batch.run.read_body_patterns", lambda *_: bodies)
    monkeypatch.setattr("warpflat.app.batch.run.bodies_table", lambda _: "key\n")
    Path("dome.toml").write_text(DOME)
    Path("all.toml").write_text("scenes = ['dome.toml']\nfabrics = ['denim', 'jersey']\n")
    drawn = ["warpflat.pattern.export.picture.draw_figure", "warpflat.app.batch.body_picture.write_body_picture"]
    fail(monkeypatch, drawn, RuntimeError)
    assert main(["batch", "all.toml", "--out", "out"]) == 0
    told = capfd.readouterr().err
    assert (told.count("picture.png was left out"), told.count("bodies.png was left out")) == (2, 1)
    assert len(list(Path("out").glob("*/dome.obj"))) == 2
    assert Path("out/bodies.csv").exists()
    assert "bodies.png" not in Path("out/index.html").read_text()


@pytest.mark.skipif(sys.platform != "linux", reason="processes are forked on Linux only")
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
@pytest.mark.parametrize("swallowed", [False, True])
def test_a_signal_while_a_picture_is_drawn_ends_the_run(
    number: int, code: int, swallowed: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Native code may make an error of its own of it."""

    def draw(*_: object, **__: object) -> None:
        try:
            signal.raise_signal(number)
        except KeyboardInterrupt:
            if not swallowed:
                raise
        raise RuntimeError("what a library says of it")

    monkeypatch.setenv("WARPFLAT_THREADS", "1")
    monkeypatch.setattr("warpflat.pattern.export.picture.draw_figure", draw)
    Path("dome.toml").write_text(DOME)
    assert main(["run", "dome.toml", "--out", "out", "-q"]) == code
    assert not Path("out").exists()


def test_what_the_user_must_see_to_still_ends_the_run(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    Path("dome.toml").write_text(DOME)
    Path("out/picture.png").mkdir(parents=True)
    assert main(["run", "dome.toml", "--out", "out", "-q"]) == 2
    assert "picture.png is a folder" in capfd.readouterr().err
    Path("out/picture.png").rmdir()

    def short(*_: object, **__: object) -> None:
        raise MemoryError

    monkeypatch.setattr("warpflat.pattern.export.picture.draw_figure", short)
    assert main(["run", "dome.toml", "--out", "out", "-q"]) == 2
    assert "not enough memory" in capfd.readouterr().err
    assert not list(Path("out").iterdir())
