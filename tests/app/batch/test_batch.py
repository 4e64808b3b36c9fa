"""Batches: plan, keys, results, and workers that are killed."""

from __future__ import annotations

import csv
import importlib
import json
import os
import re
import signal
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from warpflat.app.batch.body_statistics import BodyPattern, bodies_table, compare_with_sizes, fit_trend
from warpflat.app.batch.plan import Task, load_batch
from warpflat.app.batch.run import run_batch
from warpflat.app.batch.task import Row, read_row, set_aside
from warpflat.app.cli.batch import batch
from warpflat.app.scene.load import load_scene
from warpflat.core.errors import InputError
from warpflat.core.input_files import read_result
from warpflat.pattern.files.output import write_sealed

SCENES = Path(__file__).parents[3] / "scenes"
PATCH = """
datum = "centre"
[surface]
shape = "dome"
resolution = 9
[output]
picture = false
frames = 0
[pattern]
formats = []
"""
FABRICS = 'scenes = ["patch.toml"]\nfabrics = ["woven", "denim", "jersey"]\n'


def write(folder: Path, text: str = FABRICS) -> Path:
    (folder / "patch.toml").write_text(PATCH)
    (folder / "b.toml").write_text(text)
    return folder / "b.toml"


def plan(folder: Path, text: str = FABRICS) -> list[Task]:
    return load_batch(write(folder, text))


def files(out: Path) -> dict[str, int]:
    """The files of a batch but its index, with the time of their last change."""
    return {str(path): path.stat().st_mtime_ns for path in out.rglob("*") if path.is_file() and path.parent != out}


def without_times(data: Any) -> Any:
    if isinstance(data, dict):
        return {key: without_times(each) for key, each in data.items() if key not in ("seconds", "memory_mb")}
    return [without_times(each) for each in data] if isinstance(data, list) else data


def contents(folder: Path) -> dict[str, Any]:
    return {
        path.name: without_times(json.loads(path.read_text())) if path.suffix == ".json" else path.read_bytes()
        for path in folder.iterdir()
    }


# --- the plan


def test_a_batch_is_a_product():
    tasks = load_batch(SCENES / "batch_sizes.toml")
    assert len({task.key for task in tasks}) == 10
    assert [(task.body, task.fabric) for task in tasks[:3]] == [
        ("EU 36", "woven"),
        ("EU 36", "denim"),
        ("EU 38", "woven"),
    ]
    settings = tasks[2].make_scene().settings
    # All but the film is as in a run of the scene itself, so that both tell the same energies.
    alone = load_scene(SCENES / "basic_block.toml").settings
    assert settings.model_copy(update={"output": alone.output}) == alone
    assert settings.mannequin.size == "EU 38"


def test_a_batch_is_a_list(tmp_path: Path):
    tasks = plan(
        tmp_path,
        '[[tasks]]\nscene = "patch.toml"\nfabric = "denim"\n[[tasks]]\nform = "bodice"\nbody.measurements = {bust = 0.9, waist = 0.7, '
        'hip = 0.95, stature = 1.7}\nbody.name = "Ada"\noverride.ease = "loose"\n',
    )
    assert [(task.scene, task.body, task.fabric, task.override) for task in tasks] == [
        ("patch", "", "denim", ""),
        ("bodice", "Ada", "isotropic", "ease=loose"),
    ]


def test_a_key_follows_content_not_paths(tmp_path: Path):
    a, b = tmp_path / "a", tmp_path / "b"
    for folder in (a, b):
        folder.mkdir()
        (folder / "mesh.obj").write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n")
        (folder / "patch.toml").write_text('[surface]\nfile = "mesh.obj"\n')
        (folder / "b.toml").write_text('scenes = ["patch.toml"]\n')
    (key,) = [task.key for task in load_batch(a / "b.toml")]
    assert [task.key for task in load_batch(b / "b.toml")] == [key]
    # A default that is written down is the same scene; another value is not.
    (b / "patch.toml").write_text('grain_angle = 0.0\n[surface]\nfile = "mesh.obj"\n')
    assert [task.key for task in load_batch(b / "b.toml")] == [key]
    (b / "b.toml").write_text('scenes = ["patch.toml"]\noverrides = [{ grain_angle = 5.0 }]\n')
    assert [task.key for task in load_batch(b / "b.toml")] != [key]
    (a / "mesh.obj").write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 2 0\nf 1 2 3 4\n")
    assert [task.key for task in load_batch(a / "b.toml")] != [key]


