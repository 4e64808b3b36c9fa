"""The page: a viser server that shows a session and passes on what is done there."""

from __future__ import annotations

import contextlib
import io
import threading
import time
import traceback
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import viser

from warpflat.app.scene.load import Scene
from warpflat.app.studio.cut_tables import cut_along, cut_between, cuttable_lines
from warpflat.app.studio.door import Door
from warpflat.app.studio.frame import BETWEEN, PieceFrame
from warpflat.app.studio.handles import Handle, pattern_handles
from warpflat.app.studio.maps import MapScale, drape_gaps, drape_scale, piece_scale
from warpflat.app.studio.messages import read_message
from warpflat.app.studio.panel import Panel
from warpflat.app.studio.pick import Hit, nearest_line
from warpflat.app.studio.save import free_name
from warpflat.app.studio.session import Session, Step
from warpflat.app.studio.solve import Solution
from warpflat.app.studio.stage import Shown, Stage
from warpflat.app.studio.worker import Worker
from warpflat.core import FloatArray, InputError, IntArray
from warpflat.garment import Drape, Mannequin

__all__ = ["Page"]

# Pictures come `BETWEEN` apart, and the newest wins. Words alone, so many seconds apart, take no picture's turn: the first picture of an
# edit comes as soon as there is one.
_BETWEEN_WORDS = 0.02
# All is shown anew where form or pattern has grown or shrunk by more than this share.
_REFIT = 0.02


