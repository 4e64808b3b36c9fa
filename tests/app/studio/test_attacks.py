"""The studio attacked: by other sites, by strangers, and by messages that no page sends. Nothing is read or changed, and it goes on.

`python -m tests.fuzz --only studio --cases 5000` makes up any number of such attacks.
"""

from __future__ import annotations

import math
import socket
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("viser", reason="the extra `studio` (viser) is not installed")

from fuzz.studio_messages import CAMERA, CLICK, OTHERS, UPGRADE, Studio
from websockets.exceptions import InvalidStatus

from warpflat.app.cli.main import main
from warpflat.app.studio.door import Door
from warpflat.core.errors import InputError

SCENE = '[surface]\nshape = "dome"\nresolution = 5\n'
ORIGINS = (
    "http://evil.com:@port@", "https://127.0.0.1:@port@", "http://127.0.0.1:1", "null", "", "http://127.0.0.1:@port@.evil.com",
    "http://127.0.0.1:@port@@evil.com", "http://[",
)  # fmt: skip
HOSTS = (
    "evil.com:@port@", "evil.com", "127.0.0.1", "127.0.0.1:1", "localhost.evil.com:@port@", "localhost.:@port@", "0:@port@", "",
    "evil@127.0.0.1:@port@", "evil.com:@port@\r\nHost: 127.0.0.1:@port@",
)  # fmt: skip


@pytest.fixture(scope="module")
def studio(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Studio]:
    studio = Studio(tmp_path_factory.mktemp("studio"))
    yield studio
    studio.page.close()


def request(path: str = "/@token@/", host: str = "127.0.0.1:@port@", more: str = "") -> str:
    return f"GET {path} HTTP/1.1\r\nHost: {host}\r\n{more}\r\n"


@pytest.mark.parametrize("upgrade", ["", UPGRADE + "Sec-WebSocket-Protocol: @protocol@\r\n"], ids=["http", "websocket"])
class TestOtherSites:
    def test_a_name_that_is_made_to_mean_this_machine_is_refused(self, studio: Studio, upgrade: str) -> None:
        """DNS rebinding: the page of another site has the address of this machine, and its own name."""
        for host in HOSTS:
            for token in ("/", "/@token@/"):
                assert studio.ask(request(token, host, f"Origin: http://{host}\r\n{upgrade}"))
                assert studio.ask(request(token, host, upgrade))

    def test_a_foreign_origin_is_refused(self, studio: Studio, upgrade: str) -> None:
        for origin in ORIGINS:
            assert studio.ask(request(more=f"Origin: {origin}\r\n{upgrade}"))
            assert studio.ask(request(more=f"Origin: {origin}\r\nOrigin: http://127.0.0.1:@port@\r\n{upgrade}"))

    def test_only_who_has_the_token_comes_in(self, studio: Studio, upgrade: str) -> None:
        paths = (
            "/",
            "/index.html",
            "/@token@x/",
            "//@token@/",
            "@token@/",
            "/?@token@",
            "/%20@token@/",
            f"/{studio.token[:-1]}/",
        )
        for path in paths:
            assert studio.ask(request(path, more=upgrade))

    def test_the_studios_own_names_come_in(self, studio: Studio, upgrade: str) -> None:
        for host in ("127.0.0.1:@port@", "localhost:@port@", "LocalHost:@port@", "[::1]:@port@"):
            assert not studio.ask(request(host=host, more=f"Origin: http://{host}\r\n{upgrade}"))
            assert not studio.ask(request("/@token@", host, upgrade))


def test_a_foreign_page_is_refused_before_it_is_heard(studio: Studio) -> None:
    for more in ({"origin": "http://evil.com"}, {"subprotocols": ["viser-v0.0.0"]}, {"subprotocols": None}):
        with pytest.raises(InvalidStatus):
            studio.connect(**more)
    studio.check_that_it_goes_on()


def test_requests_that_are_none(studio: Studio, capfd: pytest.CaptureFixture[str]) -> None:
    twice = UPGRADE + "Upgrade: websocket\r\nSec-WebSocket-Protocol: @protocol@\r\n"
    for text in (
        "\r\n\r\n", "GET\r\n\r\n", "POST /@token@/ HTTP/1.1\r\nHost: 127.0.0.1:@port@\r\nContent-Length: 9\r\n\r\n", "\x16\x03\x01" * 99,
        "GET / HTTP/1.0\r\n\r\n", "GET /@token@/ HTTP/1.1\r\n\r\n", request("/" + "a" * 9000), request(more=twice),
        request(more="Upgrade: websocket\r\n"), request(more="a: b\r\n" * 300), request(more="Host : evil\r\n"),
    ):  # fmt: skip
        assert studio.ask(text), text
    assert studio.answer(studio._filled(request("/@token@/../../setup.py")).encode()).startswith(b"HTTP/1.1 404")
    assert studio.answer(studio._filled(request("/@token@/%00")).encode()).startswith(
        (b"HTTP/1.1 400", b"HTTP/1.1 404")
    )
    studio.check_that_it_goes_on()
    assert capfd.readouterr().err == ""