@pytest.mark.parametrize(
    "named", ["[seams]\nbody = 'named'\n", "[find_seams]\nbody = 'named'\n", "[[seams_cut]]\nedges = 'named'\n"]
)
def test_each_file_that_a_scene_names_starts_in_its_folder_and_counts(tmp_path: Path, named: str):
    (tmp_path / "mesh.obj").write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n")
    (tmp_path / "patch.toml").write_text('[surface]\nfile = "mesh.obj"\n' + named)
    (tmp_path / "b.toml").write_text('scenes = ["patch.toml"]\n')
    (tmp_path / "named").write_text("0 1\n")
    (task,) = load_batch(tmp_path / "b.toml")
    assert str(tmp_path / "named") in json.dumps(task.data)
    (tmp_path / "named").write_text("1 2\n")
    assert load_batch(tmp_path / "b.toml")[0].key != task.key


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "is empty"),
        ("fabrics = ['denim']", 'scenes = ["FILE"], forms'),
        ("scenes = ['patch.toml']\nfabric = ['denim']", "did you mean 'fabrics'?"),
        ("scenes = ['patsch.toml']", "did you mean"),
        ("forms = ['bodice']\n[[bodies]]\nscan = 'nobody.obj'", "nobody.obj: cannot be read: no such file"),
        ("scenes = ['patch.toml']\noverrides = [{ datum = 3 }]", "datum: should be a valid string"),
        ("scenes = ['patch.toml']\n[[bodies]]\nsize = 'EU 38'", "either a [surface] table or a [mannequin]"),
        ("[[tasks]]\nfabric = 'denim'", "a task needs either scene"),
    ],
)
def test_a_mistake_in_the_plan_is_one_line(tmp_path: Path, text: str, words: str):
    with pytest.raises(InputError) as caught:
        plan(tmp_path, text)
    assert words in str(caught.value)
    assert str(tmp_path / "b.toml") in str(caught.value)


# --- results


def test_what_is_done_is_not_done_again(tmp_path: Path):
    tasks, out = plan(tmp_path), tmp_path / "out"
    run_batch(tasks[:2], out)
    before, seen = files(out), list[tuple[int, int]]()
    rows = run_batch(tasks, out, on_progress=lambda *numbers: seen.append(numbers))
    assert [row.status for row in rows] == ["at rest"] * 3
    assert seen == [(2, 2), (3, 2)]
    assert {name: files(out)[name] for name in before} == before
    # It is done where `warpflat run` would end with 0.
    metrics = out / tasks[0].key / "metrics.json"
    for fault in (
        {"pattern": {"seams_that_differ": ["side"], "seam_difference_mm": 9.0, "seam_difference_per_50mm_mm": None}},
        {"garment": {"no_pattern": "no pattern yet"}},
        {"left_out": ["it was not sewn"]},
    ):
        write_sealed(metrics, {**read_result(metrics), **fault})
        assert read_row(tasks[0], out).status == "not at rest"
        write_sealed(metrics, {key: value for key, value in read_result(metrics).items() if key not in fault})
    metrics.unlink()  # half a result is none
    assert read_row(tasks[0], out) is None


def test_an_interruption_keeps_what_is_done(tmp_path: Path):
    def stop(done: int, before: int) -> None:
        if done == 2:
            raise KeyboardInterrupt

    tasks, out = plan(tmp_path), tmp_path / "out"
    with pytest.raises(KeyboardInterrupt):
        run_batch(tasks, out, on_progress=stop)
    with (out / "index.csv").open(newline="") as file:
        assert [row["status"] for row in csv.DictReader(file)] == ["at rest", "at rest", "to do"]


