"""The review page of a run: what stands on it, that it asks for nothing, and, in a browser, that its slider moves the mesh."""

from __future__ import annotations

import base64
import json
import re
import shutil
import subprocess
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from warpflat.app.cli.main import main
from warpflat.app.cli.summary import summary_lines
from warpflat.app.review.film import open_film
from warpflat.app.review.page import verdict_words, write_review
from warpflat.app.scene.load import make_scene
from warpflat.app.scene.run import run_scene
from warpflat.core.errors import StepError
from warpflat.flat.flattening.fit_report import garment_wear
from warpflat.flat.flattening.verdict import judge

BROWSER = shutil.which("chromium") or shutil.which("google-chrome")


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("run")
    settings = {
        "surface": {"shape": "dome", "resolution": 9},
        "cuts": [{"name": "slit", "line": "centre", "part": [0.0, 0.5]}],
        "output": {"frames": 24},
        "pattern": {"formats": ["svg", "json"]},
    }
    run_scene(make_scene(settings, name="trial", folder=folder, where="trial"), folder)
    return folder


def film_of(page: str) -> dict[str, Any]:
    (film,) = re.findall(r'<script id="film" type="application/json">(.*?)</script>', page)
    return dict(json.loads(film))


def test_the_page_tells_the_numbers_and_asks_for_nothing(run: Path) -> None:
    page = (run / "review.html").read_text(encoding="utf-8")
    metrics = json.loads((run / "metrics.json").read_text())
    assert "review.html" in metrics["files"]["trial"]
    piece = metrics["pieces"]["trial"]
    assert f"{100 * piece['length_error']:.3g} %" in page
    assert "cut:slit" in page
    # The verdict comes before every picture, and every file that is listed is a link.
    assert 0 < page.index('class="verdict') < page.index("<canvas")
    assert {"pattern.json", "trial.svg", "trial.obj", "frames.usdc"} <= set(re.findall(r'<a href="([^"]+)"', page))
    assert all(len(words) > 20 for words in re.findall(r'<img[^>]* alt="([^"]*)"', page))
    assert "default-src 'none'" in page
    assert not re.search(r"(src|href|url)\s*[=(]\s*[\"']?(?!data:)(https?:|//|file:)", page)
    assert page.count("<img") == 2
    assert len(page) < 3_000_000


def test_the_packed_film_is_the_film(run: Path) -> None:
    film = film_of((run / "review.html").read_text(encoding="utf-8"))
    (source,) = open_film(run / "frames.usdc")
    assert film["frames"] == source.times
    assert film["stages"][0] == "relax"
    data = zlib.decompress(base64.b64decode(film["data"]))
    (piece,) = film["pieces"]
    whole = piece["topologies"][0]
    # The first frame lies behind the arrays of all topologies.
    maps = len(film["maps"])
    begin = sum(
        4 * 3 * t["triangles"] + 4 * 2 * t["edges"] + (2 * 3 + maps) * t["vertices"] for t in piece["topologies"]
    )
    planes = np.frombuffer(data[begin : begin + 4 * whole["vertices"]], dtype=np.uint8).reshape(2, -1).astype(np.uint16)
    steps = (planes[0] + 256 * planes[1]).reshape(2, -1).T
    x, y, size = piece["box"]
    expected = source.positions(1)
    np.testing.assert_allclose(np.array([x, y]) + steps / 65535 * size, expected, atol=size / 65535)


def test_all_frames_follow_from_the_layouts_that_the_page_holds(run: Path) -> None:
    stored = film_of((run / "review.html").read_text(encoding="utf-8"))["pieces"][0]["frames"]
    (source,) = open_film(run / "frames.usdc")
    assert len(stored) < 0.7 * len(source.times)
    for time in source.times:
        before = max(frame for frame in stored if frame <= time)
        after = min(frame for frame in stored if frame >= time)
        share = (time - before) / max(after - before, 1)
        ends = [source.positions(frame) for frame in (before, after)]
        expected = (1.0 - share) * ends[0] + share * ends[1]
        np.testing.assert_allclose(source.positions(time), expected, atol=1e-6)


def test_console_and_page_count_the_pieces_that_the_pattern_numbers(run: Path, tmp_path: Path) -> None:
    metrics = json.loads((run / "metrics.json").read_text())
    piece = metrics["pieces"]["trial"]
    # A pair is one piece that is cut twice; what was drafted beside it is one of its own.
    metrics["pieces"] = {"front_left": piece, "front_right": piece}
    metrics["cloths"] = [
        {"name": "woven", "pieces": [{"piece": "front_left", "title": "front"}, {"piece": "cuff", "title": "cuff"}]},
        {"name": "interfacing", "pieces": [{"piece": name, "title": name} for name in ("cuff", "facing")]},
    ]
    write_review(tmp_path, metrics, [], name="trial", film=None)
    assert "<b>3</b><span>pattern pieces</span>" in (tmp_path / "review.html").read_text(encoding="utf-8")
    assert any(line.startswith("3 pattern pieces, ") for line in summary_lines(metrics, ["metrics.json"], "out"))
    del metrics["cloths"]
    assert any(line.startswith("2 pattern pieces, ") for line in summary_lines(metrics, ["metrics.json"], "out"))


