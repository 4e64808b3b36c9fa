from __future__ import annotations

import json
import re
import runpy
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from warpflat.app.scene import run
from warpflat.app.scene.frames import FrameSchedule
from warpflat.app.scene.load import fabric_of_correction, load_scene, scene_fabric
from warpflat.app.scene.plan import plan_scene
from warpflat.app.scene.run import run_scene
from warpflat.app.scene.schema import OutputTable
from warpflat.app.scene.surface import scene_surface
from warpflat.core.errors import InputError
from warpflat.flat.fabric.fabric import DEFAULT_FABRIC
from warpflat.flat.fabric.library import find_fabric
from warpflat.garment.construction import to_pattern
from warpflat.pattern.files.beside import Beside

SCENES = Path(__file__).parents[3] / "scenes"

PLANE_OBJ = "v 0 0 0\nv 10 0 0\nv 10 10 0\nv 0 10 0\nv 20 0 0\nv 20 10 0\nf 1 2 3 4\nf 2 5 6 3\n"


def write_scene(folder: Path, text: str, name: str = "trial.toml") -> Path:
    path = folder / name
    path.write_text(text)
    return path


# --- reading


def test_a_scene_says_everything_about_a_run(tmp_path: Path):
    path = write_scene(
        tmp_path,
        """
        name = "cap"
        fabric = "denim"
        datum = "middle"
        grain_angle = 45
        [surface]
        shape = "dome"
        resolution = 9
        [lines.middle]
        from = 4
        to = [0.0, 0.25, 0.37]
        [relax]
        max_steps = 77
        [output]
        frames = 0
        picture = false
        """,
    )
    scene = load_scene(path)
    assert scene.name == "cap"
    assert scene.settings.grain_angle == 45.0
    assert scene.settings.relax.max_steps == 77
    assert scene_fabric(scene) == find_fabric("denim")
    surface = scene_surface(scene)
    assert surface.name == "cap"
    assert {"middle", "centre", "left"} <= set(surface.lines)
    np.testing.assert_array_equal(surface.lines["middle"], surface.lines["centre"])


def test_a_fabric_table_and_fabric_files(tmp_path: Path):
    write_scene(tmp_path, "[mine]\nbase = 'denim'\nshear_stiffness = 40.0\n", "cloth.toml")
    start = "fabric_files = ['cloth.toml']\n"
    surface = "[surface]\nshape = 'dome'\n"
    by_name = load_scene(write_scene(tmp_path, f"fabric = 'mine'\n{start}{surface}"))
    assert scene_fabric(by_name).shear_stiffness == 40.0
    table = "[fabric]\nbase = 'mine'\n[fabric.fast]\ne100_warp = 3\ne100_weft = 4\n"
    own = scene_fabric(load_scene(write_scene(tmp_path, start + surface + table)))
    assert own.name == "trial"
    assert own.shear_stiffness == 40.0
    assert own.stiffness_warp == pytest.approx(98.07 / 0.03, rel=1e-3)


def test_the_only_fabric_of_the_files_is_meant_and_of_several_one_must_be_named(tmp_path: Path):
    write_scene(tmp_path, "[mine]\nbase = 'denim'\nshear_stiffness = 40.0\n", "cloth.toml")
    start, surface = "fabric_files = ['cloth.toml']\n", "[surface]\nshape = 'dome'\n"
    assert scene_fabric(load_scene(write_scene(tmp_path, start + surface))).shear_stiffness == 40.0
    write_scene(tmp_path, "[mine]\nbase = 'denim'\n[yours]\nbase = 'mine'\n", "cloth.toml")
    with pytest.raises(InputError, match=r"fabric is not given.*mine, yours"):
        load_scene(write_scene(tmp_path, start + surface))


