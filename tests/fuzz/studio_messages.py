"""Attacks on the studio: requests of strangers and of other sites, and messages that no page sends.

An attack is a list of acts in JSON. `{"request": TEXT}` is sent as it stands; `{"say": [...]}` are messages in a connection that has
been let in, each an object, or {"bytes": HEX} as they stand. In texts @port@, @token@ and @part:LABEL@ stand for what a studio chooses.
The process that runs cases has one studio; a broken promise is an AssertionError there.
"""

from __future__ import annotations

import asyncio
import json
import re
import socket
import sys
import tempfile
import time
from concurrent.futures import Future
from contextlib import suppress
from ipaddress import ip_address
from pathlib import Path
from random import Random
from typing import Any

from .damage import DEEP, damaged_bytes, damaged_structure
from .promise import Case

__all__ = ["CAMERA", "Studio", "attack_case", "random_attack", "run_attack"]

CAMERA = {
    "type": "ViewerCameraMessage", "wxyz": [0.0, 0.0, 1.0, 0.0], "position": [0.0, 0.0, 2.0], "fov": 0.35, "near": 0.01, "far": 1000.0,
    "image_height": 600, "image_width": 900, "look_at": [0.0, 0.0, 0.0], "up_direction": [0.0, 1.0, 0.0],
}  # fmt: skip
CLICK = {
    "type": "ScenePointerMessage", "event_type": "click", "ray_origin": [0.0, 0.0, 2.0], "ray_direction": [0.1, 0.0, -1.0],
    "screen_pos": [[0.5, 0.5]], "modifier": None,
}  # fmt: skip
DRAG = {
    "type": "SceneNodeDragMessage", "phase": "start", "name": "/pattern/handle0", "instance_index": None,
    "start_position": [0.1, 0.0, 0.0], "start_screen_pos": [0.5, 0.5], "end_position": [0.1, 0.05, 0.0],
    "end_screen_pos": [0.5, 0.4], "button": "left", "modifier": None, "owner": "",
}  # fmt: skip
CHANGES = {
    "cloth": "denim", "grain [°]": 30.0, "colours": "strain energy [J/m²]", "pick": "two points", "line": "(click a line)",
    "part [%]": [0, 50], "cut": "Leave it", "look from": "Back", "do": "Undo", "name": "trial", "Save and run": True,
}  # fmt: skip
OTHERS = (
    {"type": "ShareUrlRequest"},
    {"type": "FileTransferStartUpload", "source_component_uuid": "@part:name@", "transfer_uuid": "a", "filename": "/etc/passwd",
     "mime_type": "", "part_count": 10**9, "size_bytes": 10**12},
    {"type": "RunJavascriptMessage", "source": "alert(1)"},
    {"type": "GuiFormDirtyMessage", "uuid": "@part:name@"},
    {"type": "RemoveSceneNodeMessage", "name": "/form"},
    {"type": "ResetGuiMessage"},
    {"type": "SceneNodeClickMessage", "name": "/form/cloth", "instance_index": -1, "ray_origin": [], "ray_direction": [],
     "screen_pos": [], "modifier": None},
)  # fmt: skip
PATHS = ("/", "/@token@", "/@token@x/", "//@token@/", "/@token@/../../etc/passwd", "/?token=@token@", "*", "http://evil.com/@token@/",
         "/@token@/%2e%2e/%2e%2e/", "/@token@/%00", "/@token@/" + "a" * 5000, "/\xff/")  # fmt: skip
HOSTS = ("evil.com:@port@", "evil.com", "127.0.0.1", "127.0.0.1:1", "localhost.evil.com:@port@", "127.0.0.1:@port@@evil.com",
         "evil.com@127.0.0.1:@port@", "LOCALHOST:@port@", "localhost.:@port@", "0:@port@", "2130706433:@port@", "[::1]:@port@",
         "[::ffff:127.0.0.1]:@port@", "", "evil.com:@port@\r\nHost: 127.0.0.1:@port@", "[::1", "127.0.0.1:@port@/", "\xff")  # fmt: skip
