from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from warpflat.app.cli.main import main
from warpflat.app.scene.load import make_scene
from warpflat.app.scene.run import run_scene
from warpflat.core.errors import InputError
from warpflat.pattern.export.pattern_json import read_pattern_json

pxr = pytest.importorskip("pxr")

BODICE = {"datum": "centre", "fabric": "woven", "surface": {"shape": "bodice", "resolution": 17}}
QUIET = {"output": {"frames": 0, "picture": False}}
Run = Callable[..., tuple[int, str, str]]


def scene(**tables: object):
    return make_scene({**BODICE, **tables}, name="trial", folder=Path(), where="trial.toml")


def test_a_scene_cuts_along_lines_points_and_planes(tmp_path: Path):
    cuts = [
        {"line": "bust", "part": [0.0, 0.3], "tip_back": 0.02},
        {"name": "slant", "from": [0.16, 0.20, 0.02], "to": [0.08, 0.26, 0.14]},
        {
            "name": "down",
            "plane": {"point": [-0.06, 0.12, 0.08], "normal": [1.0, 0.0, 0.0], "towards": [0.0, -1.0, 0.0]},
        },
    ]
    coarse = {"residual_tolerance": 0.03, "energy_tolerance": 1e-5}
    result = run_scene(scene(cuts=cuts, relax=coarse, **QUIET), tmp_path)
    piece = result.metrics["pieces"]["trial"]
    assert [stage["name"] for stage in piece["stages"] if stage["name"] != "steps"] == [
        "develop",
        "relax",
        "cut:bust",
        "cut:slant",
        "cut:down",
        "sew",
    ]
    energy = [stage["model_energy_j"] for stage in piece["stages"] if stage["name"].startswith(("relax", "cut:"))]
    assert energy == sorted(energy, reverse=True)
    assert piece["flipped_faces"] == 0
    # The slanted path begins a little inside the border: a fish-eye dart.
    assert [made["seams"][0]["kind"] for made in piece["cuts"]] == ["dart", "fish-eye", "dart"]
    assert json.loads((tmp_path / "metrics.json").read_text())["pieces"]["trial"]["cuts"][0]["name"] == "bust"


def test_a_fish_eye_cut_that_overlaps_gives_a_note_and_no_pattern(tmp_path: Path):
    cuts = [{"name": "w", "line": "centre", "part": [0.4, 0.9]}]
    result = run_scene(scene(cuts=cuts, **QUIET), tmp_path)
    (seam,) = result.metrics["pieces"]["trial"]["cuts"][0]["seams"]
    assert seam["kind"] == "fish-eye"
    assert seam["angle_deg"] < 0
    assert seam["intake_m"] == -seam["opening_m"] < 0
    assert "overlaps" in seam["drawn"]["not_drawn"]
    assert any("no pattern was drawn" in note and "dart 'w' overlaps" in note for note in result.notes)
    assert not (tmp_path / "trial.svg").exists()


@pytest.mark.parametrize(
    "path",
    [
        {"from": [0.131, 0.45, 0.073], "to": [0.11, 0.28, 0.136]},
        {"plane": {"point": [-0.11, 0.28, 0.13], "normal": [1.0, 0.0, 0.0], "towards": [0.0, 1.0, 0.0]}},
    ],
)
def test_the_paths_of_the_documentation_open_as_darts(path: dict[str, object], tmp_path: Path):
    result = run_scene(scene(cuts=[{"name": "slant", **path}], **QUIET), tmp_path)
    (seam,) = result.metrics["pieces"]["trial"]["cuts"][0]["seams"]
    assert seam["kind"] == "dart"
    assert seam["intake_m"] > 0.1
    assert (tmp_path / "trial.svg").exists()