@pytest.mark.parametrize(("stretch", "said"), [(0.04, "<b>4 % of 5 %</b>"), (0.13, "<b>13 %</b>")])
def test_no_cloth_is_allowed_more_than_its_limit(run: Path, tmp_path: Path, stretch: float, said: str) -> None:
    metrics = json.loads((run / "metrics.json").read_text())
    metrics["verdict"] = {"fits": True, "by": "strain", "words": "fits by its strain", "findings": []}
    wear = metrics["pieces"]["trial"]["wear"]
    metrics["pieces"]["trial"]["wear"] = {
        **wear,
        "strain_limit": 0.05,
        "strain_warp": {**wear["strain_warp"], "p95": stretch},
    }
    write_review(tmp_path, metrics, [], name="trial", film=None)
    assert said in (tmp_path / "review.html").read_text(encoding="utf-8")


def test_the_command_writes_the_page_again_and_moving_pictures(
    run: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    (run / "review.html").unlink()
    metrics = json.loads((run / "metrics.json").read_text())
    metrics["pieces"]["trial"]["notes"].append("</script><b>bold")
    (run / "metrics.json").write_text(json.dumps(metrics))
    assert main(["review", str(run), "--film", "--sheet"]) == 0
    assert "review.html, film.webp, contact_sheet.png" in capsys.readouterr().out
    with Image.open(run / "film.webp") as film:
        assert getattr(film, "n_frames", 1) > 20
    assert (run / "contact_sheet.png").stat().st_size > 0
    page = (run / "review.html").read_text(encoding="utf-8")
    assert film_of(page)["frames"][0] == 1
    assert "&lt;/script&gt;&lt;b&gt;bold" in page
    assert "<b>bold" not in page
    assert main(["review", str(tmp_path)]) == 2
    assert "give the folder of a run" in capsys.readouterr().err


def test_a_damaged_run_is_one_line(run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "run"
    shutil.copytree(run, folder)
    (folder / "frames.usdc").write_bytes(b"noise")
    assert main(["review", str(folder)]) == 2
    (folder / "frames.usdc").unlink()
    metrics = json.loads((folder / "metrics.json").read_text())
    del metrics["pieces"]["trial"]["area_m2"]
    (folder / "metrics.json").write_text(json.dumps(metrics))
    assert main(["review", str(folder)]) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 2
    assert "run the scene again" in lines[0]
    assert "run the scene again" in lines[1]


PROBE = """<script>
const wait = setInterval(() => {
  if (!document.body.dataset.ready) return;
  clearInterval(wait);
  const slider = document.getElementById("slider"), at = (value) => {
    slider.value = value; slider.dispatchEvent(new Event("input")); return window.review.points("trial"); };
  const first = at("0"), half = at("0.5"), second = at("1");
  document.body.dataset.first = JSON.stringify(first);
  document.body.dataset.blend = String(Math.max(...half.map((x, i) => Math.abs(x - 0.5 * (first[i] + second[i])))));
  const view = document.getElementById("view"), [wide, high] = [view.clientWidth, view.clientHeight];
  slider.value = slider.max; slider.dispatchEvent(new Event("input"));
  const found = []; for (let x = 0; x < wide; x += 7) found.push([x, window.review.under(x, high / 2)]);
  const cloth = found.filter(([x, words]) => words);
  document.body.dataset.energy = cloth[0][1];
  const box = view.getBoundingClientRect(), there = { clientX: box.left + cloth[0][0], clientY: box.top + high / 2, bubbles: true };
  view.dispatchEvent(new PointerEvent("pointerdown", { ...there, pointerId: 1 }));
  view.dispatchEvent(new MouseEvent("click", there));
  document.body.dataset.picked = window.review.picked();
  const map = document.getElementById("map"); map.value = "warp"; map.dispatchEvent(new Event("change"));
  document.body.dataset.warp = window.review.under(cloth[0][0], high / 2);
  const wheel = new WheelEvent("wheel", { deltaY: 100, cancelable: true }); view.dispatchEvent(wheel);
  document.body.dataset.scrolls = String(!wheel.defaultPrevented);
  slider.value = "1"; slider.dispatchEvent(new Event("input"));
  document.body.dataset.label = document.getElementById("label").textContent;
}, 50);
fetch("https://example.com/").catch(() => { document.body.dataset.fetch = "refused"; });
</script>"""


@pytest.mark.skipif(BROWSER is None, reason="needs Chromium")
def test_in_a_browser_the_slider_moves_the_mesh_and_no_request_leaves(run: Path, tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    page.write_text((run / "review.html").read_text(encoding="utf-8").replace("</body>", PROBE + "</body>"))
    log = tmp_path / "net.json"
    command = [
        str(BROWSER), "--headless", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
        "--disable-background-networking", "--disable-component-update", f"--user-data-dir={tmp_path / 'profile'}",
        f"--log-net-log={log}", "--virtual-time-budget=8000", "--dump-dom", page.as_uri(),
    ]  # fmt: skip
    shown = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True).stdout
    body = re.search(r"<body[^>]*>", shown)
    assert body
    assert 'data-fetch="refused"' in body[0]
    assert re.search(r'data-label="(steps|relax) · frame 2 of \d+ · (interpolated|computed)"', body[0])
    # The value under the pointer in each map, a piece that is picked, and a page that scrolls over the film.
    assert re.search(r'data-energy="trial: [0-9.e-]+ J/m²"', body[0])
    assert re.search(r'data-warp="trial: -?[0-9.]+ % along the warp"', body[0])
    assert 'data-picked="trial"' in body[0]
    assert 'data-scrolls="true"' in body[0]
    blend = re.search(r'data-blend="([^"]+)"', body[0])
    first = re.search(r'data-first="\[([^\]]+)\]"', body[0])
    assert blend
    assert first
    assert float(blend[1]) < 1e-6
    (source,) = open_film(run / "frames.usdc")
    points = np.array(first[1].split(","), dtype=float).reshape(-1, 3)[:, :2] - source.offset[:2]
    np.testing.assert_allclose(points, source.positions(1), atol=2e-5)
    assert "example.com" not in log.read_text(errors="replace")


def test_the_page_of_a_run_tells_what_it_lacks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object, **__: object) -> None:
        raise StepError("it is too wide")

    monkeypatch.setattr("warpflat.garment.construction.to_pattern.finish_edges", fail)
    settings = {
        "surface": {"shape": "dome", "resolution": 9},
        "output": {"frames": 0},
        "pattern": {"formats": ["json"]},
    }
    run_scene(make_scene(settings, name="trial", folder=tmp_path, where="trial"), tmp_path)
    page = (tmp_path / "review.html").read_text(encoding="utf-8")
    assert "Not done: the pattern has no finishing: it is too wide." in page
    assert "At rest, no flipped faces" not in page


def test_the_verdict_says_whether_it_fits_what_it_needs_and_no_knit_is_an_error() -> None:
    strain = {"p95": 0.10}
    fit = {
        "held": 0.0, "slack": 0.0, "outside": 0.0, "strain_limit": 0.15, "where_not": [], "where_slack": [],
        "would_help": [], "strain_warp": {"p95": 0.01}, "strain_weft": strain,
    }  # fmt: skip
    piece = {"flipped_faces": 0, "stages": [{"converged": True}], "area_m2": 0.5, "wear": fit}
    ring = {
        "name": "neck",
        "passes": False,
        "opening_needed_mm": 100,
        "length_mm": 370,
        "girth_mm": 569,
        "over": "head",
    }

    def told(metrics: dict[str, Any]) -> str:
        metrics["wear"] = garment_wear(metrics["pieces"])
        verdict = judge(metrics)
        assert verdict is not None
        return verdict_words({**metrics, "verdict": verdict.as_dict()})

    words = told({"pieces": {"front": piece}, "rings": [ring]})
    # No number is parted from its unit.
    assert "10&nbsp;cm at the neck" in words
    words = words.replace("&nbsp;", " ")
    assert "Fits by its strain" in words
    assert "At rest" in words
    missing = told({"pieces": {"front": piece}, "left_out": ["it was not sewn"]})
    assert "Not done: it was not sewn." in missing
    assert "At rest" not in missing
    assert "needs an opening of 10 cm at the neck to be put on: 37.0 cm around, and 56.9 cm must pass (head)" in words
    assert "It can be put on" not in words
    # Where it was draped, the drape alone says whether it fits.
    drape = {"converged": True, "places": [{"words": "the front stands off by 20 mm", "kind": "misfit", "fails": True}]}
    words = told({"pieces": {"front": piece}, "drape": drape})
    assert "Does not fit as draped" in words
    assert "Fits by" not in words
    assert "stands off by 20&nbsp;mm" in words
    unfit = {
        **piece,
        "wear": {**fit, "held": 0.1, "where_not": ["stretched 9 %, 3 cm2"]},
        "stages": [{"name": "relax", "converged": False, "steps": 9, "work_units": 9.0, "residual": 0.1}],
    }
    words = told({"pieces": {"front": unfit, "back": piece}})
    assert (
        words.index("front did not converge within 9 steps")
        < words.index("Does not fit by its strain")
        < words.index("front: stretched 9&nbsp;%, 3&nbsp;cm²")
    )