ORIGINS = ("http://evil.com:@port@", "https://127.0.0.1:@port@", "null", "", "file://", "http://127.0.0.1:@port@.evil.com",
           "http://127.0.0.1:9999", "http://localhost:@port@, http://evil.com",
           "chrome-extension://a", "http://[", "127.0.0.1:@port@")  # fmt: skip
UPGRADE = "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
SCENE = {
    "surface": {"shape": "dome", "resolution": 5},
    "cuts": [{"name": "slit", "line": "centre", "part": [0.0, 0.5]}],  # its ends can be dragged
    "output": {"frames": 0, "picture": False},
    "pattern": {"formats": []},
}


def attack_case(content: bytes, **more: Any) -> Case:
    """The case of an attack."""
    # The first one starts the studio, which takes ten seconds and more where others work, too.
    return Case(
        "studio",
        {"attack.json": content},
        ("studio-attack", "attack.json"),
        subject="attack.json",
        seconds=90.0,
        **more,
    )


def random_attack(random: Random) -> Case:
    """One to four acts, each a request or some messages."""
    acts = [
        _request(random) if random.randrange(5) < 2 else _messages(random) for _ in range(random.choice((1, 1, 2, 4)))
    ]
    return attack_case(json.dumps(acts).encode())


def _request(random: Random) -> dict[str, Any]:
    path = "/@token@/" if random.randrange(3) else random.choice(PATHS)
    host = (
        random.choice(HOSTS) if random.randrange(2) else random.choice(("127.0.0.1", "localhost", "[::1]")) + ":@port@"
    )
    text = f"GET {path} HTTP/1.1\r\nHost: {host}\r\n"
    if random.randrange(2):
        origin = random.choice(ORIGINS) if random.randrange(2) else f"http://{host}"
        text += f"Origin: {origin}\r\n"
    if random.randrange(2):
        text += UPGRADE + "Sec-WebSocket-Protocol: @protocol@\r\n"
    text += "\r\n"
    if random.randrange(3) == 0:
        text = damaged_bytes(random, text.encode("latin-1")).decode("latin-1")
    return {"request": text}


def _messages(random: Random) -> dict[str, Any]:
    import msgspec

    label, value = random.choice(list(CHANGES.items()))
    change = {"type": "GuiUpdateMessage", "uuid": f"@part:{label}@", "updates": {"value": value}}
    drag = {**DRAG, "phase": random.choice(("start", "update", "end"))}
    message = random.choice((CAMERA, CLICK, drag, drag, change, change, change, random.choice(OTHERS)))
    said: list[Any] = []
    for _ in range(random.choice((1, 1, 1, 3))):
        if random.randrange(4):
            said.append(damaged_structure(random, message) if random.randrange(6) else message)
        else:
            content = random.choice((b"", b"\x91" * 20_000, b"\x00" * 70_000, msgspec.msgpack.encode(message)))
            said.append({"bytes": damaged_bytes(random, content).hex()})
    return {"say": said}


def run_attack(file: Path) -> int:
    """Do what an attack says to the studio of this process; return 2 if some of it was refused, 0 if all was obeyed.

    Raises:
        AssertionError: something was read or changed that must not be, a line is missing, or the studio does not go on.
    """
    global _studio
    if _studio is None:
        # Beside the folders of the case, which is removed with the process.
        _studio = Studio(Path(tempfile.mkdtemp(prefix="studio-", dir=file.resolve().parents[2])))
    acts = json.loads(file.read_text(encoding="utf-8"))
    refused = 0
    for act in acts:
        refused += _studio.ask(act["request"]) if "request" in act else _studio.say(act["say"])
    _studio.check_that_it_goes_on()
    if refused:
        print(f"warpflat: {file.name}: {refused} of {len(acts)} acts refused", file=sys.stderr)
    return 2 if refused else 0


