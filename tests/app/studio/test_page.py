"""The studio's page in headless Chromium: pick a line, cut, change the cloth, undo, save; nothing leaves the machine."""

from __future__ import annotations

import io
import shutil
import socket
import time
from contextlib import nullcontext, suppress
from pathlib import Path
from types import SimpleNamespace
from urllib.parse import urlsplit

import numpy as np
import pytest
from PIL import Image

from warpflat.app.cli.main import main
from warpflat.app.scene.load import load_scene, make_scene

viser = pytest.importorskip("viser", reason="the extra `studio` (viser) is not installed")
BROWSER = shutil.which("chromium") or shutil.which("google-chrome")
SCENE = {
    "surface": {"shape": "bodice", "resolution": 17},
    "datum": "centre",
    "output": {"frames": 0, "picture": False},
    "pattern": {"formats": []},
}


def free_port() -> int:
    with socket.socket() as trial:
        trial.bind(("127.0.0.1", 0))
        return int(trial.getsockname()[1])


def test_a_taken_port_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        scene = tmp_path / "trial.toml"
        scene.write_text('[surface]\nshape = "dome"\n')
        port = other.getsockname()[1]
        assert main(["studio", str(scene), "--port", str(port), "--no-open"]) == 2
    assert capsys.readouterr().err.startswith(f"warpflat: cannot serve on 127.0.0.1:{port}: address already in use")


@pytest.mark.skipif(BROWSER is None, reason="needs Chromium")
def test_pick_cut_cloth_undo_save(tmp_path: Path) -> None:
    from chromium import chromium

    from warpflat.app.studio.page import Page

    scene = make_scene(SCENE, name="trial", folder=tmp_path, where="trial")
    page = Page(scene, host="127.0.0.1", port=free_port(), out=tmp_path / "out")
    head, tried = (
        "document.querySelector('#studio-head')?.innerText",
        "document.querySelector('#studio-preview')?.innerText",
    )
    try:
        with chromium(str(BROWSER), tmp_path / "profile", 900, 600) as browser:
            browser.prefer("dark")
            browser.send("Page.navigate", url=page.url)
            browser.wait(f"{head}?.includes('at rest') && {head}")
            browser.wait("document.documentElement.dataset.mantineColorScheme === 'dark'")
            browser.run("document.body.innerText = 'before'")
            browser.prefer("light")
            browser.send("Page.reload")
            browser.wait(f"{head}?.includes('at rest') && {head}")
            browser.wait("document.documentElement.dataset.mantineColorScheme === 'light'")
            whole = page.session.solution
            assert whole is not None
            steps, rest = whole.pieces["trial"].stages[1:]
            assert f"{steps.steps} steps released " in browser.run(head)
            assert f", {rest.steps} iterations released " in browser.run(head)
            client = wait_for(lambda: next(iter(page.server.get_clients().values()), None))
            # That there is no graphics card is told over the form.
            browser.run("document.querySelectorAll('.mantine-Notification-closeButton').forEach(e => e.click())")
            width, height = (
                browser.run(f"document.querySelector('canvas').client{way}") for way in ("Width", "Height")
            )
            # The camera follows the window's shape, which the panel changes.
            wait_for(lambda: abs(client.camera.aspect - width / height) < 0.01)
            wait_for(lambda: np.allclose(client.camera.position[:2], 0.0) and client.camera.fov < 0.5)
            surface = whole.pieces["trial"].surface
            place = surface.vertices[surface.lines["bust"][4]] + page.stage.form_position  # seen from the front
            # A browser that draws in software may still be setting its camera: click again where the line is seen by then.
            for _ in range(8):
                browser.click(*on_screen(client.camera, place, width, height))
                with suppress(AssertionError):
                    wait_for(lambda: page.session.preview is not None, 8.0)
                    break
            words = browser.wait(tried)
            assert words.startswith("tried, not made yet: bust releases ")
            assert " mm" in words
            assert page.session.scene.settings.cuts == []
            browser.press("Apply")
            wait_for(lambda: page.session.step.what != "scene")
            assert page.session.scene.settings.cuts[0].line == "bust"
            browser.choose("cloth", "denim")
            wait_for(lambda: page.session.scene.settings.fabric == "denim" and not page.session.activity)
            browser.press("Undo")
            wait_for(lambda: page.session.scene.settings.fabric != "denim")
            browser.press("Save and run")
            browser.wait(f"{head}?.includes('run from scratch')")
            assert [cut.line for cut in load_scene(tmp_path / "trial.toml").settings.cuts] == ["bust"]
            assert (tmp_path / "out" / "trial" / "metrics.json").is_file()
            browser.press("Save and run")
            browser.wait("document.body.innerText.includes('Replace the file?')")
            browser.press("Keep it")
            assert browser.faults == []
            hosts = {urlsplit(url).hostname for url in browser.requests} - {None}
            assert hosts == {"127.0.0.1"}
            wait_for(lambda: shows_the_scale(browser, page, client))
    finally:
        page.close()