def test_an_error_is_a_result(tmp_path: Path):
    path, out = write(tmp_path, FABRICS.replace("denim", "<b>tweed")), tmp_path / "out"
    done = CliRunner().invoke(batch, [str(path), "--out", str(out)], standalone_mode=False)
    assert done.return_value == 1
    assert "2 at rest, 1 error" in done.output
    tasks = load_batch(path)
    error = out / f"{tasks[1].key}.error.json"
    assert "unknown fabric" in json.loads(error.read_text())["message"]
    assert not (out / tasks[1].key).exists()
    written = error.stat().st_mtime_ns
    assert [row.status for row in run_batch(tasks, out)] == ["at rest", "error", "at rest"]
    assert error.stat().st_mtime_ns == written
    page = (out / "index.html").read_text()
    assert page.count("<tr>") == 4
    assert "http" not in page
    assert "<b>tweed" not in page


def test_set_aside_leaves_nothing_behind(tmp_path: Path):
    (task, *_) = plan(tmp_path)
    (tmp_path / task.key).mkdir()
    assert set_aside(task, tmp_path).status == "set aside"
    assert not (tmp_path / task.key).exists()


def test_a_task_that_killed_its_process_three_times_is_set_aside(tmp_path: Path):
    task, other, *_ = plan(tmp_path)
    (tmp_path / f"{task.key}.started").write_text("here 1\nhere 2\nhere 3\n")
    (tmp_path / f"{other.key}.started").write_text("here 1\nhere 2\n")
    rows = run_batch([task, other], tmp_path)
    assert [row.status for row in rows] == ["set aside", "at rest"]
    assert "killed 3 times" in rows[0].message
    assert not list(tmp_path.glob("*.started"))


# --- bodies


def body_pattern(name: str, girths: tuple[float, float, float], *, is_size: bool) -> BodyPattern:
    task = Task(key=name, name="b", scene="b.toml", body=name, fabric="woven", override="", data={}, where="")
    bust, waist, hip = girths
    return BodyPattern(
        row=Row(task=task, status="at rest"),
        is_size=is_size,
        girths={"bust": bust, "waist": waist, "hip": hip},
        measures={"area": 0.5 * bust, "side_seam": 0.2},
        pattern_girths={"bust": bust + 0.06, "waist": waist + 0.04},
        strain_limit=0.05,
    )


def test_bodies_are_compared_with_their_nearest_size():
    sizes = [
        body_pattern(f"EU {n}", (0.01 * n + 0.5, 0.01 * n + 0.34, 0.01 * n + 0.58), is_size=True) for n in (36, 40)
    ]
    near = body_pattern("Ada", (0.905, 0.74, 0.98), is_size=False)
    narrow = body_pattern("Eve", (0.90, 0.90, 0.98), is_size=False)
    *_, near, narrow = compare_with_sizes([*sizes, near, narrow])
    assert (near.size, narrow.size) == ("EU 40", "EU 40")
    assert near.graded_ease["bust"] == pytest.approx(0.055)
    assert not near.pays
    # The size's waist is 0.78 m around a waist of 0.90 m.
    assert narrow.graded_strain == pytest.approx(0.90 / 0.78 - 1.0)
    assert narrow.pays
    assert list(csv.DictReader(bodies_table([near, narrow]).splitlines()))[1]["made_to_measure_pays"] == "yes"


def test_a_trend_is_the_line_through_the_measures():
    trend = fit_trend([0.8, 0.9, 1.0], [1.0, 1.2, 1.4])
    assert trend is not None
    assert (trend.slope, trend.offset, trend.determination) == pytest.approx((2.0, -0.6, 1.0))
    assert fit_trend([0.8, 0.8, 0.9], [1.0, 1.1, 1.2]) is None


def test_a_batch_over_bodies_draws_them(tmp_path: Path):
    (tmp_path / "b.toml").write_text(
        'forms = ["bodice"]\noverrides = [{ mannequin = { resolution_mm = 40 }, output = { picture = false, frames = 0 }, '
        'pattern = { formats = [] } }]\n[[bodies]]\nsize = "EU 38"\n[[bodies]]\nname = "Ada"\n'
        "measurements = { bust = 0.97, waist = 0.70, hip = 0.97, stature = 1.70 }\n"
    )
    run_batch(load_batch(tmp_path / "b.toml"), tmp_path / "out")
    (size, ada) = csv.DictReader((tmp_path / "out" / "bodies.csv").open())
    assert (size["nearest_size"], ada["nearest_size"]) == ("", "EU 38")
    assert ada["made_to_measure_pays"] == "yes"
    assert (tmp_path / "out" / "bodies.png").stat().st_size > 10_000
    assert "bodies.png" in (tmp_path / "out" / "index.html").read_text()


