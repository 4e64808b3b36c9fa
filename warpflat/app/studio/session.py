"""The state of a studio: the scene, what it gave, and the way back. It knows no page."""

from __future__ import annotations

import sys
import threading
import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from warpflat.app.scene.cuts import scene_with
from warpflat.app.scene.drape import drape_scene
from warpflat.app.scene.ledger import with_cut
from warpflat.app.scene.load import Scene, scene_fabric
from warpflat.app.studio.frame import PieceFrame, Watch
from warpflat.app.studio.save import Saved, run_saved, scene_file, write_scene
from warpflat.app.studio.solve import Solution, solve
from warpflat.app.studio.worker import Superseded, Ticket, Worker
from warpflat.core import InputError, activity_listener, one_line, system_reason
from warpflat.flat import relaxation
from warpflat.garment import Drape

__all__ = ["Preview", "Session", "Step"]

# Tables that name pieces, edges and seams of a form: another form has others.
_OF_ONE_FORM = ("cuts", "seams", "constraints", "openings", "finishing", "pockets")
_OF_ONE_PATTERN = ("names", "kinds", "allowances_mm")


@dataclass(kw_only=True, eq=False)
class Step:
    """A scene on the way, with what it gave.

    Attributes:
        what: what was changed, in a word.
        scene: after the change.
        solution: None until it has been solved.
        stand_in: what is shown until then, of the change that it takes the place of.
        drape: None until it has been asked for.
    """

    what: str
    scene: Scene
    solution: Solution | None = None
    stand_in: Solution | None = None
    drape: Drape | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class Preview:
    """A cut that has been tried.

    Attributes:
        cut: its table in `[[cuts]]`.
        step: the scene with it, solved.
        released: the strain energy that it releases [J].
        share: of all strain energy before.
        opening: how wide it opens at its widest [m]; None of a seam.
        overlap: by how much pieces lie over themselves with it [m2].
    """

    cut: Mapping[str, Any]
    step: Step
    released: float
    share: float
    opening: float | None
    overlap: float = 0.0