@pytest.mark.skipif(BROWSER is None, reason="needs Chromium")
def test_drag_a_dart_and_save(tmp_path: Path) -> None:
    from chromium import chromium

    from warpflat.app.studio.page import Page

    scene = make_scene(
        {**SCENE, "cuts": [{"line": "bust", "part": [0.0, 0.3]}], "pattern": {"formats": ["pdf"]},
         "output": {"frames": 2, "picture": True}},
        name="trial", folder=tmp_path, where="trial",
    )  # fmt: skip
    page = Page(scene, host="127.0.0.1", port=free_port(), out=tmp_path / "out")
    head = "document.querySelector('#studio-head')?.innerText"
    try:
        with chromium(str(BROWSER), tmp_path / "profile", 900, 600) as browser:
            browser.send("Page.navigate", url=page.url)
            before = browser.wait(f"{head}?.includes('by its strain') && {head}")
            whole = page.session.solution
            assert whole is not None
            client = wait_for(lambda: next(iter(page.server.get_clients().values()), None))
            browser.run("document.querySelectorAll('.mantine-Notification-closeButton').forEach(e => e.click())")
            width, height = (
                browser.run(f"document.querySelector('canvas').client{way}") for way in ("Width", "Height")
            )
            wait_for(lambda: abs(client.camera.aspect - width / height) < 0.01)
            wait_for(lambda: np.allclose(client.camera.position[:2], 0.0) and client.camera.fov < 0.5)
            wait_for(lambda: "trial: tip of bust" in page.stage._handles)
            # A browser that draws in software may still be setting its camera, and a drag beside the tip turns the form: look from the
            # front again, and drag where the tip is seen by then.
            for _ in range(8):
                browser.press("Front")
                time.sleep(1.5)
                tip, mouth = (
                    place_of_handle(page.stage, f"trial: {name}") for name in ("tip of bust", "mouth of bust, left")
                )
                inwards = (tip - mouth) / np.linalg.norm(tip - mouth)
                ends = [on_screen(client.camera, place, width, height) for place in (tip, tip + 0.05 * inwards)]
                browser.drag(*ends)
                with suppress(AssertionError):
                    wait_for(lambda: page.session.step.what != "scene" and not page.session.activity, 8.0)
                    break
            assert page.session.step.what == "trial: tip of bust"
            (cut,) = page.session.scene.settings.cuts
            assert cut.part is not None
            assert cut.part[1] > 0.35
            # The numbers follow, and a drag is one step back.
            solution = wait_for(lambda: page.session.step.solution)
            assert solution.strain_energy < whole.strain_energy
            browser.wait(f"{head} !== {before!r} && {head}?.includes('by its strain')")
            browser.press("Save and run")
            links = browser.wait("document.querySelector('#studio-links')?.innerText")
            assert "print · review" in links
            assert load_scene(tmp_path / "trial.toml").settings.cuts[0].part == cut.part
            pdf = browser.run_async(
                "fetch(document.querySelector('#studio-links a').href).then(a => a.text()).then(t => t.slice(0, 4))"
            )
            assert pdf == "%PDF"
            browser.press("Undo")
            wait_for(lambda: page.session.step.what == "scene")
            assert page.session.scene.settings.cuts[0].part == [0.0, 0.3]
            assert browser.faults == []
    finally:
        page.close()