def change(label: str, value: object) -> dict[str, Any]:
    return {"type": "GuiUpdateMessage", "uuid": f"@part:{label}@", "updates": {"value": value}}


MESSAGES = {
    "no map": {"bytes": "93010203"},
    "no msgpack": {"bytes": "c1"},
    "nothing": {"bytes": ""},
    "cut short": {"bytes": "85a474797065"},
    "no UTF-8": {"bytes": "81a474797065a2fffe"},
    "deep": {"bytes": "91" * 20_000 + "c0"},
    "too long": {"bytes": "00" * 70_000},
    "no type": {"uuid": "a"},
    "unknown type": {"type": "Nothing"},
    "type is a number": {"type": 7},
    **{f"of no page: {other['type']}": other for other in OTHERS},
    **{f"camera without {key}": {k: v for k, v in CAMERA.items() if k != key} for key in CAMERA},
    "camera of height 0": {**CAMERA, "image_height": 0},
    "camera of width -1": {**CAMERA, "image_width": -1},
    "camera of text": {**CAMERA, "fov": "wide"},
    "camera of no number": {**CAMERA, "position": [0.0, 0.0, math.nan]},
    "camera far away": {**CAMERA, "position": [0.0, 0.0, 1e300]},
    "camera without direction": {**CAMERA, "wxyz": [0, 0, 0, 0]},
    "camera in what it looks at": {**CAMERA, "look_at": CAMERA["position"]},
    "camera of two coordinates": {**CAMERA, "position": [0.0, 0.0]},
    "camera with more": {**CAMERA, "more": 1},
    "click without a place": {**CLICK, "screen_pos": []},
    "click without a ray": {**CLICK, "ray_origin": None},
    "click of inf": {**CLICK, "ray_direction": [math.inf, 0.0, 0.0]},
    "click that drags": {**CLICK, "event_type": "rect-select"},
    "no such part": {"type": "GuiUpdateMessage", "uuid": "a", "updates": {"value": 1}},
    "another property": {"type": "GuiUpdateMessage", "uuid": "@part:cloth@", "updates": {"options": ["evil"]}},
    "method of a part": {"type": "GuiUpdateMessage", "uuid": "@part:cloth@", "updates": {"update_cb": []}},
    "updates are a list": {"type": "GuiUpdateMessage", "uuid": "@part:cloth@", "updates": [1]},
    "cloth that is none": change("cloth", "lead"),
    "cloth of 5,000 letters": change("cloth", "a" * 5000),
    "cloth of a list": change("cloth", [1.0, 2.0]),
    "grain of nan": change("grain [°]", math.nan),
    "grain beyond its end": change("grain [°]", 1e5),
    "grain of a flag": change("grain [°]", True),
    "part of one end": change("part [%]", [0]),
    "part of three ends": change("part [%]", [0, 50, 100]),
    "part the wrong way round": change("part [%]", [50, 0]),
    "part beyond its end": change("part [%]", [0, 200]),
    "button that is none": change("do", "Explode"),
    "button of a table": change("do", {"a": 1}),
    "press of text": change("Save and run", "yes"),
    "name that is a number": change("name", 5),
}  # fmt: skip


@pytest.mark.parametrize("name", list(MESSAGES))
def test_a_malformed_message_is_one_line_and_changes_nothing(
    studio: Studio, capfd: pytest.CaptureFixture[str], name: str
) -> None:
    first = len(studio.told)
    assert studio.say([MESSAGES[name]])
    (line,) = [line for line in studio.told[first:] if "'mark " not in line]
    assert line.startswith(("a message of the page was refused: ", "a page was cut off, since"))
    assert len(line) < 400
    studio.check_that_it_goes_on()
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("name", ["a" * 5000, "../up", "", "con", "a\nb", "\u202ea", "/etc/passwd"])
def test_a_name_that_no_file_can_have_is_one_line(studio: Studio, name: str) -> None:
    before = {path for path in studio.folder.rglob("*") if path.is_file()}
    first = len(studio.told)
    assert studio.say([change("name", name), change("Save and run", True)])
    (line,) = [line for line in studio.told[first:] if "'mark " not in line]
    assert line.startswith("name: ")
    assert {path for path in studio.folder.rglob("*") if path.is_file()} == before


def test_what_a_page_says_is_obeyed(studio: Studio) -> None:
    assert not studio.say([change("cloth", "denim")])
    studio.wait(lambda: studio.page.session.scene.settings.fabric == "denim")
    assert not studio.say([change("do", "Undo")])
    studio.wait(lambda: studio.page.session.scene.settings.fabric != "denim")


