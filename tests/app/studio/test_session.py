"""The studio's model: edits, cuts that are tried, the way back, and saving. No page and no thread is needed for it."""

from __future__ import annotations

import threading
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from warpflat.app.cli.studio import scene_of_mesh
from warpflat.app.scene.as_toml import document_as_toml
from warpflat.app.scene.form import scene_form
from warpflat.app.scene.load import load_scene, make_scene
from warpflat.app.scene.plan import plan_mesh
from warpflat.app.studio.cut_tables import cut_along, cut_between, cuttable_lines
from warpflat.app.studio.frame import PieceFrame, Watch
from warpflat.app.studio.maps import face_values, piece_scale, vertex_values
from warpflat.app.studio.panel import _head, preview_words
from warpflat.app.studio.pick import Hit, nearest_line, pick_flat, pick_on_rays
from warpflat.app.studio.save import free_name
from warpflat.app.studio.session import Session
from warpflat.app.studio.solve import solve
from warpflat.app.studio.worker import Job, Superseded, Ticket, Worker
from warpflat.core.errors import InputError
from warpflat.core.toml_file import tomllib

SCENES = sorted((Path(__file__).parents[3] / "scenes").glob("*.toml"))


class AtOnce:
    """Runs each job where it is asked for, or none."""

    def __init__(self) -> None:
        self.ticket, self.idle = Ticket(), False

    def submit(self, job: Job, *, to_its_end: bool = False) -> None:
        self.ticket = Ticket()
        if not self.idle:
            with suppress(Superseded):
                job(self.ticket)

    def stop(self) -> None:
        self.ticket.stopped.set()


def bodice(folder: Path, **more: Any) -> Session:
    data = {
        "surface": {"shape": "bodice", "resolution": 17},
        "datum": "centre",
        "output": {"frames": 0, "picture": False},
        "pattern": {"formats": []},
    }
    scene = make_scene({**data, **more}, name="trial", folder=folder, where="trial")
    session = Session(scene, AtOnce(), out=folder / "out")
    session.begin()
    return session


def from_scratch(session: Session) -> float:
    result = next(iter(plan_mesh(session.scene).flatten().pieces.values()))
    return result.stages[-1].strain_energy_j


def test_an_edit_is_solved_and_can_be_undone(tmp_path: Path) -> None:
    session = bodice(tmp_path)
    first = session.solution
    assert first is not None
    session.change("cloth", fabric="denim")
    session.change("grain", grain_angle=30.0)
    assert session.solution is not None
    assert session.solution.strain_energy == pytest.approx(from_scratch(session), rel=1e-4)
    assert abs(session.solution.strain_energy - first.strain_energy) > 0.01 * first.strain_energy
    session.undo()
    assert session.scene.settings.grain_angle == 0.0
    session.undo()
    assert session.solution is first
    session.undo()
    assert session.error == "there is nothing to undo"
    session.redo()
    assert session.scene.settings.fabric == "denim"
    session.change("cloth", fabric="silk")
    session.redo()
    assert session.error == "there is nothing to do again"


def test_a_mistake_is_one_line_and_changes_nothing(tmp_path: Path) -> None:
    session = bodice(tmp_path)
    before = session.scene, session.solution
    session.change("cloth", fabric="denimm")
    assert "did you mean 'denim'?" in session.error
    session.change("grain", grain_angle=1e6)
    assert "grain_angle" in session.error
    session.change_body("EU 40")
    assert "no body" in session.error
    session.apply()
    assert "no cut to apply" in session.error
    assert "\n" not in session.error
    assert (session.scene, session.solution) == before
    assert session.step.what == "scene"


def test_a_cut_is_tried_then_made(tmp_path: Path) -> None:
    session = bodice(tmp_path)
    whole = session.solution
    assert whole is not None
    assert set(cuttable_lines(whole, "trial")) == {"centre", "bust"}
    session.try_cut(cut_along(whole, "trial", "bust", (0.0, 0.4)))
    preview = session.preview
    assert preview is not None
    assert session.solution is whole
    assert session.step.what == "scene"
    assert preview.released > 0.0
    assert preview.opening is not None
    assert preview.opening > 5e-3
    assert preview.overlap == 0.0
    assert f"opens <b>{1e3 * preview.opening:.1f} mm</b>" in preview_words(preview)
    assert "lies over itself: <b>3.2 cm²</b>" in preview_words(replace(preview, overlap=3.2e-4))
    session.apply()
    assert session.preview is None
    assert session.solution is preview.step.solution
    # Each of the two relaxations ends when a thousandth of its energy may be left.
    assert whole.strain_energy - from_scratch(session) == pytest.approx(
        preview.released, abs=3e-3 * whole.strain_energy
    )
    session.undo()
    assert session.solution is whole