@pytest.mark.parametrize(
    ("shape", "table", "curved"),
    [
        ("bodice", {"line": "bust", "part": [0.0, 0.27]}, False),
        ("bodice", {"from": [-0.0823, 0.0, 0.0908], "to": [-0.1117, 0.28, 0.1357]}, True),
        ("saddle", {"line": "centre", "part": [0.2, 0.8]}, None),
    ],
    ids=["folded", "cut away", "fish-eye"],
)
def test_the_pattern_draws_darts_as_they_are_measured_with_their_tips_moved_back(
    shape: str, table: dict[str, object], curved: bool | None, tmp_path: Path
):
    back = 0.02
    surface = {"shape": shape, "resolution": 33}
    pattern = {"allowance_mm": 12.0, "allowances_mm": {} if curved is None else {"d.left": 8.0}}
    made = scene(surface=surface, cuts=[{"name": "d", "tip_back": back, **table}], pattern=pattern, **QUIET)
    (seam,) = run_scene(made, tmp_path).metrics["pieces"]["trial"]["cuts"][0]["seams"]
    (piece,) = json.loads((tmp_path / "pattern.json").read_text())["sizes"][""].values()
    drawn, measured = [np.array(hole["at"]) for hole in piece["drill_holes"]], seam["drawn"]
    assert measured["tip_back_m"] == back
    if curved is None:
        assert np.linalg.norm(drawn[1] - drawn[0]) == pytest.approx(seam["tip_to_tip_m"] - 2 * back, abs=5e-4)
        (sides,) = piece["fisheye_darts"].values()
        assert np.ptp(np.array(sides), axis=0)[0] == pytest.approx(measured["intake_m"], rel=0.05)
        return
    (dart,) = piece["darts"]
    assert measured["curved"] is curved
    assert (dart["fold"] is None) is curved
    widths = {edge["name"]: edge["allowance"] for edge in piece["edges"] if edge["kind"] == "dart"}
    assert widths == ({"d.left": 0.008, "d.right": 0.012} if curved else {"d.left": 0.0, "d.right": 0.0})
    assert dart["length_mm"] == pytest.approx([1e3 * measured["leg_m"]] * 2, abs=1.0)
    assert abs(dart["length_mm"][0] - dart["length_mm"][1]) < 0.5
    assert dart["opening"] == pytest.approx(measured["intake_m"], abs=1e-3)
    # By the distances from the leg's end: the pattern lies in a frame of its own.
    mouth = np.array(next(edge["line"][0] for edge in piece["edges"] if edge["name"] == "d.left"))
    points = np.array(measured["points_m"])
    assert np.linalg.norm(drawn[0] - mouth) == pytest.approx(np.linalg.norm(points[1] - points[0]), abs=3e-3)


@pytest.mark.parametrize(
    ("part", "tip_back", "room"),
    [([0.0, 0.27], 0.2, "cut's length, "), ([0.2, 0.6], 0.12, "cut's half, ")],
    ids=["dart", "fish-eye"],
)
def test_a_tip_moved_back_by_more_than_the_cut_is_refused_at_once(
    part: list[float], tip_back: float, room: str, tmp_path: Path
):
    cuts = [{"name": "d", "line": "bust", "part": part, "tip_back": tip_back}]
    with pytest.raises(InputError, match=rf"cuts\[0\]: tip_back is {1e3 * tip_back:.1f} mm; .* less than the {room}"):
        run_scene(scene(cuts=cuts, **QUIET), tmp_path, on_progress=lambda at: pytest.fail("it was relaxed"))


def test_a_tip_moved_back_too_far_for_the_dart_as_it_lies_is_a_note(tmp_path: Path):
    cuts = [{"name": "d", "line": "bust", "part": [0.0, 0.27], "tip_back": 0.142}]
    result = run_scene(scene(cuts=cuts, **QUIET), tmp_path)
    assert any("dart 'd': tip_back is 142.0 mm; it must be 0 or more and less than" in note for note in result.notes)


@pytest.mark.parametrize(
    ("cuts", "at"), [([], None), ([{"name": "x", "from": 6, "to": 54}], 6)], ids=["nearest", "cut"]
)
def test_a_tube_is_cut_open_where_its_borders_are_nearest_or_along_a_cut(
    cuts: list[dict[str, object]], at: int | None, tmp_path: Path
):
    rim = [(0.05 * np.cos(a), 0.05 * np.sin(a)) for a in np.linspace(0.0, 2 * np.pi, 24, endpoint=False)]
    lines = [f"v {x} {0.1 * row * (1.0 - 4.0 * x)} {z}" for row in range(3) for x, z in rim]
    lines += [
        "f " + " ".join(str(24 * (row + up) + (k + on) % 24 + 1) for up, on in ((0, 0), (0, 1), (1, 1), (1, 0)))
        for row in range(2)
        for k in range(24)
    ]
    (tmp_path / "tube.obj").write_text("\n".join(lines))
    data = {"surface": {"file": str(tmp_path / "tube.obj"), "units": "m"}, "cuts": cuts, **QUIET}
    made = make_scene(data, name="tube", folder=tmp_path, where="tube.toml")
    result = run_scene(made, tmp_path / "out")
    assert any("a tube, cut open where its borders are nearest, 16.0 cm" in note for note in result.notes) == (not cuts)
    piece = result.metrics["pieces"]["tube"]
    assert piece["converged"]
    assert piece["length_error"] < 1e-3
    pattern = read_pattern_json(tmp_path / "out" / "pattern.json")
    (seam,) = pattern.seams
    assert seam.name == ("x" if cuts else "opening")
    height = 0.2 if cuts else 0.16
    assert seam.length_mm == pytest.approx((1e3 * height, 1e3 * height), rel=1e-6)