def test_the_cloth_of_a_correction_is_looked_for_before_anything_is_made(tmp_path: Path):
    write_scene(tmp_path, "[mine]\nbase = 'denim'\nshear_stiffness = 40.0\n", "cloth.toml")
    start = "fabric = 'denim'\nfabric_files = ['cloth.toml']\n[surface]\nshape = 'dome'\n[drape]\ncorrect_fabric = "
    cloth = fabric_of_correction(load_scene(write_scene(tmp_path, f"{start}'mine'\n")))
    assert cloth is not None
    assert cloth.shear_stiffness == 40.0
    with pytest.raises(InputError, match=r"drape\.correct_fabric: unknown fabric 'mien'.*'mine'"):
        plan_scene(load_scene(write_scene(tmp_path, f"{start}'mien'\n")))


def test_the_cloth_of_a_correction_is_judged_by_the_limit_of_shear_that_the_scene_allows(tmp_path: Path):
    start = "fabric = 'denim'\nshear_limit = 6.0\n[surface]\nshape = 'dome'\n[drape]\ncorrect_fabric = "
    cloth = fabric_of_correction(load_scene(write_scene(tmp_path, f"{start}'woven'\n")))
    assert cloth is not None
    assert cloth.shear_limit == 6.0
    with pytest.raises(InputError, match="shear_limit: a limit of shear says nothing of paper"):
        plan_scene(load_scene(write_scene(tmp_path, f"{start}'paper'\n")))


def test_scenes_and_fabrics_may_begin_with_a_byte_order_mark(tmp_path: Path):
    write_scene(tmp_path, "\ufeff[mine]\nbase = 'denim'\nshear_stiffness = 40.0\n", "cloth.toml")
    text = "\ufefffabric = 'mine'\nfabric_files = ['cloth.toml']\n[surface]\nshape = 'dome'\n"
    assert scene_fabric(load_scene(write_scene(tmp_path, text))).shear_stiffness == 40.0


def test_mesh_files_are_found_from_the_scene_and_by_variables(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "plane.obj").write_text(PLANE_OBJ)
    beside = write_scene(tmp_path, "[surface]\nfile = 'meshes/plane.obj'\nunits = 'cm'\n")
    assert np.ptp(scene_surface(load_scene(beside)).vertices[:, 0]) == pytest.approx(0.2)
    monkeypatch.setenv("WARPFLAT_TRIAL", str(tmp_path / "meshes"))
    for form in ("${WARPFLAT_TRIAL}/plane.obj", "$WARPFLAT_TRIAL/plane.obj"):
        by_variable = write_scene(tmp_path, f"[surface]\nfile = '{form}'\nunits = 'mm'\n")
        assert np.ptp(scene_surface(load_scene(by_variable)).vertices[:, 0]) == pytest.approx(0.02)
    monkeypatch.delenv("WARPFLAT_TRIAL")
    with pytest.raises(InputError, match=r"surface.file: environment variable WARPFLAT_TRIAL is not set; .*plane.obj"):
        scene_surface(load_scene(by_variable))