class Page:
    """A studio in the browser.

    Attributes:
        url: of the page, with the token that lets in.
    """

    def __init__(self, scene: Scene, *, host: str, port: int, out: Path) -> None:
        """Serve a scene's studio.

        Raises:
            InputError: the port is taken, or the address is not of this machine.
        """
        self.door = Door(host, port)
        self._worker = Worker()
        self.session = Session(scene, self._worker, out=out, on_change=self._changed, on_frame=self._take)
        # What a page says wrongly, and what fails of what it asks for, is one line of the session. The server greets on
        # standard output, which is for results.
        with (
            contextlib.redirect_stdout(io.StringIO()),
            self.door.guard(
                lambda said: read_message(said, server.gui._gui_input_handle_from_uuid),
                self.session.tell,
                self.session.saved_file,
            ),
        ):
            server = viser.ViserServer(label="warpflat studio", verbose=False)
        # Each callback of viser goes through here.
        submit = server._thread_executor.submit
        server._thread_executor.submit = lambda act, *event: submit(self.session.attempt, lambda: act(*event))
        server.gui.main_panel.dock_right()
        server.gui.main_panel.set_width(340)
        self.server, self.url = server, self.door.url
        self._kind = "energy"
        self._drape_of: Step | None = None  # whose drape has been asked for
        self.scale: MapScale | None = None
        self._two_points, self._points = False, list[Hit]()
        self._picked: tuple[str, str] | None = None
        self._marked_in: Step | None = None  # the step in which line and points were picked
        self._handles: tuple[Solution | None, dict[str, Handle]] = (None, {})
        self._held: Handle | None = None  # what is being dragged, as it was when that began
        self._dragged_to: FloatArray | None = None  # where to, until that is being solved
        self._goes_on = False  # whether the drag has changed the scene already
        self._drag_lock = threading.Lock()
        self._frames: dict[str, PieceFrame] = {}
        self._drawn: tuple[object, ...] = ()
        self._body: Mannequin | None = None
        self._seen: tuple[str, ...] = ()  # the pieces that every camera has been set upon
        self._shown_size = np.zeros(2)  # how wide and high form and pattern were then [m]
        self._lines: tuple[Solution | None, dict[str, dict[str, IntArray]]] = (None, {})
        self._dirty, self._closed, self._told, self._drawing = threading.Event(), False, True, False
        self.stage = Stage(self.server)
        self.server.gui.configure_theme(control_width="large", show_logo=False, show_share_button=False)
        self._panel = Panel(self, name=free_name(scene))
        self.server.on_client_connect(self._greet)
        self.server.scene.on_click()(self._click)
        self._painter = threading.Thread(target=self._paint, name="painter", daemon=True)
        self._painter.start()
        self.session.begin()

    @property
    def is_idle(self) -> bool:
        """Whether nothing is being solved or waits to be drawn."""
        return not (self._worker.is_busy or self._dirty.is_set() or self._drawing)

    def close(self) -> None:
        """End the studio."""
        self._closed = True
        self._dirty.set()
        self._worker.close()
        self.server.stop()

    def _changed(self) -> None:
        if not self.session.activity:
            self._frames = {}
            self._drag_on()
        self._told = True
        self._dirty.set()

    def _take(self, name: str, frame: PieceFrame) -> None:
        self._frames = {**self._frames, name: frame}
        self._dirty.set()

    def _paint(self) -> None:
        """Draw what is new, pictures at most ten times a second."""
        while True:
            self._dirty.wait()
            if self._closed:
                return
            self._drawing = True
            self._dirty.clear()
            begun, pause = time.monotonic(), BETWEEN
            try:
                pause = BETWEEN if self._draw() else _BETWEEN_WORDS
            except Exception:
                # The next picture may be a better one; the fault is told where programs tell them.
                traceback.print_exc()
            self._drawing = False
            time.sleep(max(0.0, pause - (time.monotonic() - begun)))

    def _draw(self) -> bool:
        """Draw what is new, and return whether pieces are."""
        solution, live = self.session.shown, self._frames
        if solution is None and not live:
            self._update_panel()
            return False
        drape = self.session.step.drape if self.session.preview is None and not live else None
        given_up = self.session.step is not self._drape_of or self.session.error
        if self._kind == "drape" and drape is None and given_up and self.session.preview is None and not live:
            self._kind = "energy"
            self._panel.set_map("energy")
        kind = self._kind if self._kind != "drape" or drape is not None else "energy"
        state = (solution, kind, drape, self._held is None, *live.values())
        is_new = state != self._drawn
        if is_new:
            self._drawn = state
            # While pieces are being relaxed, the scale and their places on the table stay.
            pieces = self._pieces(solution, live, kind, drape)
            at_rest = not live
            if at_rest or self.scale is None or self.scale.kind != kind:
                frames = [piece.frame for piece in pieces.values()]
                self.scale = drape_scale(drape) if drape is not None and kind == "drape" else piece_scale(kind, frames)
                self._panel.show_scale(self.scale)
            # What is dragged stays below the pointer.
            if at_rest and self._held is None:
                self.stage.lay_out(pieces)
            self.stage.draw(pieces, self.scale, tentative=self.session.preview is not None)
            if not live and solution is not None:
                # Names, the body and the camera that shows all pieces do not change while pieces are being relaxed.
                self.stage.write_names({name: name.replace("_", " ") for name in solution.pieces})
                body = None if solution.plan is None else solution.plan.mannequin
                others = self._seen != tuple(solution.pieces)
                if body is not self._body or others:
                    self.stage.draw_body(None if body is None else body.surface())
                    self._body = body
                size = np.array(self.stage.size)
                grown = np.abs(size - self._shown_size).max() > _REFIT * self._shown_size.max()
                if (others or grown) and self._held is None:
                    self._seen, self._shown_size = tuple(solution.pieces), size
                    for client in self.server.get_clients().values():
                        self.stage.show_all(client)
                # While a cut is only tried, nothing can be dragged in the pattern.
                if self.session.preview is not None:
                    self._handles = None, {}
                elif self._handles[0] is not solution:
                    self._handles = solution, {f"{each.piece}: {each.name}": each for each in pattern_handles(solution)}
                known = self._handles[1]
                self.stage.show_handles({name: (each.piece, each.place) for name, each in known.items()}, self._drag)
        if self._told:
            self._told = False
            self._update_panel()
        return is_new

    def _pieces(
        self, solution: Solution | None, live: Mapping[str, PieceFrame], kind: str, drape: Drape | None
    ) -> dict[str, Shown]:
        """Return what is to be drawn of each piece: as it is being relaxed, or as it is at rest."""
        angle = float(self.session.scene.settings.grain_angle)
        frames = {} if solution is None else {n: PieceFrame.of_result(p) for n, p in solution.pieces.items()}
        if live:
            # Of another form the pieces before are gone.
            frames = {**(frames if frames.keys() >= live.keys() else {}), **live}
        lines = {
            name: {line: np.asarray(ids) for line, ids in frame.surface.lines.items() if len(ids) > 1}
            for name, frame in frames.items()
        }
        if kind == "drape" and drape is not None:
            cloth = drape.cloth
            return {
                name: Shown(
                    frame=frame,
                    space=drape.positions[cloth.welded[cloth.piece_vertices[name]]],
                    values=drape_gaps(drape, name),
                    lines=lines[name],
                    grain_angle=angle,
                )
                for name, frame in frames.items()
            }
        return {name: Shown.of_map(frame, kind, lines[name], angle) for name, frame in frames.items()}

    async def _drag(self, name: str, event: viser.SceneNodeDragEvent[Any]) -> None:
        """Take a handle where the pointer is; awaited by the server, so that the parts of a drag keep their order."""
        if event.phase == "start":
            # What a handle changes is told by the pattern that it was shown with.
            known, handles = self._handles
            self._held, self._goes_on = handles.get(name) if known is self.session.step.solution else None, False
            if self._held is None:
                self.session.tell("the pattern is not at rest yet; drag it when it is")
        if self._held is not None:
            self._dragged_to = self.stage.on_table(self._held.piece, event.end_position)
            self._drag_on(last=event.phase == "end")
            self._dirty.set()

    def _drag_on(self, *, last: bool = False) -> None:
        """Solve for the newest place of what is dragged, once what is being solved is done: so the numbers follow."""
        with self._drag_lock:
            handle, place = self._held, self._dragged_to
            if last:
                self._held = None
            if handle is None or place is None or (self.session.activity and not last):
                return
            self._dragged_to = None
        self.session.attempt(
            lambda: self.session.change(f"{handle.piece}: {handle.name}", again=self._goes_on, **handle.change(place))
        )
        self._goes_on = True

    def undo(self) -> None:
        """Undo the last change; what was picked is no longer of what is shown."""
        self._picked, self._points = None, []
        self.session.undo()

    def redo(self) -> None:
        """Make the change again that was undone last."""
        self._picked, self._points = None, []
        self.session.redo()

    def _update_panel(self) -> None:
        solution = self.session.solution
        if self._marked_in is not self.session.step:
            # Another scene has other lines.
            self._marked_in, self._picked, self._points = self.session.step, None, []
        known = self._cuttable(solution)
        lines = [(piece, line) for piece, cuttable in known.items() for line in cuttable]
        if self._picked not in lines:
            self._picked = None
        self._panel.update(lines=lines, picked=self._picked)
        marked = None
        if self._picked is not None and solution is not None:
            piece, line = self._picked
            marked = solution.pieces[piece].surface, known[piece][line]
        self.stage.mark(marked, self._points)

    def _cuttable(self, solution: Solution | None) -> dict[str, dict[str, IntArray]]:
        """Return by piece the lines that can be cut."""
        if solution is None:
            return {}
        if self._lines[0] is not solution:
            self._lines = solution, {name: cuttable_lines(solution, name) for name in solution.pieces}
        return self._lines[1]

    def _greet(self, client: viser.ClientHandle) -> None:
        """Set the camera of a page that has been opened, and follow it; a window of another shape shows all again."""
        shape = [0.0]
        if len(self.server.get_clients()) <= 1 and (self._picked is not None or self._points):
            # A page that was loaded again begins without marks.
            self.choose_line(None)

        def follow(camera: viser.CameraHandle) -> None:
            if abs(camera.aspect - shape[0]) > 0.01 * camera.aspect:
                shape[0] = camera.aspect
                self.stage.show_all(client)
            self.stage.face(camera.wxyz)

        client.camera.on_update(follow)
        follow(client.camera)

    def _click(self, event: viser.SceneClickEvent) -> None:
        hit, solution = self.stage.pick(event.ray_origin, event.ray_direction), self.session.solution
        if hit is None or solution is None:
            return
        if self._two_points:
            # The second point makes a cut.
            self._points = [hit] if len(self._points) != 1 else [*self._points, hit]
            self._picked = None
            if len(self._points) == 2:
                self._try(lambda: cut_between(solution, *self._points))
            else:
                self.session.drop_preview()
        elif hit.piece in solution.pieces:
            surface = solution.pieces[hit.piece].surface
            line = nearest_line(hit.point, surface.vertices, self._cuttable(solution)[hit.piece])
            if line is None:
                self.session.tell('no line runs within 2 cm of the click; click nearer, or pick "two points"')
            else:
                self.choose_line((hit.piece, line))

    def choose_mode(self, two_points: bool) -> None:
        """Let clicks pick two points, or lines."""
        self._two_points = two_points
        self.choose_line(None)

    def choose_line(self, picked: tuple[str, str] | None) -> None:
        """Pick a line of a piece, and try a cut along it; None picks none."""
        self._picked, self._points = picked, []
        solution = self.session.solution
        if picked is None or solution is None:
            self.session.drop_preview()
        else:
            self._try(lambda: cut_along(solution, *picked))

    def try_part(self, part: tuple[float, float]) -> None:
        """Try a cut along a part of the picked line, in shares of its length."""
        picked, solution = self._picked, self.session.solution
        if picked is None or solution is None:
            self.session.tell("pick a line first; the part is one of a line")
        else:
            self._try(lambda: cut_along(solution, *picked, part))

    def _try(self, table: Callable[[], dict[str, Any]]) -> None:
        try:
            self.session.try_cut(table())
        except InputError as error:
            self.session.tell(str(error))

    def choose_map(self, kind: str) -> None:
        """Show a map, by its key in `MAPS`."""
        self._kind = kind
        if kind == "drape":
            self._drape_of = self.session.step
            self.session.ask_drape()
        self._told = True
        self._dirty.set()