# --- workers


def test_a_task_that_never_began_is_not_said_to_have_killed_its_worker(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    workers = pytest.importorskip("warpflat.app.batch.workers", reason="the extra `batch` (Dask) is not installed")
    tasks, retried = plan(tmp_path), list[str]()

    class Lost:
        """A future whose workers die before its task begins, or once it has begun for the third time."""

        def __init__(self, task: Task) -> None:
            self.task = task

        def result(self) -> Row:
            raise workers.KilledWorker(self.task.key, None, 3)

        def retry(self) -> None:
            retried.append(self.task.key)
            if self.task is tasks[0]:
                with (tmp_path / f"{self.task.key}.started").open("a") as file:
                    file.write("here 1\n")

    class Scheduler:
        def nthreads(self) -> dict[str, int]:
            return {"one": 1, "two": 1}

        def submit(self, _: object, task: Task, *__: object, **___: object) -> Lost:
            return Lost(task)

    class Waited:
        def __init__(self, futures: list[Lost], **_: object) -> None:
            self.done = futures

    monkeypatch.setattr(workers, "wait", Waited)
    killer, innocent = workers._run_round(Scheduler(), {task.key: task for task in tasks[:2]}, tmp_path)
    assert retried.count(tasks[0].key) == 3
    assert (killer.status, innocent.status) == ("set aside", "set aside")
    assert "killed 3 times" in killer.message
    assert "died before it began" in innocent.message
    assert read_row(tasks[0], tmp_path) == killer
    assert read_row(tasks[1], tmp_path) is None


def test_a_killed_worker_costs_nothing_but_time(tmp_path: Path):
    pytest.importorskip("distributed", reason="the extra `batch` (Dask) is not installed")
    import psutil

    def kill_one(done: int, before: int) -> None:
        if done == 1:
            workers = [
                child for child in psutil.Process().children(recursive=True) if "spawn_main" in str(child.cmdline())
            ]
            assert len(workers) == 2
            os.kill(workers[0].pid, signal.SIGKILL)

    text = FABRICS.replace('"jersey"', '"jersey", "interlock"')
    tasks = plan(tmp_path, text)
    rows = run_batch(tasks, tmp_path / "out", workers=2, on_progress=kill_one)
    assert [row.status for row in rows] == ["at rest"] * 4
    # By a worker, too: the noise of --rounding does not reach it.
    (tmp_path / "whole").mkdir()
    whole = importlib.import_module("warpflat.app.batch.workers").run_on_workers(tasks[:1], tmp_path / "whole", 1)
    assert [row.status for row in whole] == ["at rest"]
    assert contents(tmp_path / "out" / tasks[0].key) == contents(tmp_path / "whole" / tasks[0].key)


def test_a_folder_is_named_by_scene_body_and_cloth(tmp_path: Path):
    (task, *_) = load_batch(SCENES / "batch_sizes.toml")
    assert re.fullmatch(r"basic_block-EU_36-woven-[0-9a-f]{16}", task.key)
    assert [re.sub(r"-\w{16}$", "", each.key) for each in plan(tmp_path)] == [
        "patch-woven", "patch-denim", "patch-jersey",
    ]  # fmt: skip


def test_without_a_terminal_lines_tell_how_far_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    file = write(tmp_path)
    told = CliRunner().invoke(batch, [str(file), "--out", str(tmp_path / "out")])
    assert re.search(r"^b: 1 of 3 tasks, about \d+ min left$", told.stderr, re.MULTILINE)
    assert "b: 3 of 3 tasks\n" in told.stderr
    # Quiet, nothing is told, nor that workers need what is not installed.
    monkeypatch.setattr("warpflat.app.cli.batch.find_spec", lambda _: None)
    again = CliRunner().invoke(batch, [str(file), "--out", str(tmp_path / "out"), "-q", "--workers", "2"])
    assert (again.exit_code, again.stderr) == (0, "")
