"""Headless Chromium, driven by its DevTools protocol."""

from __future__ import annotations

import base64
import json
import subprocess
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from websockets.sync.client import connect


class Chromium:
    """A page of the browser.

    Attributes:
        requests: every address that it has asked for.
        faults: exceptions of its scripts.
    """

    def __init__(self, socket: Any) -> None:
        self._socket, self._number = socket, 0
        self.requests, self.faults = list[str](), list[str]()
        for domain in ("Network", "Runtime", "Page"):
            self.send(f"{domain}.enable")

    def send(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Send a command and return its result."""
        self._number += 1
        self._socket.send(json.dumps({"id": self._number, "method": method, "params": parameters}))
        while True:
            message = json.loads(self._socket.recv(timeout=120.0))
            if message.get("id") == self._number:
                assert "error" not in message, message
                return dict(message["result"])
            self._note(message)

    def _note(self, message: dict[str, Any]) -> None:
        told = message.get("params", {})
        if message.get("method") == "Network.requestWillBeSent":
            self.requests.append(told["request"]["url"])
        elif message.get("method") == "Network.webSocketCreated":
            self.requests.append(told["url"])
        elif message.get("method") == "Runtime.exceptionThrown":
            self.faults.append(str(told["exceptionDetails"].get("exception", {}).get("description")))

    def run(self, script: str) -> Any:
        """Return what an expression gives."""
        return self.send("Runtime.evaluate", expression=script, returnByValue=True)["result"].get("value")

    def run_async(self, script: str) -> Any:
        """Return what the promise of an expression gives."""
        return self.send("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)["result"][
            "value"
        ]

    def wait(self, script: str, seconds: float = 60.0) -> Any:
        """Return what an expression gives as soon as that counts as true."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            value = self.run(script)
            if value:
                return value
            time.sleep(0.1)
        raise AssertionError(f"{script} did not come true; the page says: {self.run('document.body.innerText')}")

    def click(self, x: float, y: float) -> None:
        """Click with the mouse at a place [CSS pixels]."""
        for kind, button in (("mouseMoved", "none"), ("mousePressed", "left"), ("mouseReleased", "left")):
            self.send("Input.dispatchMouseEvent", type=kind, x=x, y=y, button=button, clickCount=1)
            time.sleep(0.1)

    def drag(self, start: tuple[float, float], end: tuple[float, float], parts: int = 6) -> None:
        """Drag with the left button from a place to another [CSS pixels], in some parts."""
        path = [tuple(a + (b - a) * k / parts for a, b in zip(start, end, strict=True)) for k in range(parts + 1)]
        for kind, button, (x, y) in (
            ("mouseMoved", "none", start), ("mousePressed", "left", start),
            *(("mouseMoved", "left", place) for place in path[1:]), ("mouseReleased", "left", end),
        ):  # fmt: skip
            pressed = int(button == "left" and kind != "mouseReleased")
            self.send("Input.dispatchMouseEvent", type=kind, x=x, y=y, button=button, buttons=pressed, clickCount=1)
            time.sleep(0.15)

    def press(self, words: str) -> None:
        """Press the button with these words."""
        self.wait(_VISIBLE % ("button", json.dumps(words)) + "?.click() === undefined")

    def choose(self, label: str, value: str) -> None:
        """Choose a value of the list with this label."""
        box = _BOX % json.dumps(label)
        self.wait(f"!!{box}")
        # The list of a box that is scrolled out of sight is hidden.
        self.run(f"{box}.scrollIntoView({{block: 'center'}})")
        self.run(f"{box}.click()")
        self.wait(_VISIBLE % ("[role=option]", json.dumps(value)) + " != null")
        self.run(_VISIBLE % ("[role=option]", json.dumps(value)) + ".click()")

    def prefer(self, scheme: str) -> None:
        """Let the system be "dark" or "light"."""
        self.send("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])

    def picture(self, path: Path) -> None:
        """Save what is seen."""
        path.write_bytes(base64.b64decode(self.send("Page.captureScreenshot", format="png")["data"]))


_VISIBLE = "[...document.querySelectorAll('%s')].find(e => e.innerText.trim() === %s && e.offsetParent !== null)"


# The input nearest to a text.
_BOX = """((words) => {
    const text = [...document.querySelectorAll("*")].find(e => !e.children.length && e.textContent.trim() === words);
    for (let box = text; box; box = box.parentElement) {
        const found = box.querySelector("input");
        if (found) return found;
    }
})(%s)"""


@contextmanager
def chromium(program: str, profile: Path, width: int, height: int) -> Iterator[Chromium]:
    """Run the browser with a window of this size."""
    command = [
        program, "--headless=new", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
        "--ignore-gpu-blocklist", "--remote-debugging-port=0", f"--user-data-dir={profile}", "--no-first-run",
        "--disable-background-networking", "--disable-component-update", f"--window-size={width},{height}", "about:blank",
    ]  # fmt: skip
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as process:
        try:
            assert process.stderr is not None
            line = next(line for line in process.stderr if "DevTools listening" in line)
            port = line.rsplit(":", 1)[1].partition("/")[0]
            with urllib.request.urlopen(f"http://127.0.0.1:{port}/json") as answer:
                (page,) = [each for each in json.load(answer) if each["type"] == "page"]
            with connect(page["webSocketDebuggerUrl"], max_size=None) as socket:
                yield Chromium(socket)
        finally:
            process.terminate()
            process.communicate()