DOME = "[surface]\nshape = 'dome'\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", r"is empty; a scene needs at least a \[surface\] table"),
        ("scenes = ['dome.toml']\n", r"\.toml: is a batch of scenes: warpflat batch \S+\.toml runs it$"),
        ("name = 'x'\nname = 'y'\n", r"is not valid TOML: Cannot overwrite a value \(at line 2"),
        ("fabric = 'woven'\n", r"a scene needs either a \[surface\] table or a \[mannequin\] table with a form"),
        ("[mannequin]\nsize = 'EU 38'\n", r"a mannequin and a form go together"),
        ("form = 'bodice'\n[mannequin]\nsymmetric = false\n", r"give the body in one way: size"),
        (
            "form = 'bodice'\n[mannequin]\nsize = 'EU 38'\nsymmetric = false\nlandmarks = { bust = 1.3 }\n",
            r"mannequin: given with size, but of a scan only: landmarks, symmetric; leave it out, or give a scan",
        ),
        ("half = true\n" + DOME, r"half belongs to a form's pieces; on a \[surface\] give the half's mesh"),
        ("fabrik = 'woven'\n" + DOME, r"fabrik: unknown key 'fabrik'; did you mean 'fabric'\? valid: "),
        ("[surface]\nshpe = 'dome'\n", r"surface.shpe: unknown key 'shpe'; did you mean 'shape'"),
        ("[surface]\nflie = 'x.obj'\n", r"surface.flie: unknown key 'flie'; did you mean 'file'"),
        (
            "[surface]\nshape = 'dome'\nfile = 'x.obj'\n",
            r"surface: give the surface by its file or by a shape, not both",
        ),
        (
            "[surface]\nfile = 'x.obj'\ncomponent = 'big'\n",
            r"surface.component: should be \"largest\", \"all\" or a number from 0, .* got 'big'$",
        ),
        (
            "[surface]\nfile = 'x.obj'\ncomponent = -1\n",
            r"surface.component: should be \"largest\", \"all\" or .* got -1$",
        ),
        (
            DOME + "[lines.a]\nfrom = 1\nto = 2\nvia = 3\n",
            r"lines.a.via: .* valid: border, curve, from, plane, to, vertices",
        ),
        (DOME + "[lines.a]\nfrom_ = 1\nto = 2\n", r"lines.a.from_: unknown key 'from_'; did you mean 'from'\?"),
        ("[surface]\nfile = 3\n", r"surface.file: should be a valid string, got 3"),
        ("surface = 'dome'\n", r"surface: "),
        (DOME + "[relax]\nmax_step = 3\n", r"relax.max_step: unknown key 'max_step'; did you mean 'max_steps'"),
        (DOME + "[relax]\nmax_steps = '3'\n", r"relax.max_steps: should be a valid integer, got '3'"),
        (DOME + "[output]\nframes = -1\n", r"output.frames: should be greater than or equal to 0, got -1"),
        (DOME + "[output]\npicture = 1\n", r"output.picture: should be a valid boolean, got 1"),
        (DOME + "[lines.a]\n", r"lines.a: give the line in one way: vertices, from and to"),
        (DOME + "[lines.a]\nfrom = 1\n", r"lines.a: a shortest path needs both from and to"),
        (DOME + "[lines.a]\nfrom = 1\nto = [1, 2]\n", r"lines.a.to: .*at least 3 items"),
        (DOME + "[lines.a]\nfrom = 'x'\nto = 3\n", r"lines.a.from: should be a valid integer, got 'x'"),
        (
            DOME + "[lines.a]\nplane = { point = [0, 0, nan], normal = [1, 0, 0] }\n",
            r"lines.a.plane.point\[2\]: .*finite",
        ),
        (DOME + "[lines.a]\nplane = { pont = [0, 0, 0], normal = [1, 0, 0] }\n", r"lines.a.plane.pont: .*'point'"),
        ("name = '../x'\n" + DOME, r"name: '\.\./x' cannot name files"),
        ("[fabric]\nstifness_warp = 1\n" + DOME, r"fabric.stifness_warp: unknown key .*'stiffness_warp'"),
        ("grain_angle = 400\n" + DOME, r"grain_angle: should be less than or equal to 360, got 400"),
    ],
)
def test_mistakes_in_a_scene_are_told_in_one_line(tmp_path: Path, text: str, message: str):
    path = write_scene(tmp_path, text)
    with pytest.raises(InputError, match=message) as caught:
        load_scene(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[surface]\nshape = 'dmoe'\n", r"surface: unknown shape 'dmoe'; did you mean 'dome'"),
        ("[surface]\nshape = 'dome'\nradios = 1.0\n", r"surface: radios: unknown key .*did you mean 'radius'"),
        ("[surface]\nshape = 'dome'\nradius = 0.1\n", r"surface: dome: radius = 0.1; must lie between|radius = 0.1 m"),
        ("[surface]\nshape = 'dome'\nresolution = 1e3\n", r"surface: resolution: should be a whole number"),
        ("fabric = 'wovn'\n" + DOME, r"fabric: unknown fabric 'wovn': did you mean 'woven'"),
        ("datum = 'centr'\n" + DOME, r"datum.*'centr'.*did you mean 'centre'"),
        (DOME + "[relax]\nmax_steps = 0\n", r"relax: .*max_steps"),
        (DOME + "[relax]\ntime_step = -1.0\n", r"relax: .*time_step"),
        (DOME + "[lines.a]\nvertices = [0, 1, 9999]\n", r"lines\.a: .*9999"),
        (DOME + "[lines.a]\nplane = { point = [9, 9, 9], normal = [1, 0, 0] }\n", r"lines\.a: "),
        (DOME + "[lines.a]\nborder = 'botom'\n", r"lines\.a: .*'bottom'"),
    ],
)
def test_mistakes_that_show_when_a_scene_runs(tmp_path: Path, text: str, message: str):
    scene = load_scene(write_scene(tmp_path, text))
    with pytest.raises(InputError, match=message) as caught:
        run_scene(scene, tmp_path / "out")
    assert str(caught.value).startswith(scene.where)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "out").exists()