def test_a_cut_that_does_not_open_is_a_line_of_a_whole_pattern(tmp_path: Path):
    """A placket in flat cloth, from the border, and a slit inside."""
    flat = {"surface": {"shape": "cone", "resolution": 17}} | QUIET
    lay = run_scene(make_scene(flat, name="flat", folder=tmp_path, where="flat.toml"), tmp_path / "whole")
    whole = read_pattern_json(tmp_path / "whole" / "pattern.json").pieces[""][0]
    assert lay.metrics["pieces"]["flat"]["strain_energy_j"] < 1e-9
    for name, part in (("placket", [0.0, 0.5]), ("slit", [0.25, 0.75])):
        cuts = [{"name": name, "line": "centre", "part": part}]
        made = make_scene({**flat, "cuts": cuts}, name="flat", folder=tmp_path, where="flat.toml")
        result = run_scene(made, tmp_path / name)
        assert any(f"cut '{name}' opens by less than 0.1 mm" in note for note in result.notes)
        drawn = read_pattern_json(tmp_path / name / "pattern.json").pieces[""][0]
        assert {edge.kind for edge in drawn.edges} == {"seam"}
        assert not drawn.darts
        assert not drawn.fisheyes
        assert sum(e.length for e in drawn.edges) == pytest.approx(sum(e.length for e in whole.edges), rel=1e-4)
        assert name in drawn.internal_lines


def test_a_plane_all_through_may_be_given_by_any_of_its_points(tmp_path: Path):
    from warpflat.app.scene.plan import scene_cuts

    def paths(point: list[float], **more: object):
        plane = {"point": point, "normal": [0.0, 1.0, 0.0], **more}
        sequence = scene_cuts(scene(cuts=[{"name": "waist", "plane": plane}]))
        return sequence.surface.vertices[sequence.plans[0].paths[0]]

    inside, far = paths([0.0, 0.1, 0.0]), paths([0.0, 0.1, -7.0])
    np.testing.assert_array_equal(inside, far)
    np.testing.assert_allclose(inside[:, 1], 0.1, atol=1e-9)
    with pytest.raises(InputError, match=r"cuts\[0\]: the plane does not cut the piece 'trial'"):
        paths([0.0, 5.0, 0.0])
    with pytest.raises(InputError, match=r"cuts\[0\]: the point .* off the piece"):
        paths([0.0, 0.1, -7.0], towards=[1.0, 0.0, 0.0])


def test_one_film_tells_the_whole_story(tmp_path: Path):
    from pxr import Usd, UsdGeom
    from usd_validation import validate_usd

    cuts = [{"name": "bust", "line": "bust", "part": [0.0, 0.3]}, {"name": "bust", "line": "bust", "part": [1.0, 0.7]}]
    run_scene(scene(cuts=cuts, output={"frames": 12, "picture": False}), tmp_path)
    film = tmp_path / "frames.usdc"
    assert list(validate_usd(film)) == []
    stage = Usd.Stage.Open(str(film))
    pattern = UsdGeom.Mesh(stage.GetPrimAtPath("/World/trial/trial_pattern"))
    times = range(int(stage.GetStartTimeCode()), int(stage.GetEndTimeCode()) + 1)
    counts = [len(pattern.GetPointsAttr().Get(time)) for time in times]
    changes = np.flatnonzero(np.diff(counts))
    assert len(changes) == 1, "the topology changes once"
    assert counts[0] == 17 * 17 < counts[-1]
    assert len(pattern.GetFaceVertexIndicesAttr().GetTimeSamples()) >= 2
    before, after = times[changes[0]], times[changes[0] + 1]
    root = stage.GetPrimAtPath("/World/trial/trial_pattern_cuts")
    (lines,) = [UsdGeom.BasisCurves(prim) for prim in Usd.PrimRange(root) if prim.IsA(UsdGeom.BasisCurves)]
    # The line is drawn before the scissors come: one curve a side, then both sides of each crack.
    assert len(lines.GetCurveVertexCountsAttr().Get(before)) == 2
    assert len(lines.GetCurveVertexCountsAttr().Get(after)) == 4
    opened = np.array(pattern.GetPointsAttr().Get(times[-1]))
    closed = np.array(pattern.GetPointsAttr().Get(after))
    assert np.linalg.norm(opened - closed, axis=1).max() > 0.02


def test_a_cut_from_border_to_border_gives_two_pieces_with_files_of_their_own(tmp_path: Path):
    some = {"max_steps": 500}
    result = run_scene(scene(cuts=[{"line": "centre"}], relax=some, output={"frames": 0}), tmp_path)
    assert set(result.metrics["pieces"]) == {"trial.left", "trial.right"}
    assert {"trial.left.obj", "trial.right.obj", "picture.png"} <= set(result.files)