class Session:
    """A scene that is edited; every edit is solved, and can be undone.

    Attributes:
        error: the last mistake, one line; empty after the next request.
        note: what the user should know of the last request; empty otherwise.
        activity: what is being done; empty when nothing is.
        preview: the cut that is shown and not yet made.
        saved: what was saved last.
    """

    def __init__(
        self,
        scene: Scene,
        worker: Worker,
        *,
        out: Path = Path("out"),
        on_change: Callable[[], None] = lambda: None,
        on_frame: Callable[[str, PieceFrame], None] = lambda name, frame: None,
    ) -> None:
        """
        Args:
            scene: to begin with.
            worker: runs what takes long.
            out: where the folders of saved runs are made.
            on_change: called when anything but a frame is new.
            on_frame: called with a piece's name and how it lies, while it is being relaxed.
        """
        self._worker, self._out = worker, out
        self._on_change, self._on_frame = on_change, on_frame
        self._lock = threading.RLock()
        self._steps, self._at = [Step(what="scene", scene=scene)], 0
        self.error = self.note = self.activity = ""
        self.preview: Preview | None = None
        self._fabric: tuple[Scene, str] | None = None
        self.saved: Saved | None = None

    @property
    def step(self) -> Step:
        """The present one."""
        return self._steps[self._at]

    @property
    def scene(self) -> Scene:
        """The scene as it is now."""
        return self.step.scene

    @property
    def solution(self) -> Solution | None:
        """What the present scene gave, or the latest before it that gave anything."""
        with self._lock:
            steps = reversed(self._steps[: self._at + 1])
            return next((found for step in steps if (found := step.solution or step.stand_in) is not None), None)

    @property
    def shown(self) -> Solution | None:
        """What is to be seen: the preview, if there is one."""
        return self.solution if self.preview is None else self.preview.step.solution

    def begin(self) -> None:
        """Solve the scene as it is."""
        self._solve()

    def change(self, what: str, *, again: bool = False, **tables: Any) -> None:
        """Replace tables of the scene, as `fabric="denim"`; None leaves one out. A second change of `what` replaces one not yet solved.

        Args:
            what: was changed, in a word.
            again: the change goes on with the last one, if that was of `what` too: both are undone together.
            tables: of the scene.
        """
        with self._lock:
            self._clear()
            try:
                scene = scene_with(self.scene, **tables)
            except InputError as error:
                self.tell(str(error))
                return
            if scene.settings == self.scene.settings:
                self._on_change()
                return
            del self._steps[self._at + 1 :]
            if self._at and self.step.what == what and (again or self.step.solution is None):
                self._steps[self._at] = Step(what=what, scene=scene, stand_in=self.step.solution or self.step.stand_in)
            else:
                self._steps.append(Step(what=what, scene=scene))
                self._at += 1
        self._solve()

    def change_form(self, form: str) -> None:
        """Take another shipped form; cuts, seams and whatever names pieces of the one before are left out."""
        settings = self.scene.settings
        left_out = [key for key in _OF_ONE_FORM if getattr(settings, key)]
        left_out += [f"pattern.{key}" for key in _OF_ONE_PATTERN if getattr(settings.pattern, key)]
        pattern = {key: value for key, value in settings.pattern.given().items() if key not in _OF_ONE_PATTERN}
        tables: dict[str, Any] = {"form": form, **dict.fromkeys(_OF_ONE_FORM), "pattern": pattern or None}
        self.change("form", **tables)
        if left_out and not self.error:
            self.note = f"left out, since they belong to the form before: {', '.join(left_out)}"
            self._on_change()

    def change_body(self, size: str | None = None, **lengths: float) -> None:
        """Take another size, or replace measurements [m] of the present one; another size takes all of its own."""
        table = self.scene.settings.mannequin
        if table is None:
            self.tell("the scene has no body; its [surface] is as large as its mesh")
            return
        given = table.given()
        if size is not None:
            given = {key: value for key, value in given.items() if key not in ("measurements", "scan", "table")}
            self.change("size", mannequin={**given, "size": size})
        else:
            self.change("measures", mannequin={**given, "measurements": {**given.get("measurements", {}), **lengths}})

    def try_cut(self, cut: Mapping[str, Any]) -> None:
        """Solve the scene with one cut more, as a preview."""
        with self._lock:
            self._clear()
            before = self.step.solution
            if before is None:
                self.tell("the piece is not at rest yet; cut it when it is")
                return
            try:
                step = Step(what=f"cut {cut['name']}", scene=with_cut(self.scene, cut))
            except InputError as error:
                self.tell(str(error))
                return

        def job(ticket: Ticket) -> None:
            step.solution = solve(step.scene, before, callback=Watch(ticket, self._on_frame))
            after, old = step.solution.openings, before.openings
            wider = [after[name] for name in after if name not in old]
            released = before.strain_energy - step.solution.strain_energy
            self.preview = Preview(
                cut=cut,
                step=step,
                released=released,
                share=released / before.strain_energy if before.strain_energy else 0.0,
                opening=max(wider, default=None),
                overlap=sum(piece.overlap for piece in step.solution.pieces.values()),
            )

        self._run("trying the cut", job)

    def apply(self) -> None:
        """Make the cut that is previewed."""
        with self._lock:
            preview = self.preview
            self._clear()
            if preview is None:
                self.tell("there is no cut to apply; click a line first")
                return
            del self._steps[self._at + 1 :]
            self._steps.append(preview.step)
            self._at += 1
        self._on_change()

    def drop_preview(self) -> None:
        """Forget the cut that is previewed."""
        self._clear()
        self._on_change()

    def undo(self) -> None:
        """Go back by one change; a cut that is only tried is forgotten first."""
        if self.preview is not None:
            self.drop_preview()
        else:
            self._go(-1)

    def redo(self) -> None:
        """Make the change again that was undone last."""
        self._go(1)

    def stop(self) -> None:
        """End what is being done; a pattern that is being relaxed is kept as far as it has come. Asked again, give up."""
        self._worker.stop()

    def watch(self, piece: str) -> None:
        """Relax a piece once more in the paper's plain steps, only to be looked at."""
        self._clear()
        solution = self.solution
        if solution is None:
            return
        flat, settings = solution.pieces[piece], self.scene.settings

        def job(ticket: Ticket) -> None:
            watch = Watch(ticket, self._on_frame)
            states = relaxation(
                flat.surface,
                fabric=flat.fabric,
                datum=flat.datum,
                grain_angle=flat.grain_angle,
                model=settings.model,
                wear=flat.wear,
                relax=flat.options,
                energy_every=20,
            )
            for state in states:
                if not ticket.go_on():
                    return
                if watch.is_time(piece) or state.converged:
                    self._on_frame(piece, PieceFrame.of_step(state))

        self._run(f"{piece} in plain steps", job)

    def ask_drape(self) -> None:
        """Sew the pieces and let them come to rest on the body, unless that has been done."""
        with self._lock:
            self._clear()
            step = self.step
            if step.solution is None or step.drape is not None:
                self._on_change()
                return
            solution = step.solution

        def job(ticket: Ticket) -> None:
            def go_on(steps: int, residual: float) -> None:
                self.activity = f"draping, step {steps}"
                self._on_change()
                if not ticket.go_on():
                    raise Superseded

            step.drape = drape_scene(step.scene, solution.garment, callback=go_on)
            if not step.drape.converged:
                self.note = (
                    'the drape is not at rest; cloth that slips off is held by the scene, as [drape] hold = ["waist"]'
                )

        self._run("draping", job)

    def save(self, name: str, *, replace: bool = False) -> None:
        """Write the scene under a name and run it from scratch; the files of that run are what is saved."""
        self._clear()
        scene = self.scene

        def job(ticket: Ticket) -> None:
            def go_on(*_: object) -> None:
                if ticket.stopped.is_set():
                    raise Superseded

            path = write_scene(scene, name, replace=replace)
            try:
                self.saved = run_saved(path, self._out, on_progress=go_on)
            except Superseded:
                self.note = f"{path} is written; its run was stopped"
                raise
            self.note = f"saved: {path}, and its run in {self.saved.folder}"

        self._run("saving", job, to_its_end=True)

    def saved_file(self, name: str) -> Path | None:
        """Return a file of the run that was saved last, by its name; None if that run has not written it."""
        saved = self.saved
        return saved.folder / name if saved is not None and name in saved.files else None

    def tell(self, error: str) -> None:
        """Show a mistake, in one line."""
        self.error = one_line(error)
        self._on_change()

    def attempt(self, act: Callable[[], None]) -> None:
        """Do what is asked for; a mistake of the user becomes one line, and so does a fault of the program."""
        try:
            act()
        except Superseded:
            raise
        except InputError as error:
            self.tell(str(error))
        except OSError as error:
            self.tell(f"cannot read or write {error.filename or 'a file'}: {system_reason(error)}")
        except Exception as error:
            # The page must not fall silent over a fault of the program.
            traceback.print_exc(file=sys.stderr)
            self.tell(f"fault of the program: {type(error).__name__}: {error}; see the console")

    def is_taken(self, name: str) -> bool:
        """Return whether there is a scene of a name already."""
        try:
            return scene_file(self.scene, name).exists()
        except InputError:
            return False

    def fabric_name(self) -> str:
        """Return the name of the scene's fabric in the library, where the scene may have an alias."""
        scene = self.scene
        if self._fabric is None or self._fabric[0] is not scene:
            self._fabric = scene, scene_fabric(scene).name
        return self._fabric[1]

    def _go(self, by: int) -> None:
        with self._lock:
            self._clear()
            if not 0 <= self._at + by < len(self._steps):
                self.tell("there is nothing to undo" if by < 0 else "there is nothing to do again")
                return
            self._at += by
        self._solve()

    def _solve(self) -> None:
        """Solve the present step, unless that has been done."""
        with self._lock:
            step, before = self.step, self.solution
        if step.solution is not None:
            self._run("", lambda ticket: None)
            return

        def job(ticket: Ticket) -> None:
            try:
                step.solution = solve(step.scene, before, callback=Watch(ticket, self._on_frame))
            except InputError:
                # A step that cannot be solved goes; the first one stays.
                with self._lock:
                    if step in self._steps[1:]:
                        at = self._steps.index(step)
                        del self._steps[at]
                        self._at -= at <= self._at
                        if self._at and self.step.solution is None:
                            self._solve()
                raise

        self._run("solving", job)

    def _run(self, activity: str, job: Callable[[Ticket], None], *, to_its_end: bool = False) -> None:
        """Run a job in the worker; a mistake of the user becomes one line."""

        def whole(ticket: Ticket) -> None:
            def listen(words: str) -> None:
                self.activity = words
                self._on_change()
                ticket.go_on()

            def listened() -> None:
                with activity_listener(listen):
                    if activity:
                        listen(activity)
                    job(ticket)

            try:
                self.attempt(listened)
            finally:
                self.activity = ""
                self._on_change()

        self._worker.submit(whole, to_its_end=to_its_end)

    def _clear(self) -> None:
        self.error = self.note = ""
        self.preview = None