# --- frames


def test_frames_thin_out_or_come_at_equal_steps():
    even = FrameSchedule(OutputTable(frame_every=25))
    assert [step for step in range(101) if even.is_due(step, 100)] == [0, 25, 50, 75, 100]
    sparse = FrameSchedule(OutputTable(frame_every=25))
    assert [step for step in range(0, 101, 10) if sparse.is_due(step, 100)] == [0, 30, 50, 80, 100]
    thin = FrameSchedule(OutputTable(frames=40))
    due = [step for step in range(10_001) if thin.is_due(step, 10_000)]
    assert due[:4] == [0, 1, 2, 3]
    assert 25 <= len(due) <= 41
    assert np.all(np.diff(due, n=2) >= -1)
    seldom = FrameSchedule(OutputTable(frames=40))
    assert [step for step in range(0, 101, 10) if seldom.is_due(step, 10_000)] == [0, 10, 20, 30, 40, 60, 80]


# --- running


def test_a_run_leaves_the_files_of_the_contract(tmp_path: Path):
    from pxr import Usd, UsdGeom

    scene = load_scene(write_scene(tmp_path, "datum = 'centre'\n[surface]\nshape = 'dome'\nresolution = 9\n"))
    steps: list[int] = []
    result = run_scene(scene, tmp_path / "out", on_progress=lambda progress: steps.append(progress.step))
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == sorted(result.files)
    pattern = {"trial.dxf", "trial.svg", "pattern.pdf", "pattern.json"}
    assert set(result.files) == {"metrics.json", "trial.obj", "frames.usdc", "picture.png", "review.html", *pattern}
    metrics = json.loads((tmp_path / "out" / "metrics.json").read_text())
    assert metrics == json.loads(json.dumps(result.metrics))
    piece = metrics["pieces"]["trial"]
    assert (piece["vertices"], piece["faces"], piece["flipped_faces"]) == (81, 64, 0)
    assert piece["fabric"] == DEFAULT_FABRIC
    assert piece["stages"][-1]["converged"]
    assert 0.0 < piece["length_error"] < 0.03
    assert steps[-1] == sum(stage["steps"] for stage in piece["stages"] if stage["name"] in ("steps", "relax"))
    assert steps == sorted(steps)

    stage = Usd.Stage.Open(str(tmp_path / "out" / "frames.usdc"))
    prim = stage.GetPrimAtPath("/World/trial")
    for key in ("model_energy_j", "strain_energy_j", "length_error"):
        assert prim.GetAttribute(f"warpflat:{key}").Get(stage.GetEndTimeCode()) == piece[key]
    points = UsdGeom.Mesh(stage.GetPrimAtPath("/World/trial/trial_pattern")).GetPointsAttr()
    texture = [
        [float(x) for x in line.split()[1:]]
        for line in (tmp_path / "out" / "trial.obj").read_text().splitlines()
        if line.startswith("vt ")
    ]
    last = np.asarray(points.Get(stage.GetEndTimeCode()))
    np.testing.assert_allclose(last[:, :2], texture, atol=1e-7)
    assert np.abs(np.asarray(points.Get(stage.GetStartTimeCode())) - last).max() > 1e-4