def test_two_points_make_a_cut_that_begins_at_the_border(tmp_path: Path) -> None:
    session = bodice(tmp_path)
    whole = session.solution
    assert whole is not None
    vertices = whole.pieces["trial"].surface.vertices
    side = vertices[np.argmin(vertices[:, 0])]
    inside = vertices[np.argmin(np.linalg.norm(vertices - [-0.05, 0.25, 0.2], axis=1))]
    near_side = Hit(piece="trial", point=tuple(np.add(side, [0.01, 0.0, 0.0])))
    table = cut_between(whole, near_side, Hit(piece="trial", point=tuple(inside)))
    assert min(np.linalg.norm(vertices[vertices[:, 0] < vertices[:, 0].min() + 1e-6] - table["from"], axis=1)) < 1e-5
    session.try_cut(table)
    assert session.preview is not None
    assert session.preview.opening is not None
    assert session.preview.opening > 1e-3
    with pytest.raises(InputError, match="one place"):
        cut_between(whole, near_side, near_side)
    with pytest.raises(InputError, match="two pieces"):
        cut_between(whole, near_side, Hit(piece="other", point=(0.0, 0.0, 0.0)))


def test_a_form_takes_a_body_a_form_and_cuts_along_its_lines(tmp_path: Path) -> None:
    data = {"form": "skirt", "mannequin": {"size": "EU 38", "resolution_mm": 40.0}, "ease": "close"}
    runner = AtOnce()
    session = Session(make_scene(data, name="skirt", folder=tmp_path, where="skirt"), runner)
    session.begin()
    whole = session.solution
    assert whole is not None
    table = cut_along(whole, "front", "princess front right")
    assert table["line"] == "princess front left"
    session.try_cut(table)
    preview = session.preview
    assert preview is not None
    assert preview.step.solution is not None
    assert preview.opening is not None
    assert preview.opening > 1e-3
    assert preview.released == whole.strain_energy - preview.step.solution.strain_energy
    assert set(preview.step.solution.openings) == {"front.waist dart left", "front.waist dart right"}
    assert preview.step.solution.plan is not None
    assert whole.plan is not None
    assert preview.step.solution.plan.mannequin is whole.plan.mannequin
    # The piece without a cut is not built again, and the outcome is the one from scratch.
    assert preview.step.solution.pieces["back"].surface is whole.pieces["back"].surface
    assert preview.step.solution.pieces["front"].surface is not whole.pieces["front"].surface
    scratch = solve(preview.step.scene)
    for name, piece in scratch.pieces.items():
        np.testing.assert_array_equal(piece.surface.vertices, preview.step.solution.pieces[name].surface.vertices)
        np.testing.assert_allclose(piece.positions, preview.step.solution.pieces[name].positions, atol=1e-5)
    session.apply()
    row = cuttable_lines(whole, "back")["princess back left"]
    points = whole.pieces["back"].surface.vertices[row]
    upper = max((0, -1), key=lambda end: points[end][1])
    ends = [Hit(piece="back", point=tuple(points[at])) for at in (upper, len(row) // 2)]
    assert cut_between(whole, ends[0], ends[1])["line"] == "princess back left"
    with pytest.raises(InputError, match="must begin at an edge"):
        cut_along(whole, "back", "princess back left", (0.3, 0.6))
    runner.idle = True
    session.change_body(hip=1.02)
    assert session.scene.settings.mannequin is not None
    assert session.scene.settings.mannequin.measurements == {"hip": 1.02}
    session.change_body("EU 40")
    assert session.scene.settings.mannequin.measurements is None
    session.change_form("bodice")
    assert session.note == "left out, since they belong to the form before: cuts"
    assert session.scene.settings.cuts == []


def test_another_form_has_no_pockets_and_no_pieces_of_the_one_before(tmp_path: Path) -> None:
    data = {"form": "basic_block", "mannequin": {"size": "EU 38", "resolution_mm": 40}}
    pockets = [{"kind": "patch", "piece": "front_skirt"}]
    pattern = {"names": {"front_bodice": "Vorderteil"}, "allowances_mm": {"front_bodice.neck": 7}, "paper": "A0"}
    scene = make_scene({**data, "pockets": pockets, "pattern": pattern}, name="trial", folder=tmp_path, where="trial")
    worker = AtOnce()
    worker.idle = True
    session = Session(scene, worker)
    session.change_form("tshirt")
    assert session.note.endswith(": pockets, pattern.names, pattern.allowances_mm")
    assert session.scene.settings.pattern.given() == {"paper": "A0"}
    assert session.scene.settings.pockets == []


def test_a_form_follows_its_cloth_and_what_was_left_out_is_shown(tmp_path: Path) -> None:
    data = {"form": "bodice", "shape": "darts", "mannequin": {"size": "EU 32", "resolution_mm": 40}, "fabric": "woven"}
    session = Session(make_scene(data, name="trial", folder=tmp_path, where="trial"), AtOnce())
    session.begin()
    assert "back: the waist dart is left out" in _head(session)
    before = session.solution
    assert before is not None
    session.change("cloth", fabric="jersey", pulled_on=True)
    assert session.solution is not None
    assert session.solution.plan.form.recipe == scene_form(session.solution.plan.scene)[1].recipe  # type: ignore[union-attr]
    assert session.solution.plan.form is not before.plan.form  # type: ignore[union-attr]


def test_saving_writes_a_new_scene_and_runs_it_from_scratch(tmp_path: Path) -> None:
    session = bodice(tmp_path)
    session.change("cloth", fabric="denim")
    session.try_cut(cut_along(session.solution, "trial", "bust"))  # type: ignore[arg-type]
    session.apply()
    name = free_name(session.scene)
    session.save(name)
    assert session.error == ""
    saved = session.saved
    assert saved is not None
    assert saved.path == tmp_path / "trial.toml"
    assert load_scene(saved.path).settings == session.scene.settings
    assert (saved.folder / "metrics.json").is_file()
    assert session.solution is not None
    assert saved.strain_energy == pytest.approx(session.solution.strain_energy, rel=5e-3)
    assert ", done<" in _head(session)
    session.saved = replace(saved, metrics={**saved.metrics, "left_out": ["the hem was left out"]})
    assert ", NOT done<" in _head(session)
    text = saved.path.read_text()
    session.change("cloth", fabric="silk")
    session.save(name)
    assert "choose to replace it" in session.error
    assert saved.path.read_text() == text
    session.save(name, replace=True)
    assert 'fabric = "silk"' in saved.path.read_text()
    session.save("../elsewhere")
    assert "name:" in session.error
    assert free_name(session.scene) == "trial_2"


def test_a_mesh_is_opened_as_a_scene_that_can_be_saved(tmp_path: Path) -> None:
    flat = "".join(f"v {10 * x} {10 * y} {x * y / 4}\n" for y in range(5) for x in range(5))
    quads = "".join(f"f {a} {a + 1} {a + 6} {a + 5}\n" for y in range(4) for a in range(5 * y + 1, 5 * y + 5))
    (tmp_path / "my front.obj").write_text(flat + quads)
    scene = scene_of_mesh(tmp_path / "my front.obj", units="cm", fabric="denim")
    session = Session(scene, AtOnce(), out=tmp_path / "out")
    session.begin()
    assert session.error == ""
    assert session.solution is not None
    session.change("cloth", fabric="silk")
    session.save(free_name(session.scene))
    assert session.error == ""
    assert session.saved is not None
    again = load_scene(session.saved.path)
    assert session.saved.path.parent == tmp_path
    assert (again.settings.fabric, again.settings.surface.units) == ("silk", "cm")
    with pytest.raises(InputError, match="units"):
        scene_of_mesh(tmp_path / "my front.obj")
    with pytest.raises(InputError, match=r"does not exist|no such file"):
        scene_of_mesh(tmp_path / "none.obj", units="m")


def test_a_scene_file_of_any_name_can_be_opened(tmp_path: Path) -> None:
    file = tmp_path / "Ärmel (1).toml"
    file.write_text('surface = { shape = "dome" }\n')
    assert free_name(load_scene(file)) == "Armel _1"


def test_what_is_draped_is_what_a_run_drapes(tmp_path: Path) -> None:
    """The sewn garment, on its elastics: a piece whose sides are sewn, and a skirt with a casing."""
    session = bodice(tmp_path, seams=[{"name": "sides", "sides": ["left", "right"]}], drape={"max_steps": 1})
    session.ask_drape()
    drape = session.step.drape
    assert drape is not None, session.error
    assert len(drape.cloth.designed) < len(drape.cloth.flat)
    data = {"form": "skirt", "mannequin": {"size": "EU 38", "resolution_mm": 40.0}, "drape": {"max_steps": 1}}
    casing = [{"kind": "casing", "edge": "waist", "elastic": 0.95}]
    scene = make_scene({**data, "finishing": casing}, name="skirt", folder=tmp_path, where="skirt")
    session = Session(scene, AtOnce())
    session.begin()
    session.ask_drape()
    assert session.step.drape is not None, session.error
    assert session.step.drape.threaded


@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)
def test_a_scene_survives_writing(path: Path) -> None:
    data = tomllib.loads(path.read_text(encoding="utf-8"))
    assert tomllib.loads(document_as_toml(data)) == data


def test_the_newest_request_wins_and_saving_is_not_interrupted() -> None:
    worker, done = Worker(), list[str]()
    running, release = threading.Event(), threading.Event()

    def until_told(name: str) -> Job:
        def job(ticket: Ticket) -> None:
            running.set()
            while ticket.go_on() and not release.is_set():
                release.wait(0.002)
            done.append(name)

        return job

    worker.submit(until_told("first"))
    assert running.wait(5.0)
    for name in ("second", "third"):
        worker.submit(until_told(name))
    release.set()
    assert worker.wait(5.0)
    assert done == ["third"]
    release.clear()
    running.clear()
    worker.submit(until_told("save"), to_its_end=True)
    assert running.wait(5.0)
    worker.submit(until_told("after"))
    worker.stop()
    release.set()
    assert worker.wait(5.0)
    assert done == ["third", "save", "after"]
    worker.close()
    assert not worker.is_busy


def test_stop_keeps_what_has_been_reached_and_frames_come_ten_a_second(tmp_path: Path) -> None:
    frames = list[PieceFrame]()
    runner = AtOnce()
    scene = make_scene(
        {"surface": {"shape": "bodice", "resolution": 33}, "relax": {"solver": "paper"}},
        name="trial", folder=tmp_path, where="trial",
    )  # fmt: skip

    def stop_soon(name: str, frame: PieceFrame) -> None:
        frames.append(frame)
        runner.stop()

    session = Session(scene, runner, on_frame=stop_soon)
    session.begin()
    assert session.solution is not None
    assert not session.solution.at_rest
    assert len(frames) == 1
    whole = session.solution
    frames.clear()
    session.watch("trial")
    assert frames[0].stage == "plain step 0"
    assert session.solution is whole
    watch = Watch(Ticket(), lambda name, frame: None)
    assert [watch.is_time("a"), watch.is_time("a"), watch.is_time("b")] == [True, False, True]


def test_plain_steps_are_of_cloth_worn_as_the_scene_says(tmp_path: Path) -> None:
    """Cloth that is worn 10 % longer than flat comes to rest a tenth smaller, step by step as in a run."""
    session = bodice(tmp_path, wear={"stretch_warp": 0.1, "stretch_weft": 0.1}, fabric="jersey")
    frames = list[PieceFrame]()
    session._on_frame = lambda name, frame: frames.append(frame)
    session.watch("trial")
    assert session.solution is not None
    piece = session.solution.pieces["trial"]
    np.testing.assert_allclose(np.ptp(frames[-1].positions, axis=0), np.ptp(piece.positions, axis=0), rtol=5e-3)


def test_clicks_find_pieces_and_lines() -> None:
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    faces = np.array([[0, 1, 2, 3]], dtype=np.int32)
    pieces = {"far": (vertices - [0, 0, 1.0], faces), "near": (vertices, faces)}
    assert pick_on_rays((0.9, 0.8, 2.0), (0.0, 0.0, -1.0), pieces) == ("near", 2)
    assert pick_on_rays((1.4, 0.8, 2.0), (0.0, 0.0, -1.0), pieces) is None
    assert pick_on_rays((0.5, 0.5, 2.0), (0.0, 0.0, 1.0), pieces) is None
    flat = {"left": vertices[:, :2], "right": vertices[:, :2] + [2.0, 0.0]}
    assert pick_flat((2.95, 0.1), flat) == ("right", 1)
    assert pick_flat((9.0, 0.0), flat) is None
    lines = {"bottom": [0, 1], "left": [3, 0]}
    assert nearest_line((0.5, 0.01, 0.0), vertices, lines) == "bottom"
    assert nearest_line((0.5, 0.5, 0.0), vertices, lines) is None


def test_maps_have_scales_that_hold_the_cloth(tmp_path: Path) -> None:
    solution = bodice(tmp_path).solution
    assert solution is not None
    frame = PieceFrame.of_result(solution.pieces["trial"])
    for kind in ("energy", "warp", "weft"):
        scale = piece_scale(kind, [frame])
        values = face_values(kind, frame)
        inside = (values >= scale.low) & (values <= scale.high)
        assert frame.worn.area[inside].sum() >= 0.97 * frame.worn.area.sum()
        assert scale.high < 5.0 * np.abs(values).max()
        assert not scale.is_blank
        colours = scale.rgb(np.linspace(scale.low, scale.high, 5))
        assert len(np.unique(colours.round(3), axis=0)) == 5
    at_vertices = vertex_values(np.full(len(frame.worn.area), 3.0), frame.positions, frame.surface.faces)
    np.testing.assert_allclose(at_vertices, 3.0)