def wait_for(what, seconds: float = 60.0):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        found = what()
        if found:
            return found
        time.sleep(0.05)
    raise AssertionError("it did not come true")


def place_of_handle(stage, name: str) -> np.ndarray:
    """Where a point that can be dragged is seen [m]."""
    return np.asarray(stage._pattern.position) + stage._turn @ np.asarray(stage._handles[name].position)


def on_screen(camera, point, width: float, height: float) -> tuple[float, float]:
    """Return where a point is seen [CSS pixels]; the camera looks along -z."""
    away = np.asarray(point) - camera.position
    scale = 0.5 * height / np.tan(0.5 * camera.fov) / -away[2]
    return 0.5 * width + scale * away[0], 0.5 * height - scale * away[1]


def shows_the_scale(browser, page, client) -> bool:
    """Return whether the pattern is seen in the colours of its scale."""
    import base64

    data = base64.b64decode(browser.send("Page.captureScreenshot", format="png")["data"])
    pixels = np.asarray(Image.open(io.BytesIO(data)).convert("RGB"), dtype=float)
    canvas = pixels[:, : browser.run("document.querySelector('canvas').clientWidth")]
    expected = 255.0 * page.scale.rgb(np.linspace(page.scale.low, page.scale.high, 64))
    right = canvas[:, canvas.shape[1] // 2 :].reshape(-1, 3)
    seen = right[np.abs(right - 255.0).max(axis=1) > 3.0]
    near = np.abs(seen[:, None] - expected).max(axis=2).min(axis=1) < 6.0
    return bool(near.mean() > 0.7)


def test_marks_vanish_with_undo_and_the_view_follows_the_size(tmp_path: Path) -> None:
    from warpflat.app.studio.page import Page

    settings = {
        "mannequin": {"size": "EU 38", "resolution_mm": 30.0}, "form": "skirt", "fabric": "woven", "curves_mm": 0.0,
        "output": {"frames": 0, "picture": False}, "pattern": {"formats": []},
    }  # fmt: skip
    page = Page(
        make_scene(settings, name="trial", folder=tmp_path, where="trial"), host="127.0.0.1", port=0, out=tmp_path
    )
    try:
        wait_for(lambda: page.is_idle and page._shown_size.any())
        before = page._shown_size
        page.session.change_body("EU 46")
        wait_for(lambda: page.is_idle and (page._shown_size != before).any())
        np.testing.assert_allclose(page._shown_size, page.stage.size)
        assert page._shown_size[0] > before[0]
        page.choose_line(("front", "princess front left"))
        wait_for(lambda: page.session.preview is not None and page._picked is not None, 20.0)
        page.undo()  # the cut that was only tried
        wait_for(lambda: page.is_idle and page.session.preview is None)
        assert page._picked is None
        assert page.session.step.what == "size"
        # A measure is bounded in the unit that is shown.
        assert page._panel._measures["waist"].min > 10.0
        # On a narrow page form and pattern are shown above the panel.
        for wide, free in ((1280, 1.0), (400, 0.4)):
            camera = SimpleNamespace(aspect=wide / 900, image_width=wide)
            buffer = SimpleNamespace(sanctioned_dead_writes=nullcontext)
            connection = SimpleNamespace(get_message_buffer=lambda buffer=buffer: buffer)
            page.stage.show_all(
                SimpleNamespace(client_id=wide, atomic=nullcontext, camera=camera, _websock_connection=connection)
            )
            x, y = (0.5 * length * np.array([-1.0, 1.0]) for length in page.stage.size)
            left, lower = on_screen(camera, (x[0], y[0], 0.0), wide, 900)
            right, upper = on_screen(camera, (x[1], y[1], 0.0), wide, 900)
            assert 0.0 < left < right < wide
            assert 0.0 < upper < lower < 900 * free
    finally:
        page.close()
