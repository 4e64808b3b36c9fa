"""The panel of the page: what can be chosen and done, and what is known of the pattern."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from html import escape
from typing import Any, get_args
from urllib.parse import quote

from warpflat.app.review.figures import relaxation_words
from warpflat.app.scene.load import scene_library
from warpflat.app.scene.schema import SceneTable
from warpflat.app.studio.maps import MAPS, MapScale
from warpflat.app.studio.session import Preview, Session
from warpflat.core import InputError, energy_words
from warpflat.flat import load_library
from warpflat.garment import EASE_PRESETS, form_names, size_names, size_tables

__all__ = ["Panel", "preview_words"]

_OWN = "(the scene's own)"
_SHAPES = get_args(SceneTable.model_fields["shape"].annotation)
#: Measurements that are asked for, with their names on the page.
_MEASURES = {"bust": "bust [cm]", "waist": "waist [cm]", "hip": "hip [cm]", "stature": "stature [cm]"}
_NO_LINE = "(click a line)"
_LEAST_OVERLAP = 1e-6  # [m2], below which it is not reported


class Panel:
    """Builds the panel of a page, and keeps it as the session is."""

    def __init__(self, page: Any, *, name: str) -> None:
        """
        Args:
            page: the :class:`warpflat.app.studio.page.Page` that has it.
            name: under which the scene is to be saved.
        """
        session: Session = page.session
        self._gui, self._session = page.server.gui, session
        self._lines: dict[str, tuple[str, str]] = {}
        self._head = self._gui.add_html("")
        sides = {"Front": 0.0, "Left": 90.0, "Back": 180.0, "Right": 270.0}
        buttons = self._gui.add_button_group("look from", tuple(sides))
        buttons.on_click(lambda event: page.stage.show_all(event.client, sides[event.target.value]))
        acts = {"Undo": page.undo, "Redo": page.redo, "Stop": session.stop, "Watch": self._watch}
        _buttons(self._gui.add_button_group("do", tuple(acts)), acts)
        with self._gui.add_folder("Map"):
            self._kind = self._gui.add_dropdown("colours", tuple(MAPS.values()))
            self._legend = self._gui.add_html("")
        keys = {title: key for key, title in MAPS.items()}
        _chosen(self._kind, lambda value: page.choose_map(keys[value]))
        with self._gui.add_folder("Cut"):
            self._mode = self._gui.add_dropdown("pick", ("a line", "two points"))
            self._line = self._gui.add_dropdown("line", (_NO_LINE,))
            self._part = self._gui.add_multi_slider(
                "part [%]", min=0, max=100, step=1, initial_value=(0, 100), min_range=2
            )
            self._made = self._gui.add_button_group("cut", ("Apply", "Leave it"))
        _chosen(self._mode, lambda value: page.choose_mode(value == "two points"))
        _chosen(self._line, lambda value: page.choose_line(self._lines.get(value)))
        _chosen(self._part, lambda value: page.try_part((0.01 * value[0], 0.01 * value[1])))
        _buttons(self._made, {"Apply": session.apply, "Leave it": lambda: page.choose_line(None)})
        scene = session.scene
        with self._gui.add_folder("Cloth"):
            try:
                names = sorted(scene_library(scene))
            except InputError:
                names = sorted(load_library())
            self._fabric = self._gui.add_dropdown("cloth", (_OWN, *names), initial_value=_OWN)
            self._grain = self._gui.add_slider("grain [°]", min=-90.0, max=90.0, step=1.0, initial_value=0.0)
        _chosen(self._fabric, lambda value: session.change("cloth", fabric=value))
        _chosen(self._grain, lambda value: session.change("grain", grain_angle=float(value)))
        if scene.settings.mannequin is not None:
            with self._gui.add_folder("Body and form"):
                self._shown_lengths: Mapping[str, float] = {}
                self._size = self._gui.add_dropdown("size", (_OWN, *size_names()), initial_value=_OWN)
                with self._gui.add_folder("Measures", expand_by_default=False):
                    # As `[mannequin]` bounds them, in the unit that is shown.
                    bounds = size_tables()["valid"]["range"]
                    self._measures = {
                        key: self._gui.add_number(
                            words, low, min=low, max=high, step=0.5, hint=f"{low:g} to {high:g} cm"
                        )
                        for key, words in _MEASURES.items()
                        for low, high in [map(float, bounds[key])]
                    }
                    take = self._gui.add_button("Take these measures")
                self._form = self._gui.add_dropdown("form", (_OWN, *form_names()), initial_value=_OWN)
                self._shape = self._gui.add_dropdown("shape", _SHAPES)
                self._ease = self._gui.add_dropdown("ease", (_OWN, *EASE_PRESETS), initial_value=_OWN)
            _chosen(self._size, lambda value: session.change_body(value))
            _chosen(self._form, session.change_form)
            _chosen(self._shape, lambda value: session.change("shape", shape=value))
            _chosen(self._ease, lambda value: session.change("ease", ease=value))

            @take.on_click
            def _(_: Any) -> None:
                known = self._known_lengths()
                given = {key: round(0.01 * box.value, 4) for key, box in self._measures.items()}
                # What stays as it was goes on following the size.
                changed = {key: value for key, value in given.items() if abs(value - known.get(key, 0.0)) > 5e-4}
                session.change_body(**changed)

        with self._gui.add_folder("Save"):
            self._name = self._gui.add_text("name", name)
            save = self._gui.add_button("Save and run", icon="device-floppy")

        @save.on_click
        def _(_: Any) -> None:
            if session.is_taken(self._name.value):
                self._ask_to_replace(self._name.value)
            else:
                session.save(self._name.value)

    def update(self, *, lines: Sequence[tuple[str, str]], picked: tuple[str, str] | None) -> None:
        """Show what the session has come to.

        Args:
            lines: that can be cut, each with its piece.
            picked: one of them.
        """
        session = self._session
        self._head.content = _head(session)
        self._made.visible = session.preview is not None
        self._fabric.value = _one_of(session.fabric_name(), self._fabric.options)
        settings = session.scene.settings
        self._grain.value = float(settings.grain_angle)
        if settings.mannequin is not None:
            self._size.value = _one_of(settings.mannequin.size, self._size.options)
            self._form.value = _one_of(settings.form, self._form.options)
            self._shape.value = settings.shape
            self._ease.value = _one_of(settings.ease, self._ease.options)
            lengths = self._known_lengths()
            # What somebody is typing stays until there is another body.
            if lengths != self._shown_lengths:
                self._shown_lengths = lengths
                for key in self._measures.keys() & lengths.keys():
                    self._measures[key].value = round(100.0 * lengths[key], 1)
        self._lines = {f"{piece}: {line}": (piece, line) for piece, line in lines}
        options = (_NO_LINE, *self._lines)
        if self._line.options != options:
            self._line.options = options
        wanted = _NO_LINE if picked is None else f"{picked[0]}: {picked[1]}"
        if self._line.value != wanted or picked is None:
            self._part.value = (0, 100)
        self._line.value = wanted if wanted in options else _NO_LINE

    def show_scale(self, scale: MapScale | None) -> None:
        """Show the scale of the map; None while there is none."""
        self._legend.content = "" if scale is None else _legend(scale)

    def set_map(self, kind: str) -> None:
        """Show which map is chosen."""
        self._kind.value = MAPS[kind]

    def _known_lengths(self) -> Mapping[str, float]:
        solution = self._session.solution
        return {} if solution is None or solution.plan is None else solution.plan.mannequin.lengths

    def _watch(self) -> None:
        """Show how the piece of the picked line, or the first one, relaxes in plain steps."""
        solution = self._session.solution
        if solution is not None:
            picked = self._lines.get(self._line.value)
            self._session.watch(picked[0] if picked else next(iter(solution.pieces)))

    def _ask_to_replace(self, name: str) -> None:
        modal = self._gui.add_modal("Replace the file?")
        with modal:
            self._gui.add_markdown(f"There is a scene **{escape(name)}** already. Replacing it loses its comments.")
            replace = self._gui.add_button("Replace it", color="red")
            keep = self._gui.add_button("Keep it")

        @replace.on_click
        def _(_: Any) -> None:
            modal.close()
            self._session.save(name, replace=True)

        keep.on_click(lambda _: modal.close())


def _buttons(group: Any, acts: Mapping[str, Callable[[], None]]) -> None:
    """Let each button of a group do its act."""
    group.on_click(lambda event: acts[event.target.value]())


def _chosen(handle: Any, act: Callable[[Any], None]) -> None:
    """Call `act` with the value when somebody has chosen it on a page; a value that the program sets calls nothing."""

    @handle.on_update
    async def _(event: Any) -> None:
        # Taken at once: a drawing that is under way sets all parts to what the scene still has.
        value = event.target.value
        if event.client_id is not None and value not in (_OWN,):
            handle._impl.gui_api._thread_executor.submit(act, value)


def _one_of(value: Any, options: Sequence[str]) -> str:
    return value if isinstance(value, str) and value in options else _OWN


def _head(session: Session) -> str:
    """Return what is known of the pattern, and the last mistake."""
    solution, scene = session.shown, session.scene
    words = [f"<b>{escape(scene.name)}</b>"]
    if scene.settings.mannequin is not None:
        words.append(escape(scene.settings.mannequin.size_name))
    rows = ""
    if solution is not None:
        state = "at rest" if solution.at_rest else "<b style='color:#b00020'>not at rest</b>"
        words += [f"strain energy <b>{energy_words(solution.strain_energy)}</b>", state]
        if len(solution.pieces) > 1:
            cells = "".join(
                f"<tr><td>{escape(name)}</td><td style='text-align:right'>{energy_words(piece.stages[-1].strain_energy_j)}</td></tr>"
                for name, piece in solution.pieces.items()
            )
            rows = f"<table style='width:100%;line-height:1.15'>{cells}</table>"
    lines = [" · ".join(words), rows]
    if solution is not None:
        if (verdict := solution.verdict) is not None:
            failing = [finding.words for finding in verdict.findings if finding.fails]
            colour = "" if verdict.fits else " style='color:#b00020'"
            lines.append(": ".join([f"<b{colour}>{escape(verdict.words)}</b>", *map(escape, failing[:1])]))
        lines.append(escape("; ".join(solution.notes)))
        lines.append(
            relaxation_words([stage.as_dict() for stage in piece.stages] for piece in solution.pieces.values())
        )
    if session.activity:
        lines.append(f"<span style='color:#0a58ca'>{escape(session.activity)} …</span>")
    if session.preview is not None:
        lines.append(
            f"<span id='studio-preview' style='color:#0a58ca'>tried, not made yet: {preview_words(session.preview)}</span>"
        )
    if session.error:
        lines.append(f"<span role='alert' style='color:#b00020'>{escape(session.error)}</span>")
    if session.note:
        lines.append(f"<span style='color:#146c2e'>{escape(session.note)}</span>")
    if session.saved is not None and session.note:
        state = "done" if session.saved.is_done else "NOT done"
        lines.append(f"run from scratch: strain energy <b>{energy_words(session.saved.strain_energy)}</b>, {state}")
    if session.saved is not None:
        # What was saved last is there to print, to review and to download.
        files, opened = session.saved.files, [("pattern.pdf", "print"), ("review.html", "review")]
        links = [(file, title, "target='_blank'") for file, title in opened if file in files]
        links += [(file, file, "download") for file in files]
        saved = [f"<a href='saved/{quote(file)}' {how}>{escape(title)}</a>" for file, title, how in links]
        lines.append(f"<span id='studio-links'>{escape(session.saved.path.stem)}: {' · '.join(saved)}</span>")
    text = "".join(f"<div style='margin-bottom:0.2em'>{line}</div>" for line in lines if line)
    return f"<div id='studio-head' style='padding:0.3em 0.9em;font-size:0.9em;overflow-wrap:anywhere'>{text}</div>"


def preview_words(preview: Preview) -> str:
    """Return what a cut that is tried would do."""
    verb = "releases" if preview.released >= 0.0 else "costs"
    words = f"<b>{escape(str(preview.cut['name']))}</b> {verb} <b>{energy_words(abs(preview.released))}</b>"
    words += f" ({-100.0 * preview.share:+.1f} %)".replace("-", "−")
    if preview.overlap > _LEAST_OVERLAP:
        return f"{words}, but cloth lies over itself: <b>{1e4 * preview.overlap:.1f} cm²</b>"
    return words if preview.opening is None else f"{words}, opens <b>{1e3 * preview.opening:.1f} mm</b>"


def _legend(scale: MapScale) -> str:
    """Return the scale of a map."""
    if scale.is_blank:
        return "<div style='padding:0.3em 0.9em'>nothing to be seen: the cloth lies without strain</div>"
    ends = [scale.low, 0.5 * (scale.low + scale.high), scale.high]
    ticks = "".join(f"<span>{value:.3g}</span>" for value in ends)
    return (
        f"<div style='padding:0.1em 0.9em;font-size:0.85em'>{MAPS[scale.kind]}"
        f"<div style='height:0.9em;border:1px solid #999;background:linear-gradient(90deg,{scale.css()})'></div>"
        f"<div style='display:flex;justify-content:space-between'>{ticks}</div></div>"
    )
