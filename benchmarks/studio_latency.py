"""How soon an edit of a 10,000-vertex piece is seen in the studio: from the request to its first picture at a client, and to rest.

python benchmarks/studio_latency.py

A client of the page's own protocol takes what the server sends. A browser draws it in its next picture. Times are wall time and
processor time of the whole process, client included; on a machine that does other work, too, only the latter says much.
"""

from __future__ import annotations

import socket
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path

import viser
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

import warpflat
from warpflat.app.cli.run import start_warp_silently
from warpflat.app.studio.cut_tables import cut_along
from warpflat.app.studio.page import Page

SCENES = Path(__file__).parents[1] / "scenes"
# A message with a piece's mesh is larger than this [bytes].
_PICTURE = 40_000

Cut = tuple[str, str, tuple[float, float] | None]


class Client:
    """Takes messages and notes when pictures arrive: wall time and processor time [s]."""

    def __init__(self, url: str) -> None:
        self.pictures: list[tuple[float, float]] = []
        self._socket = connect(
            url.replace("http", "ws"),
            subprotocols=[f"viser-v{viser.__version__}"],
            max_size=None,  # type: ignore[list-item]
        )
        threading.Thread(target=self._take, daemon=True).start()

    def _take(self) -> None:
        try:
            for message in self._socket:
                if len(message) > _PICTURE:
                    self.pictures.append((time.perf_counter(), time.process_time()))
        except ConnectionClosed:
            return


def main() -> int:
    start_warp_silently()
    folder = Path(tempfile.mkdtemp())
    data = {"surface": {"shape": "bodice", "resolution": 100}, "fabric": "woven", "datum": "centre"}
    cuts = [("bodice", "bust", (0.0, 0.3)), ("bodice", "centre", (0.0, 0.6))]
    time_edits(warpflat.make_scene(data, name="bodice", folder=folder, where="bodice"), folder, cuts, grain=True)
    time_edits(warpflat.load_scene(SCENES / "paper_block.toml"), folder, [("front_bodice", "bust", None)], grain=False)
    return 0


def time_edits(scene: warpflat.Scene, folder: Path, cuts: list[Cut], *, grain: bool) -> None:
    """Edit a scene twice over and print how soon each edit was seen."""
    with socket.socket() as trial:
        trial.bind(("127.0.0.1", 0))
        port = trial.getsockname()[1]
    page = Page(scene, host="127.0.0.1", port=port, out=folder)
    client, session = Client(page.url), page.session
    wait(page)
    solution = session.solution
    assert solution is not None
    print(f"\n{scene.name}: {sum(len(piece.positions) for piece in solution.pieces.values()):,} vertices\n")
    print(
        f"{'edit':24}{'first picture [ms]':>22}{'at rest [ms]':>22}\n{'':24}{'wall, processor':>22}{'wall, processor':>22}"
    )

    def edit(words: str, act: Callable[[], None]) -> None:
        client.pictures.clear()
        begun = time.perf_counter(), time.process_time()
        act()
        while not client.pictures:
            if session.error:
                raise SystemExit(session.error)
            time.sleep(0.01)
        wait(page)
        times = [[1e3 * (now - then) for now, then in zip(client.pictures[at], begun, strict=True)] for at in (0, -1)]
        print(f"{words:24}" + "".join(f"{wall:>13.0f}, {used:>7.0f}" for wall, used in times))

    for _ in range(2):
        for fabric in ("denim", "interlock", "woven"):
            edit(f"cloth: {fabric}", lambda fabric=fabric: session.change("cloth", fabric=fabric))
        for angle in (30.0, 0.0) if grain else ():
            edit(f"grain: {angle:.0f} degrees", lambda angle=angle: session.change("grain", grain_angle=angle))
        for piece, line, part in cuts:
            before = session.step.solution
            assert before is not None
            edit(f"cut: {line}", lambda at=(before, piece, line, part): session.try_cut(cut_along(*at)))
            edit("leave the cut", session.drop_preview)
        edit("undo", session.undo)
        session.redo()  # the second time begins as the first one did
        wait(page)
    page.close()


def wait(page: Page) -> None:
    """Wait until nothing is solved nor drawn."""
    while True:
        time.sleep(0.3)
        if page.is_idle:
            return


if __name__ == "__main__":
    sys.exit(main())