def test_files_that_are_not_wanted_are_not_written(tmp_path: Path):
    text = (
        "[surface]\nshape = 'strip'\nresolution = 9\n[output]\nframes = 0\npicture = false\n[pattern]\nformats = []\n"
    )
    result = run_scene(load_scene(write_scene(tmp_path, text)), tmp_path)
    assert set(result.files) == {"metrics.json", "trial.obj"}


# --- scripts


def test_the_scripted_scene_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(SCENES / "scripted.py"), run_name="__main__")
    told = capsys.readouterr().out
    assert "flips 0" in told
    assert "inf" not in told
    _, *cloths = re.split("^(?:denim|interlock)$", told, flags=re.MULTILINE)
    for cloth in cloths:
        energies = [float(energy) for energy in re.findall(r"([0-9.]+) mJ", cloth)]
        assert len(energies) >= 5
        assert energies == sorted(energies, reverse=True)
    assert (tmp_path / "out" / "scripted" / "denim" / "metrics.json").exists()


def test_the_kernels_driven_by_hand_come_to_rest(capsys: pytest.CaptureFixture[str]):
    runpy.run_path(str(SCENES / "kernels.py"), run_name="__main__")
    told = capsys.readouterr().out
    energies, wide = (
        [float(text) for text in re.findall(pattern, told)] for pattern in (r"([0-9.]+) mJ", r"([0-9.]+) cm wide")
    )
    developed, free, pulled = energies
    assert free < pulled
    assert free < developed
    assert wide[2] < wide[1], "one's own force makes it narrower"
    assert "NOT at rest" not in told


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "datum = 'centre'\n[seams]\nfind = 'none'\nkeep = ['waist']\n[surface]\nfile = 'x.obj'\n",
            "datum belongs to one piece",
        ),
        ("start = 'x.obj'\nform = 'bodice'\n[mannequin]\nsize = 'EU 38'\n", "start belongs to a [surface]"),
    ],
)
def test_what_a_scene_would_not_heed_is_refused(tmp_path: Path, text: str, message: str):
    with pytest.raises(InputError, match=re.escape(message)):
        load_scene(write_scene(tmp_path, text))


def test_a_table_for_a_piece_of_a_garment_that_is_cut_where_it_is_kept(tmp_path: Path):
    kept = "[seams]\nfind = 'none'\nkeep = ['waist']\n[surface]\nfile = 'x.obj'\n[pieces.front]\ngrain_angle = 5\n"
    assert load_scene(write_scene(tmp_path, kept)).settings.pieces["front"].grain_angle == 5


def test_sizes_lie_in_the_order_of_their_table():
    settings = SimpleNamespace(pattern=SimpleNamespace(sizes=["US 2", "US 00"]))
    plan = SimpleNamespace(scene=SimpleNamespace(settings=settings))
    assert [*run._in_order(plan, dict.fromkeys(("US 2", "US 00", "US 0")))] == ["US 00", "US 0", "US 2"]


def test_film_pictures_and_paper_show_one_drawing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    drawn = list[str]()
    monkeypatch.setattr(Beside, "__enter__", lambda beside: beside)  # all in this process, where it is counted
    describe = to_pattern.describe_worn
    monkeypatch.setattr(to_pattern, "describe_worn", lambda *given: (drawn.append(given[1].name), describe(*given))[1])
    skirt = (SCENES / "circle_skirt.toml").read_text().replace("[mannequin]\n", "[mannequin]\nresolution_mm = 25\n")
    result = run_scene(load_scene(write_scene(tmp_path, skirt, "skirt.toml")), tmp_path / "out")
    assert {"frames.usdc", "picture.png", "pattern.pdf"} < {*result.files}
    assert drawn == ["skirt"]