def test_auto_cut_finds_cuts_and_stops(tmp_path: Path):
    found = run_scene(scene(auto_cut={"max_cuts": 1, "by": "per_cm"}, **QUIET), tmp_path / "one")
    stages = found.metrics["pieces"]["trial"]["stages"]
    assert [stage["name"] for stage in stages[:3]] == ["develop", "steps", "relax"]
    assert len(stages) == 7
    assert any(note.startswith("cuts found: ") for note in found.notes)
    enough = stages[2]["model_energy_j"] + 0.01
    # The same cut is drawn into the mesh, and not made.
    settings = {"max_cuts": 1, "by": "per_cm", "stop_below": enough}
    none = run_scene(scene(auto_cut=settings, **QUIET), tmp_path / "none")
    assert len(none.metrics["pieces"]["trial"]["stages"]) == 3


def test_auto_cut_leaves_a_piece_whole_where_there_is_nothing_to_cut_and_says_why(tmp_path: Path):
    flat = {"surface": {"shape": "cylinder", "resolution": 9}, "datum": "centre"}
    result = run_scene(scene(auto_cut={}, **flat, **QUIET), tmp_path)
    assert not result.metrics["pieces"]["trial"]["cuts"]
    (note,) = (note for note in result.notes if note.startswith("no cut was found"))
    assert note.endswith("stores no strain energy inside: there is nothing to cut for")
    assert "trial.svg" in result.files


@pytest.mark.parametrize(
    ("cuts", "message"),
    [
        ([{"line": "burst"}], r"trial.toml: cuts\[0\]: .*no line 'burst'.*did you mean 'bust'"),
        ([{"from": 40, "to": 40}], r"cuts\[0\]: .*vertex 40"),
        ([{"line": "bust"}, {"name": "b", "line": "bust"}], "is cut by two paths"),
    ],
)
def test_a_wrong_cut_is_told_in_one_line(tmp_path: Path, cuts: list[dict[str, object]], message: str):
    with pytest.raises(InputError, match=message) as caught:
        run_scene(scene(cuts=cuts, **QUIET), tmp_path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("cuts", "message"),
    [
        ([{}], r"cuts\[0\]: give the cut in one way"),
        ([{"line": "bust", "from": 1, "to": 2}], "give the cut in one way"),
        ([{"from": 1}], "needs both from and to"),
        ([{"from": 1, "to": 2, "part": [0.0, 0.5]}], "part takes a part of a line"),
        ([{"line": "bust", "tip": 1.0}], "unknown key 'tip'"),
    ],
)
def test_a_wrong_table_is_told_in_one_line(cuts: list[dict[str, object]], message: str):
    with pytest.raises(InputError, match=message):
        scene(cuts=cuts)


def test_the_command_compares_cuts_and_applies_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
):
    monkeypatch.chdir(tmp_path)
    Path("b.toml").write_text(
        'datum = "centre"\nfabric = "woven"\n[surface]\nshape = "bodice"\nresolution = 9\n'
        "[output]\nframes = 0\npicture = false\n"
    )
    assert main(["cuts", "b.toml"]) == 0
    table = capfd.readouterr().out
    assert "peak 1: " in table
    assert "bust" in table
    ledger = json.loads(Path("out/b/ledger.json").read_text())
    assert len(ledger["entries"]) > 2
    assert Path("out/b/ledger.png").stat().st_size > 10_000
    assert not Path("out/b/metrics.json").exists()
    assert main(["cuts", "b.toml", "--apply", "1", "--quiet"]) == 0
    piece = json.loads(Path("out/b/metrics.json").read_text())["pieces"]["b"]
    assert [stage["name"] for stage in piece["stages"] if stage["name"] != "steps"][
        -2
    ] == f"cut:{ledger['entries'][0]['name']}"
    assert main(["cuts", "b.toml", "--apply", "99"]) == 2
    assert "there is no candidate 99; valid: 1 to" in capfd.readouterr().err


def test_a_cut_across_the_mesh_has_smooth_legs_near_the_mesh(tmp_path: Path):
    """The shorter leg, which is to be longer, would else take up the length in teeth."""
    dart = {"name": "a", "from": [0.17, 0.20, 0.0], "to": [0.08, 0.26, 0.14]}
    result = run_scene(scene(surface={"shape": "bodice", "resolution": 41}, cuts=[dart], **QUIET), tmp_path)
    assert [note for note in result.notes if "stays ragged" in note] == []
    (piece,) = read_pattern_json(tmp_path / "pattern.json").pieces[""]
    left, right = piece.edge("a.left"), piece.edge("a.right")
    assert left.length == pytest.approx(right.length, abs=2e-4)
    assert max(left.fit_error, right.fit_error) < 1.5e-3
    assert max(len(left.curve.bezier), len(right.curve.bezier)) < 12
