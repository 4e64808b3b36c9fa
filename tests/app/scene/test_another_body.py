"""`warpflat fit`: from a garment's file to the pattern for another body."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from bodies import body_of_size, mean_person
from command import Command

from warpflat.app.scene.fit import (
    STUDY_FILES,
    Fitted,
    carry_cuts,
    ease_wishes,
    fit_to,
    keeps_pattern,
    read_job,
    study_table,
)
from warpflat.core.errors import InputError
from warpflat.garment.construction.file_seams import file_seams
from warpflat.garment.construction.sewn_panels import read_sewn_panels
from warpflat.garment.mannequin.body_model import BodyModel, Person, finer_body, rotation
from warpflat.garment.mannequin.closest import Mesh
from warpflat.garment.seams.layers import read_garment
from warpflat.pattern.files.output import refuse_to_replace_others

BARE = ("--frames", "0", "--no-picture", "--quiet")
ON = ("--from", "EU 36")


def _skirt(path: Path, *, texture: bool = True, shift: float = 0.0, unit: float = 1.0, measured: float = 1.0) -> None:
    """Write a skirt on the body of EU 36, with a panel in front and one behind as its texture, in so many units per metre."""
    hips = body_of_size(20.0, "EU 36")
    turn = np.linspace(0.0, 2.0 * np.pi, 40, endpoint=False)
    rings = [hips.line(level)[:-1] for level in ("hip", "waist")]
    centre = 0.5 * (rings[0].min(axis=0) + rings[0].max(axis=0))
    # Narrow at the waist, flared below the hip.
    at = [hips.levels()["hip"].height - 0.35, *(hips.levels()[level].height for level in ("hip", "waist"))]
    sides = [0.5 * np.ptp(rings[0], axis=0) + 0.08, *(0.5 * np.ptp(ring, axis=0) + 0.02 for ring in rings)]
    heights = np.linspace(hips.levels()["hip"].height - 0.35, hips.levels()["waist"].height + 0.02, 22)
    lines = []
    for height in heights:
        wide = [np.interp(height, at, [side[k] for side in sides]) for k in range(3)]
        x, z = centre[0] + wide[0] * np.sin(turn), centre[2] + wide[2] * np.cos(turn)
        lines += [f"v {(a + shift) / unit:.6f} {height / unit:.6f} {b / unit:.6f}" for a, b in zip(x, z, strict=True)]
    if texture:
        for first in (0.0, 0.6):
            places = [(measured * (first + 0.024 * k), measured * height) for height in heights for k in range(21)]
            lines += [f"vt {x:.4f} {y:.4f}" for x, y in places]
    for row in range(21):
        for k in range(40):
            corners = [40 * row + k, 40 * row + (k + 1) % 40, 40 * row + 40 + (k + 1) % 40, 40 * row + 40 + k]
            # From the left side over the front to the right side, and the other half behind.
            half, at = divmod((k + 10) % 40, 20)
            first = 22 * 21 * half + 21 * row + at
            places = [first, first + 1, first + 22, first + 21]
            words = (f"{v + 1}/{t + 1}" if texture else f"{v + 1}" for v, t in zip(corners, places, strict=True))
            lines.append("f " + " ".join(words))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def test_a_skirt_is_fitted_to_another_size(command: Command):
    _skirt(Path("skirt.obj"))
    shown = ("--frames", "0", "--quiet")
    ended = command("fit", "skirt.obj", "--units", "m", *ON, "--to", "EU 42", "--out", "fitted", *shown)
    assert (ended.code, ended.err) == (0, "")
    report = json.loads(Path("fitted/fit.json").read_text(encoding="utf-8"))
    (entry,) = report["bodies"]
    assert entry["kept"]
    assert set(entry["levels"]) == {"waist", "hip"}
    for level in entry["levels"].values():
        assert level["ease_mm"] == pytest.approx(level["ease_before_mm"], abs=5.0)
    grown = body_of_size(20.0, "EU 42").levels()["hip"].girth - body_of_size(20.0, "EU 36").levels()["hip"].girth
    # It is as much wider as the body is, in space and in the pattern.
    metrics = json.loads(Path("fitted/metrics.json").read_text(encoding="utf-8"))
    assert len(metrics["pieces"]) == 2
    before, after = (read_garment(file, units="m") for file in ("skirt.obj", "fitted/skirt.fitted.obj"))
    row = slice(40 * 12, 40 * 13)
    girths = [
        np.linalg.norm(np.diff(np.vstack([r, r[:1]]), axis=0), axis=1).sum()
        for r in (before.raw.vertices[row], after.raw.vertices[row])
    ]
    assert girths[1] - girths[0] == pytest.approx(grown, abs=0.015)
    # Its islands, by which it is cut, are still there, and its mesh is the same one.
    for each in (before, after):
        assert len(file_seams(each.raw)["uv"].names) == 2
    assert np.array_equal(before.raw.polygons, after.raw.polygons)
    files = metrics["files"]["skirt"]
    assert {"skirt.fitted.obj", "skirt.body.obj", "pattern.json"} <= set(files)
    # Its page lists all files, and a second time it would replace what it has written.
    page = Path("fitted/review.html").read_text(encoding="utf-8")
    assert [file for file in files if file != "review.html" and f'href="{file}"' not in page] == []
    assert {"metrics.json", *STUDY_FILES[:1], *files} == {path.name for path in Path("fitted").iterdir()}
    refuse_to_replace_others(Path("fitted"), ["metrics.json", *STUDY_FILES, *files])


def test_a_known_pattern_is_graded_and_keeps_its_grain(tmp_path: Path):
    """Panels that are measured in millimetres, as of Style3D: 480 mm wide each, as much wider as the skirt is."""
    _skirt(tmp_path / "skirt.obj", measured=1e3)
    job = read_job(tmp_path / "skirt.obj", units="m", body="EU 36")
    assert keeps_pattern(job, {})
    assert not keeps_pattern(job, {"find_seams": {"find": "auto"}})
    result = fit_to(
        job, job.to("EU 42", {}), {"output": {"frames": 0, "picture": False}}, tmp_path / "out", name="skirt"
    )
    files = (tmp_path / "skirt.obj", tmp_path / "out" / "skirt.fitted.obj")
    before, after = (read_sewn_panels(file, units="m") for file in files)
    for was, now in zip(before, after, strict=True):
        # Up and down the middle of the panel it runs as it did; rings are as much longer as they are in space.
        middle = np.flatnonzero(np.abs(was.cut[:, 0] - was.cut[:, 0].mean()) < 0.005)
        way = now.cut[middle[np.argmax(now.cut[middle, 1])]] - now.cut[middle[np.argmin(now.cut[middle, 1])]]
        assert abs(np.degrees(np.arctan2(way[0], way[1]))) < 1.0
        grown = now.worn_area / was.worn_area
        assert grown > 1.04
        assert now.area / was.area == pytest.approx(grown, rel=0.003)
    assert len(result.metrics["pieces"]) == 2
    assert result.metrics["pattern_of_file"]["unit"] == "mm"
    assert result.metrics["pattern_of_file"]["area_ratio"] == pytest.approx(0.8, abs=0.1)
    _skirt(tmp_path / "painted.obj")
    assert not read_job(tmp_path / "painted.obj", units="m", body="EU 36").panels


def test_several_bodies_are_a_study_with_asked_ease(command: Command):
    _skirt(Path("skirt.obj"), texture=False)
    ended = command(
        "fit", "skirt.obj", "--units", "m", "--from", "EU 36", "--to", "EU 36", "--to", "EU 42", "--ease", "hip=90mm",
        "--out", "study", *BARE,
    )  # fmt: skip
    assert (ended.code, ended.err) == (0, "")
    with Path("study/fit.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["body"] for row in rows] == ["EU 36", "EU 42"]
    for row in rows:
        assert float(row["ease_hip_mm"]) == pytest.approx(90.0, abs=4.0)
        assert row["kept"] == "True"
    for folder in ("EU_36", "EU_42"):
        assert Path("study", folder, "pattern.json").is_file()


def test_quiet_keeps_the_notes_on_a_body_to_its_file(command: Command):
    _skirt(Path("skirt.obj"), texture=False)
    narrow = ("fit", "skirt.obj", "--units", "m", *ON, "--to", "EU 36", "--ease", "hip=-10cm", "--out", "narrow", *BARE)
    ended = command(*narrow)
    (entry,) = json.loads(Path("narrow/fit.json").read_text(encoding="utf-8"))["bodies"]
    assert any("of the cloth lies within EU 36" in note for note in entry["notes"])
    assert "note: " not in ended.err


def test_scans_of_one_name_are_told_apart_and_none_is_replaced(command: Command):
    model = BodyModel.load()
    person = mean_person(model)
    _skirt(Path("skirt.obj"))
    files = [Path(folder, "skirt.body.obj") for folder in "ab"]
    for file in files:
        file.parent.mkdir()
        trimesh.Trimesh(model.vertices(person), model.triangles, process=False).export(file)
    asked = ("fit", "skirt.obj", "--units", "m", *ON, *BARE, "--to", str(files[0]))
    assert command(*asked, "--to", str(files[1]), "--out", "study").code in (0, 1)
    bodies = json.loads(Path("study/fit.json").read_text(encoding="utf-8"))["bodies"]
    assert [(each["body"], each["folder"]) for each in bodies] == [
        ("skirt.body", "study/skirt.body"),
        ("skirt.body 2", "study/skirt.body_2"),
    ]
    assert "skirt.body.obj" in command(*asked, "--out", "a").refusal


def test_without_its_body_one_is_fitted_inside(tmp_path: Path):
    _skirt(tmp_path / "skirt.obj", unit=0.01)
    job = read_job(tmp_path / "skirt.obj", units="cm")
    assert "was fitted inside" in job.notes[0]
    carried = job.to("EU 42", {})
    assert carried.kept()[1]
    assert carried.vertices.shape == job.raw.vertices.shape
    # What its cloth cannot bear is told beside an ease that is kept.
    for fits, word in ((True, "yes"), (False, "no")):
        verdict = {"fits": fits, "words": f"{'fits' if fits else 'does not fit'} by its strain"}
        piece = {"area_m2": 0.5, "stages": [{"converged": True}], "flipped_faces": 0}
        ended = Fitted(carried=carried, folder=tmp_path, metrics={"pieces": {"front": piece}, "verdict": verdict})
        assert ended.verdict().endswith("; it does not fit by its strain") is not fits
        assert study_table([ended, ended]).splitlines()[1].split()[-1] == word
        assert ended.row()["fits"] is fits
        assert ended.row()["done"]
        assert not replace(ended, metrics={**ended.metrics, "left_out": ["it was not sewn"]}).row()["done"]
    # Whatever the file's unit, the carried mesh is in metres.
    assert np.ptp(carried.vertices[:, 1]) == pytest.approx(0.55, abs=0.1)


@pytest.mark.parametrize(("ahead", "faces"), [(1.0, "+z"), (-1.0, "-z")])
def test_a_body_inside_faces_as_its_garment_does(tmp_path: Path, ahead: float, faces: str):
    rows, count = list[str](), 1
    for name, piece in body_of_size(20.0, "EU 36").form("bodice").pieces.items():
        rows.append(f"o {name}")
        rows += [f"v {x} {y} {z}" for x, y, z in (piece.surface.vertices * [ahead, 1.0, ahead]).tolist()]
        rows += ["f " + " ".join(str(k + count) for k in face if k >= 0) for face in piece.surface.faces.tolist()]
        count += len(piece.surface.vertices)
    (tmp_path / "bodice.obj").write_text("\n".join(rows))
    assert f"which faces {faces};" in read_job(tmp_path / "bodice.obj", units="m").notes[0]


@pytest.mark.parametrize(
    ("front", "faces"), [("+x", (1.0, 0.0, 0.0)), ("-x", (-1.0, 0.0, 0.0)), ("-z", (0.0, 0.0, -1.0))]
)
def test_the_front_is_turned_to_where_a_body_faces(tmp_path: Path, front: str, faces: tuple[float, float, float]):
    _skirt(tmp_path / "skirt.obj")
    job = read_job(tmp_path / "skirt.obj", units="m", front=front)
    assert np.array(faces) @ job.turn == pytest.approx([0.0, 0.0, 1.0])


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ((*ON, "--to", "EU 39"), "--to: size 'EU 39' is in no table"),
        (("--from", "EU 39", "--to", "EU 40"), "--from: size 'EU 39' is in no table"),
        ((*ON, "--to", "gone.obj"), "gone.obj"),
        ((*ON, "--to", "skirt.obj"), "--to: skirt.obj: scan"),
        (("--to", "EU 40", "--to", "EU 40"), "--to: 'EU 40' is given twice"),
        (("--to", "EU 40", "--ease", "waist"), "give a level and a length with its unit"),
        (("--to", "EU 40", "--ease", "waist=4"), "give a level and a length with its unit"),
        (("--to", "EU 40", "--ease", "waist=4e999mm"), "give a level and a length with its unit"),
        (("--to", "EU 40", "--ease", "wiast=4cm"), "did you mean 'waist'?"),
        (("--to", "EU 40", "--ease", "waist=9m"), "ease is from -30 to 400 cm"),
        (("--to", "EU 40", "--ease", "waist=4cm", "--ease", "waist=5cm"), "waist is given twice"),
        (("--from", "EU 36", "--to", "EU 40", "--ease", "bust=4cm"), "it goes around waist, hip"),
        (("--to", "EU 40", "--front", "+w"), "--front: should be"),
        (("--to", "EU 40", "--front", "+y"), "--front '+y'"),
        (("--to", "EU 40", "--seams", "vu"), "--seams: should be"),
        (("--to", "EU 40", "--bands", "strait"), "--bands: should be"),
        (("--to", "EU 40", "--fabric", "tweeed"), "--fabric: unknown fabric 'tweeed'"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(command: Command, options: tuple[str, ...], says: str):
    _skirt(Path("skirt.obj"))
    ended = command("fit", "skirt.obj", "--units", "m", "--out", "out", *BARE, *options)
    assert says in ended.refusal


def test_a_garment_that_lies_elsewhere_is_refused(command: Command):
    _skirt(Path("skirt.obj"), shift=1.0)
    refusal = command("fit", "skirt.obj", "--units", "m", "--from", "EU 36", "--to", "EU 40", *BARE).refusal
    assert "cm off EU 36; give the body on which it was made" in refusal


def test_files_of_others_are_not_replaced(command: Command):
    _skirt(Path("skirt.obj"))
    Path("out").mkdir()
    Path("out/fit.json").write_text("[1, 2]", encoding="utf-8")
    refusal = command(
        "fit", "skirt.obj", "--units", "m", "--from", "EU 36", "--to", "EU 40", "--out", "out", *BARE
    ).refusal
    assert "fit.json: is not of warpflat" in refusal
    Path("out/fit.json").unlink()
    Path("out/fit.csv").write_text("mine", encoding="utf-8")
    with pytest.raises(InputError, match=r"fit\.csv: is not of warpflat"):
        refuse_to_replace_others(Path("out"), STUDY_FILES)


def test_ease_is_read_with_its_unit():
    assert ease_wishes(["waist=40mm", " hip = 5 cm ", "bust=-1in"]) == pytest.approx(
        {"waist": 0.04, "hip": 0.05, "bust": -0.0254}
    )


def test_a_garment_ends_as_its_wearer_sits_where_the_pose_is_kept(command: Command):
    model = BodyModel.load()
    bend = np.zeros((len(model.joints), 3))
    for side, sign in (("L", 1.0), ("R", -1.0)):
        bend[model.joints.index(f"upperleg01.{side}")] = -1.5, 0.2 * sign, 0.0
        bend[model.joints.index(f"lowerleg01.{side}")] = 1.4, 0.0, 0.0
    mean = np.zeros(len(model.shapes))
    person = Person(shape=mean, bend=rotation(bend), turn=np.eye(3), scale=1.7, place=np.zeros(3))
    matrix, triangles = finer_body()
    trimesh.Trimesh(matrix @ model.vertices(person), triangles, process=False).export("rider.obj")
    _skirt(Path("skirt.obj"))
    ended = command("fit", "skirt.obj", "--units", "m", *ON, "--to", "rider.obj", "--out", "none", *BARE)
    assert ended.code == 2
    assert "a standing body" in ended.err
    ended = command("fit", "skirt.obj", "--units", "m", *ON, "--to", "EU 42", "--keep-pose", "--out", "none", *BARE)
    assert ended.code == 2
    assert "'EU 42' is a size, which stands" in ended.err
    job = read_job(Path("skirt.obj"), units="m", body="EU 36")
    stands, sits = job.to("EU 36", {}), job.to("rider.obj", {}, keep_pose=True)
    # The hem of a skirt to the thigh goes ahead with the thighs; the ease is that of the body standing.
    hem = stands.vertices[:, 1] < stands.vertices[:, 1].min() + 0.02
    assert sits.vertices[hem, 2].mean() > stands.vertices[hem, 2].mean() + 0.2
    assert sits.kept()[1]
    body = Mesh(sits.skin, triangles)
    assert np.median(np.linalg.norm(body.closest(sits.vertices)[2] - sits.vertices, axis=1)) < 0.06
    # A seam that is level on the standing skirt goes with its cloth: as long there as the threads that it crosses, and level no more.
    middle = 0.5 * float(job.layers[0][0][:, 1].min() + job.layers[0][0][:, 1].max())
    cuts = [{"name": "half", "plane": {"point": [0.0, middle, 0.0], "normal": [0.0, 1.0, 0.0]}}]
    (there,), (same,) = (
        carry_cuts(job, on, cuts) for on in (sits, replace(sits, vertices=job.raw.vertices * job.scale))
    )
    assert there["name"] == "half"
    assert there["closed"]
    assert np.ptp(np.array(same["line"])[:, 1]) < 1e-9
    cloth = Mesh(sits.vertices, job.layers[0][1])
    line = np.array(there["line"])
    assert np.linalg.norm(cloth.closest(line)[2] - line, axis=1).max() < 1e-4
    assert np.ptp(line[:, 1]) > 0.02
    # An upright plane meets front and back, and cuts but the nearest if asked to.
    upright = {"point": [0.0, middle, 1.0], "normal": [1.0, 0.0, 0.0]}
    assert len(carry_cuts(job, sits, [{"plane": upright}])) == 2
    (front,) = carry_cuts(job, sits, [{"plane": {**upright, "nearest": True}}])
    assert np.array(front["line"])[:, 2].mean() > sits.vertices[:, 2].mean()
    (drawn,) = carry_cuts(job, sits, [{"points": same["line"][:2]}])
    np.testing.assert_allclose(drawn["points"], there["line"][:2], atol=1e-9)
    with pytest.raises(InputError, match="the plane misses the garment"):
        carry_cuts(job, sits, [{"plane": {"point": [0.0, 9.0, 0.0], "normal": [0.0, 1.0, 0.0]}}])
    ended = command(
        "fit", "skirt.obj", "--units", "m", *ON, "--to", "EU 42", "--cut-seam", "marked", "--out", "none", *BARE
    )
    assert ended.code == 2
    assert "what is carried is drawn by points:" in ended.err