def test_a_choice_is_taken_although_a_drawing_sets_the_part_meanwhile(
    studio: Studio, monkeypatch: pytest.MonkeyPatch
) -> None:
    executor, session = studio.page.server._thread_executor, studio.page.session
    submit, before = executor.submit, session.scene.settings.fabric
    (part,) = [each for each in studio.parts().values() if each.label == "cloth"]
    own = part.value

    def after_a_drawing(*act: Any) -> Any:
        part.value = own
        return submit(*act)

    with monkeypatch.context() as patch:
        patch.setattr(executor, "submit", after_a_drawing)
        assert not studio.say([change("cloth", "denim")])
        studio.wait(lambda: session.scene.settings.fabric == "denim")
    assert not studio.say([change("do", "Undo")])
    studio.wait(lambda: session.scene.settings.fabric == before)


def test_a_fault_of_the_program_is_one_line_and_the_studio_goes_on(
    studio: Studio, monkeypatch: pytest.MonkeyPatch
) -> None:
    for error, words in (
        (ZeroDivisionError("division by zero"), "fault of the program: ZeroDivisionError: division by zero; see the console"),
        (OSError(36, "File name too long", "a.toml"), "cannot read or write a.toml: file name too long"),
        (InputError("no"), "no"),
    ):  # fmt: skip

        def fail(_: object, error: Exception = error) -> None:
            raise error

        monkeypatch.setattr(studio.page, "choose_mode", fail)
        first = len(studio.told)
        studio.page.server._thread_executor.submit(studio.page.choose_mode, True).result(10.0)
        assert studio.told[first:] == [words]
        studio.check_that_it_goes_on()


# --- where it listens


@pytest.mark.parametrize(
    "host", ["", "  ", "256.1.1.1", "10.255.255.1", "a b", "x" * 300, "http://127.0.0.1", "127.0.0.1/8", "[::1]"]
)
def test_a_host_that_is_none_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str], host: str) -> None:
    scene = tmp_path / "trial.toml"
    scene.write_text(SCENE)
    assert main(["studio", str(scene), "--no-open", "--host", host]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "--host" in line


def test_a_taken_port_is_no_other_port() -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        with pytest.raises(
            InputError, match=rf"cannot serve on 127.0.0.1:{port}: address already in use; give another --port"
        ):
            Door("127.0.0.1", port)


@pytest.mark.parametrize(
    ("host", "shown"),
    [("127.0.0.1", "127.0.0.1"), ("localhost", "localhost"), ("::1", "[::1]"), ("0.0.0.0", "127.0.0.1"), ("0", "127.0.0.1"),
     ("::", "[::1]")],
)  # fmt: skip
def test_the_address_that_is_printed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, host: str, shown: str
) -> None:
    """A browser takes it, it has the token, and what it opens to others is said."""
    monkeypatch.setattr(time, "sleep", interrupt_main(time.sleep))
    scene = tmp_path / "trial.toml"
    scene.write_text(SCENE)
    try:
        with socket.create_server(("::1", 0), family=socket.AF_INET6) as trial:
            port = trial.getsockname()[1]
    except OSError:
        pytest.skip("needs IPv6")
    assert main(["studio", str(scene), "--no-open", "--host", host, "--port", str(port)]) == 130
    out, err = capsys.readouterr()
    url = out.split()[0]
    assert url.startswith(f"http://{shown}:{port}/")
    assert len(url.split("/")[3]) == 32
    opens = [
        line
        for line in err.splitlines()
        if line.startswith(f"warpflat: note: --host {host} opens the studio to every machine")
    ]
    assert len(opens) == (host in ("0", "0.0.0.0", "::"))
    assert all(url.split("/")[3] in line for line in opens)


def interrupt_main(sleep: Any) -> Any:
    def short(seconds: float) -> None:
        if seconds >= 3600.0:
            raise KeyboardInterrupt
        sleep(seconds)

    return short


def test_open_to_others_it_has_the_machines_own_names_and_the_token(tmp_path: Path) -> None:
    studio = Studio(tmp_path, host="0.0.0.0")
    studio.host = "127.0.0.1"
    studio.names |= {"0.0.0.0", socket.gethostname().lower()}
    try:
        for host in ("127.0.0.1", "localhost", socket.gethostname(), "0.0.0.0"):
            assert not studio.ask(request(host=f"{host}:@port@", more=f"Origin: http://{host}:@port@\r\n"))
            assert studio.ask(request("/", host=f"{host}:@port@"))
            assert studio.ask(request(host=f"{host}:@port@", more="Origin: http://evil.com:@port@\r\n"))
        assert studio.ask(request(host="evil.com:@port@", more="Origin: http://evil.com:@port@\r\n"))
    finally:
        studio.page.close()