class Studio:
    """A studio on this machine, and what is done to it.

    Attributes:
        told: every line that the page was told, in order.
        names: by which a request may call it.
    """

    def __init__(self, folder: Path, host: str = "127.0.0.1") -> None:
        from warpflat.app.scene.load import make_scene
        from warpflat.app.studio.page import Page
        from warpflat.app.studio.session import Session

        self.told: list[str] = []
        tell = Session.tell

        def note(session: Session, error: str) -> None:
            tell(session, error)
            self.told.append(session.error)

        Session.tell = note  # type: ignore[method-assign]
        try:
            self.folder, self._marks = folder, 0
            scene = make_scene(SCENE, name="secret", folder=folder, where="secret")
            self.page = Page(scene, host=host, port=0, out=folder / "out")
        finally:
            Session.tell = tell  # type: ignore[method-assign]
        self.page.session.tell = lambda error: note(self.page.session, error)  # type: ignore[method-assign]
        self._acts: list[Future[Any]] = []
        submit = self.page.server._thread_executor.submit

        def listed(*act: Any) -> Future[Any]:
            self._acts.append(submit(*act))
            return self._acts[-1]

        self.page.server._thread_executor.submit = listed
        self.names = {"localhost", "127.0.0.1", "::1"}
        self.host, self.port = host, self.page.server.get_port()
        self.token = self.page.url.rstrip("/").rpartition("/")[2]
        self.wait(lambda: self.page.is_idle and self.page.session.solution is not None)

    def state(self) -> tuple[object, ...]:
        """What no refused act may change."""
        session = self.page.session
        files = {path: path.read_bytes() for path in self.folder.rglob("*") if path.is_file()}
        parts = {uuid: part.value for uuid, part in self.parts().items()}
        return session.step, len(session._steps), session.preview, session.saved, parts, files

    def ask(self, request: str) -> bool:
        """Send a request as it stands; return whether it was refused."""
        before, told = self.state(), list(self.told)
        content = self._filled(request).encode("latin-1", "replace")
        answer = self.answer(content)
        status = answer.split(b"\r\n", 1)[0].split(b" ")[1:2]
        if status in ([b"200"], [b"101"], [b"404"]):
            assert self._may_come_in(content), f"let in: {content!r:.500}"
            return False
        body = answer.partition(b"\r\n\r\n")[2]
        no_handshake = b"Failed to open a WebSocket connection"  # how websockets answers to a key that is none
        assert status in ([], [b"400"], [b"403"], [b"426"]) or body.startswith(no_handshake), (
            f"{answer!r} to {content!r}"
        )
        assert len(body) < 300, f"{body!r:.500}"
        assert b"secret" not in answer
        assert self.token.encode() not in answer
        assert self.told == told, "a stranger writes on the page"
        assert self.state() == before, f"changed by {content!r:.500}"
        return True

    def answer(self, content: bytes) -> bytes:
        """Return what a request as it stands is answered, as far as the end of its head, or all of what is no page."""
        answer = b""
        with socket.create_connection((self.host, self.port), timeout=10.0) as stranger:
            try:
                stranger.sendall(content)
                if b"\r\n\r\n" not in content:
                    stranger.shutdown(socket.SHUT_WR)
                while piece := stranger.recv(65536):
                    answer += piece
                    if answer.startswith((b"HTTP/1.1 101", b"HTTP/1.1 200")) and b"\r\n\r\n" in answer:
                        break
            except (ConnectionError, TimeoutError):
                pass  # cut off before all was sent or read
        return answer

    def say(self, messages: list[Any]) -> bool:
        """Say something in a connection that has been let in; return whether any of it was refused."""
        from websockets.exceptions import ConnectionClosed

        raw = [self._encoded(message) for message in messages]
        with self.connect() as page:
            page.send(self._encoded(CAMERA))
            # A page that is loaded begins without marks, whatever it says then.
            self._mark(page)
            self._come_to_rest()
            before, first = self.state(), len(self.told)
            try:
                for content in raw:
                    page.send(content)
                went_on = self._mark(page)
            except ConnectionClosed:
                went_on = False
            self.wait(lambda: went_on or any("cut off" in line for line in self.told[first:]))
            self._come_to_rest()
        told = [line for line in self.told[first:] if "'mark " not in line]
        assert not any("fault of the program" in line for line in told), f"{told} after {messages!r:.500}"
        assert all(line.strip() and len(line.splitlines()) == 1 and len(line) < 2000 for line in told), told
        if len(told) == len(messages) and all("refused: " in line or "cut off" in line for line in told):
            changed = [(old, new) for old, new in zip(before, self.state(), strict=True) if old != new]
            assert not changed, f"{changed!r:.500} by {messages!r:.500}"
        return bool(told)

    def connect(self, **more: Any) -> Any:
        """Return a connection as the page has it."""
        import viser
        from websockets.sync.client import connect

        host = f"[{self.host}]" if ":" in self.host else self.host
        more = {"origin": f"http://{host}:{self.port}", "subprotocols": [f"viser-v{viser.__version__}"], **more}
        return connect(
            self.page.url.replace("http", "ws", 1),
            max_size=None,
            max_queue=None,
            open_timeout=10.0,
            close_timeout=1.0,
            **more,
        )

    def check_that_it_goes_on(self) -> None:
        """A page is let in, is sent something, and is heard."""
        with self.connect() as page:
            assert page.recv(timeout=10.0)
            assert self._mark(page)

    def _mark(self, page: Any) -> bool:
        """Wait until all that was said before in a connection has been heard; return whether it is open still."""
        self._marks += 1
        page.send(self._encoded({"type": f"mark {self._marks}"}))
        self.wait(lambda: page.close_code is not None or f"'mark {self._marks}'" in "".join(self.told[-20:]))
        return page.close_code is None

    def _come_to_rest(self) -> None:
        """Wait until everything that was heard has been done."""
        loop = self.page.server._event_loop
        for _ in range(3):  # a message is handled by a task, which may begin another
            asyncio.run_coroutine_threadsafe(asyncio.sleep(0.0), loop).result(10.0)
        self.wait(lambda: all(act.done() for act in self._acts))
        self._acts.clear()
        self.wait(lambda: self.page.is_idle)

    def wait(self, what: Any) -> None:
        """Wait until something is so, for half a minute."""
        end = time.monotonic() + 30.0
        while not what():
            assert time.monotonic() < end, "the studio does not go on"
            time.sleep(0.002)

    def parts(self) -> dict[str, Any]:
        """Return the parts of the panel."""
        return dict(self.page.server.gui._gui_input_handle_from_uuid)

    def _filled(self, text: str) -> str:
        """A text with what this studio has chosen."""
        import viser

        for word, value in (
            ("port", str(self.port)),
            ("token", self.token),
            ("protocol", f"viser-v{viser.__version__}"),
        ):
            text = text.replace(f"@{word}@", value)
        uuids = {part.label: uuid for uuid, part in self.parts().items()}
        return re.sub(r"@part:([^@]*)@", lambda found: uuids.get(found[1], found[1]), text)

    def _encoded(self, message: Any) -> bytes:
        import msgspec

        if isinstance(message, dict) and isinstance(message.get("bytes"), str) and len(message) == 1:
            return bytes.fromhex(message["bytes"])

        def fill(value: Any) -> Any:
            if isinstance(value, dict):
                return {fill(key): fill(item) for key, item in value.items()}
            if isinstance(value, list):
                return [fill(item) for item in value]
            if isinstance(value, int) and not -(2**63) <= value < 2**64:
                return float(value)
            return self._filled(value).encode("utf-8", "replace").decode() if isinstance(value, str) else value

        deep = msgspec.msgpack.encode(DEEP)
        return msgspec.msgpack.encode(fill(message)).replace(deep, b"\x91" * 20_000 + b"\xc0")

    def _may_come_in(self, request: bytes) -> bool:
        """Whether a request names this studio, comes from its page and has its token."""
        line, *headers = request.partition(b"\r\n\r\n")[0].split(b"\n")
        found: dict[str, list[str]] = {"host": [], "origin": []}
        for header in headers:
            name, _, value = header.decode("latin-1").partition(":")
            if name.lower() in found:
                found[name.lower()].append(value.strip())
        own = [self._is_own(host) for host in found["host"]]
        origins = [origin.startswith("http://") and self._is_own(origin[7:]) for origin in found["origin"]]
        return line.startswith(f"GET /{self.token}".encode()) and own == [True] and all(origins)

    def _is_own(self, authority: str) -> bool:
        name, _, port = authority.rpartition(":")
        if port != str(self.port):
            return False
        with suppress(ValueError):
            name = str(ip_address(name.strip("[]")))
        return name.lower() in self.names


_studio: Studio | None = None
