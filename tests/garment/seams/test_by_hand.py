"""Seams that the user draws are made as they are drawn, in any order; what is still a tube is opened where it serves the garment."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from itertools import pairwise, permutations
from pathlib import Path

import numpy as np
import pytest
import seam_solids as solids
import trimesh
from obj_files import write_obj

import warpflat
from warpflat.app.cli.main import main
from warpflat.flat.surface.connectivity import border_loops, euler_characteristic
from warpflat.flat.surface.mesh import Surface
from warpflat.garment.construction.sew_pieces import meeting_borders, unsewn_borders
from warpflat.garment.seams.find import FoundSeams
from warpflat.garment.seams.layers import read_garment

skirt, trousers = cache(solids.skirt), cache(solids.trousers)

RISE = warpflat.SeamCut(name="rise", plane=((0, 0, 0), (1, 0, 0)))
HIP = warpflat.SeamCut(name="hip", plane=((0, 0.4, 0), (0, 1, 0)))
GORE = warpflat.SeamCut(name="gore", points=((0.0, 0.0, 0.2), (0.08, 0.6, 0.1187)))


@cache
def shirt() -> Surface:
    return solids.shirt(step=0.035)


@cache
def cut(surface: Surface, *cuts: warpflat.SeamCut, find: str = "none", **options: object) -> FoundSeams:
    """A garment cut by hand, each once in a process."""
    return warpflat.find_seams(surface, warpflat.SeamOptions(find=find, cuts=cuts, **options))  # type: ignore[arg-type]


def length(points: np.ndarray) -> float:
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


def lengths(found: FoundSeams) -> dict[str, float]:
    return {seam.name: seam.length for seam in found.seams}


def test_a_plane_cuts_where_it_meets_the_garment_and_legs_are_opened_at_the_inseam() -> None:
    found = cut(trousers(), RISE)
    assert len(found.pieces) == 2
    assert set(lengths(found)) == {"rise", "inseam left", "inseam right"}
    for piece in found.pieces:
        inseam = piece.vertices[piece.lines["inseam"]]
        # On the inner side of the leg, from the crotch to the hem, both sides of it in one piece.
        assert np.abs(inseam[:, 0]).max() < 0.14
        assert np.ptp(inseam[:, 1]) > 0.4


def test_half_a_plane_cuts_one_side() -> None:
    found = cut(skirt(), warpflat.SeamCut(plane=((0, 0, 0), (1, 0, 0)), towards=(0, 0, -1)))
    (piece,) = found.pieces
    ((name, seam),) = lengths(found).items()
    assert name == "cut"
    assert seam == pytest.approx(np.hypot(0.6, 0.6 * 0.13), rel=1e-6)
    assert piece.vertices[piece.lines["cut"]][:, 2].max() < 0.0
    both = cut(skirt(), warpflat.SeamCut(plane=((0, 0, 0), (1, 0, 0))))
    assert len(both.pieces) == 2
    one = cut(skirt(), warpflat.SeamCut(plane=((0, 0, 0.2), (1, 0, 0)), nearest=True))
    assert one.pieces[0].vertices[one.pieces[0].lines["cut"]][:, 2].min() > 0.0


def test_what_is_still_a_tube_is_opened_at_centre_back_and_not_across_a_cut() -> None:
    found = cut(skirt(), HIP)
    assert set(lengths(found)) == {"hip", "centre back", "centre back 2"}
    for piece in found.pieces:
        line = next(line for name, line in piece.lines.items() if name.startswith("centre back"))
        assert piece.vertices[line][:, 2].max() < 0.0
    # Where the centre back is to stay closed, the next line serves.
    closed = cut(skirt(), HIP, no=("centre back",))
    assert {"centre front", "centre front 2"} < set(lengths(closed))


def test_sleeves_cut_off_by_hand_are_opened_at_the_underarm() -> None:
    plain = cut(shirt(), find="auto")
    found = cut(shirt(), *SLEEVES, find="auto")
    assert {"front", "back", "left_sleeve", "right_sleeve"} == {piece.name for piece in found.pieces}
    assert set(lengths(plain)) - set(lengths(found)) == {"armhole left", "armhole right"}
    # A side seam of one's own, 3 cm further in front, takes the place of the tailor's.
    side = warpflat.SeamCut(name="side seam", points=((0.17, 0.0, 0.03), (0.165, 0.3, 0.03), (0.2, 0.44, 0.03)))
    moved = cut(shirt(), side, find="auto")
    assert set(lengths(plain)) ^ set(lengths(moved)) == {"side left", "side seam"}
    assert "side left is left to what you have drawn" in moved.notes
    # One that goes over the shoulder only takes nothing from a tailor.
    over = warpflat.SeamCut(plane=((0.25, 0.5, 0), (1, 0, 0)), towards=(0, 1, 0))
    assert set(lengths(plain)) < set(lengths(warpflat.find_seams(shirt(), warpflat.SeamOptions(cuts=(over,)))))
    # Drawn alone, they leave a trunk that is opened, too.
    alone = cut(shirt(), *SLEEVES)
    assert {"drawn left", "drawn right", "underarm left", "underarm right"} < set(lengths(alone))
    assert {"left_sleeve", "right_sleeve"} < {piece.name for piece in alone.pieces}


def test_a_cut_through_points_runs_straight_over_the_cloth() -> None:
    ends = GORE.points
    found = cut(skirt(), GORE)
    (piece,) = found.pieces
    line = piece.vertices[piece.lines["gore"]]
    assert length(line) == pytest.approx(lengths(found)["gore"])
    # No way along the border of a cone's development is shorter; a straight line through space is.
    assert np.linalg.norm(np.subtract(*ends)) < length(line) < 1.02 * np.linalg.norm(np.subtract(*ends))
    # A number is a vertex of the file.
    by_number = cut(skirt(), warpflat.SeamCut(name="gore", points=(0, 15 * 40)))
    assert lengths(by_number)["gore"] == pytest.approx(np.hypot(0.6, 0.6 * 0.13), rel=1e-6)


def test_a_drawn_line_is_projected_onto_the_cloth() -> None:
    # A wave in the air, 1 cm in front of a flat skirt's front.
    height = np.linspace(0.0, 0.6, 25)
    wave = [(0.03 * np.sin(10 * y), float(y), 0.21 - 0.13 * y) for y in height]
    found = cut(skirt(), warpflat.SeamCut(name="wave", line=tuple(wave)))
    (piece,) = found.pieces
    line = piece.vertices[piece.lines["wave"]]
    assert np.abs(line[:, 0] - 0.03 * np.sin(10 * line[:, 1])).max() < 4e-3
    assert line[:, 2].min() > 0.1


def test_rows_of_vertices_are_cut_along_their_edges() -> None:
    around = 40
    column = tuple(row * around + 3 for row in range(16))
    whole = cut(skirt(), warpflat.SeamCut(name="gore", edges=(column,)))
    pairs = cut(skirt(), warpflat.SeamCut(name="gore", edges=tuple(pairwise(column[::-1]))))
    assert lengths(whole) == pytest.approx(lengths(pairs))
    assert np.array_equal(whole.pieces[0].vertices, pairs.pieces[0].vertices)


CUTS = (
    warpflat.SeamCut(name="hip", plane=((0, 0.37, 0), (0.1, 1, 0))),
    warpflat.SeamCut(name="front", points=((0.02, 0.0, 0.2), (-0.03, 0.6, 0.12))),
    warpflat.SeamCut(name="side", edges=(tuple(row * 40 + 10 for row in range(16)),)),
    warpflat.SeamCut(name="back", line=((0.05, 0.0, -0.21), (-0.05, 0.3, -0.18), (0.0, 0.6, -0.13))),
)


SLEEVES = [
    warpflat.SeamCut(name=f"drawn {side}", plane=((x, 0.5, 0), (1, 0, 0)), nearest=True)
    for side, x in (("left", 0.25), ("right", -0.25))
]


@pytest.mark.parametrize(
    "made",
    [
        lambda: cut(trousers(), RISE),
        lambda: cut(trousers(), warpflat.SeamCut(plane=((0, 0, 0), (1, 0, 0))), keep=("side",)),
        lambda: cut(skirt(), HIP),
        lambda: cut(skirt(), GORE),
        lambda: cut(skirt(), *CUTS),
        lambda: cut(shirt(), *SLEEVES),
        lambda: cut(shirt(), *SLEEVES, find="auto"),
        lambda: cut(shirt(), find="auto", keep=("waist", "centre back")),
    ],
)
def test_pieces_are_disks_and_all_that_was_cut_is_sewn_again_edge_by_edge(made: Callable[[], FoundSeams]) -> None:
    found = made()
    pieces = {piece.name: piece for piece in found.pieces}
    for piece in pieces.values():
        assert euler_characteristic(piece.faces) == 1
        assert len(border_loops(piece.faces)) == 1
    assert not unsewn_borders(pieces)
    sewn = sum(length(pieces[pair.pieces[0]].vertices[pair.vertices[0]]) for pair in meeting_borders(pieces))
    assert sewn == pytest.approx(sum(seam.length for seam in found.seams), rel=1e-9)


@pytest.mark.parametrize("order", list(permutations(range(4)))[5::5])
def test_the_order_of_cuts_does_not_matter_and_they_may_cross(order: tuple[int, ...]) -> None:
    first, other = cut(skirt(), *CUTS), cut(skirt(), *(CUTS[k] for k in order))
    assert len(first.pieces) == 6
    assert lengths(first) == lengths(other)
    for one, same in zip(first.pieces, other.pieces, strict=True):
        assert np.array_equal(one.vertices, same.vertices)
        assert np.array_equal(one.faces, same.faces)


def test_an_end_that_nearly_reaches_a_seam_is_carried_on_and_one_inside_is_a_dart() -> None:
    hip = warpflat.SeamCut(name="hip", plane=((0, 0.3, 0), (0, 1, 0)))
    short = warpflat.SeamCut(name="front", points=((0.0, 0.004, 0.2), (0.0, 0.293, 0.162)))
    found = cut(skirt(), hip, short)
    assert lengths(found)["front"] == pytest.approx(0.3 * np.hypot(1.0, 0.13), rel=1e-3)
    long = replace(short, points=((0.0, 0.004, 0.2), (0.0, 0.307, 0.16)))
    assert lengths(cut(skirt(), hip, long)) == pytest.approx(lengths(found), rel=1e-3)
    dart = warpflat.SeamCut(name="slit", points=((0.0, 0.0, 0.2), (0.0, 0.2, 0.174)))
    note = next(note for note in cut(skirt(), hip, dart).notes if note.startswith("'slit' ends inside"))
    assert "101 mm from the nearest border or seam: a dart" in note


def test_seams_are_kept_though_no_energy_asks_for_them() -> None:
    plain = cut(shirt(), find="auto")
    kept = cut(shirt(), find="auto", keep=("waist", "centre back"))
    more = set(lengths(kept)) - set(lengths(plain))
    assert more == {"waist", "centre back"}
    waist = next(piece.vertices[piece.lines["waist"]] for piece in kept.pieces if "waist" in piece.lines)
    assert np.ptp(waist[:, 1]) < 1e-3
    nothing = warpflat.find_seams(skirt(), warpflat.SeamOptions(keep=("inseam",)))
    assert "there is no inseam to keep: none was found in what is taken for: skirt" in nothing.notes
    # Alone, beside what is drawn: the tailor's other seams are not made.
    alone = cut(trousers(), warpflat.SeamCut(plane=((0, 0, 0), (1, 0, 0))), keep=("side",))
    assert set(lengths(alone)) == {"cut", "side left", "side right"}


def test_a_waist_is_made_where_the_body_has_it() -> None:
    found = cut(shirt(), find="auto", keep=("waist",), waist=(9.0, 0.31, -9.0))
    waist = next(piece.vertices[piece.lines["waist"]] for piece in found.pieces if "waist" in piece.lines)
    assert waist[:, 1] == pytest.approx(0.31, abs=1e-3)
    with pytest.raises(warpflat.InputError, match=r"waist = \(1.0, inf\) is no place"):
        cut(shirt(), waist=(1.0, float("inf")))


def test_a_body_that_is_none_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    mesh = write_obj(tmp_path / "skirt.obj", skirt())
    for body, words in ((tmp_path / "body.obj", "--body: "), (mesh, "skirt.obj: scan: ")):
        command = ["flatten", str(mesh), "--units", "m", "--seams", "auto", "--body", str(body)]
        assert main([*command, "--out", str(tmp_path / "out")]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert words in line
        assert not (tmp_path / "out").exists()


FAULTS = [
    (warpflat.SeamCut(points=((0, 0, 0.2), (0, 30, 0))), r"cut: the point \(0, 30, 0\) lies 29.4 m off the garment; points are in met"),
    (warpflat.SeamCut(plane=((0, 3, 0), (0, 1, 0))), "cut: the plane misses the garment: along its normal that spans 0 to 0.6 m, and"),
    (warpflat.SeamCut(plane=((0, 0, 0.5), (1, 0, 0)), towards=(0, 0, 1)), "the plane misses the garment in that direction"),
    (warpflat.SeamCut(edges=((0, 1, 999),)), "vertex 999 does not exist; the file has 640, numbered from 0 to 639"),
    (warpflat.SeamCut(edges=((0, 90),)), r"no edge of the mesh joins vertices 0 and 90 \(counted from 0\)"),
    (warpflat.SeamCut(edges=((0, 1, 2),)), "cut: runs along the border or another cut, and parts nothing; draw it across the cloth"),
    (warpflat.SeamCut(points=(0, 0)), "a path needs two different end points"),
    (warpflat.SeamCut(points=(0, 600, 10, 590, 0, 610)), "crosses itself"),
    (warpflat.SeamCut(points=(0,)), "cut: points needs at least 2 places"),
    (warpflat.SeamCut(), "cut: give it in one way: points, line, plane, edges"),
    (warpflat.SeamCut(points=((0, 0, float("nan")), 3)), r"\(0, 0, nan\) is no point; a point is three numbers \[m\]"),
    (warpflat.SeamCut(plane=((0, 0, 0), (0, 0, 0))), r"a direction of \(0, 0, 0\) leads nowhere"),
]  # fmt: skip


@pytest.mark.parametrize(("wrong", "words"), FAULTS)
def test_a_cut_that_cannot_be_made_is_refused_in_one_line(wrong: warpflat.SeamCut, words: str) -> None:
    with pytest.raises(warpflat.InputError, match=words) as caught:
        cut(skirt(), wrong)
    assert "\n" not in str(caught.value)


def test_names_that_no_seam_has_are_refused() -> None:
    with pytest.raises(
        warpflat.InputError, match=r"keep = 'waste': no seam has that name; did you mean 'waist'\? valid: arm"
    ):
        warpflat.find_seams(skirt(), warpflat.SeamOptions(keep=("waste",)))
    with pytest.raises(warpflat.InputError, match="no = 'sides': no seam has that name; did you mean 'side'"):
        warpflat.find_seams(skirt(), warpflat.SeamOptions(no=("sides",)))
    with pytest.raises(warpflat.InputError, match="'side left' is both in keep and in no"):
        warpflat.find_seams(skirt(), warpflat.SeamOptions(no=("side",), keep=("side left",)))


def test_what_no_cut_opens_is_refused() -> None:
    ball = trimesh.creation.icosphere(2, radius=0.1)
    surface = warpflat.make_surface(ball.vertices, ball.faces, closed=True)
    halves = cut(surface, warpflat.SeamCut(plane=((0, 0, 0), (0, 1, 0))))
    assert len(halves.pieces) == 2
    ring = trimesh.creation.torus(0.18, 0.05, major_sections=30, minor_sections=12)
    handle = warpflat.make_surface(ring.vertices, ring.faces, closed=True)
    with pytest.raises(warpflat.InputError, match="what the cuts leave is closed"):
        cut(handle, keep=("waist",))


def test_the_two_sides_of_every_cut_are_equally_long_in_the_pattern(tmp_path: Path) -> None:
    mesh = write_obj(tmp_path / "trousers.obj", trousers())
    arguments = [
        "flatten",
        str(mesh),
        "--units",
        "m",
        "--fabric",
        "woven",
        "--no-picture",
        "--frames",
        "0",
        "--seams",
        "none",
    ]
    assert main([*arguments, "--cut-seam", "rise=plane:0,0,0 1,0,0", "--out", str(tmp_path / "out")]) == 0
    metrics = json.loads((tmp_path / "out" / "metrics.json").read_text())
    assert [seam["name"] for seam in metrics["garment"]["found_seams"]] == ["rise", "inseam right", "inseam left"]
    assert len(metrics["seams"]) >= 3
    pattern = warpflat.read_pattern_json(tmp_path / "out" / "pattern.json")
    (pieces,) = pattern.pieces.values()
    for seam in metrics["seams"]:
        assert abs(seam["difference_mm"]) < 0.02
    assert len(pieces) == 2


def test_marked_edges_lines_and_files_of_edges_are_cut(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    column = [row * 40 + 3 for row in range(16)]
    element = "l " + " ".join(str(vertex + 1) for vertex in column)
    mesh = write_obj(tmp_path / "skirt.obj", skirt(), more=("g gore", element))
    (mark,) = read_garment(mesh, units="m").marks
    assert (mark.name, mark.edges) == ("gore", (tuple(column),))
    (tmp_path / "rows.txt").write_text("# the side\n" + " ".join(map(str, column)) + "\n", encoding="utf-8")
    (tmp_path / "rows.json").write_text(json.dumps(list(pairwise(column))), encoding="utf-8")
    seams = []
    for number, way in enumerate(
        ("marked", "line:gore", f"edges:{tmp_path}/rows.txt", f"gore=edges:{tmp_path}/rows.json")
    ):
        out = tmp_path / str(number)
        plain = ["--units", "m", "--no-picture", "--frames", "0", "--seams", "none", "--max-steps", "300"]
        assert main(["flatten", str(mesh), *plain, "--cut-seam", way, "--out", str(out)]) == 0
        (seam,) = json.loads((out / "metrics.json").read_text())["garment"]["found_seams"]
        seams.append(seam["length_m"])
    assert len(set(seams)) == 1
    for text, words in (
        (
            "3 4\n5\n",
            "line 2: '5' is no row of vertices; give the numbers of two vertices or more, from 0, as 12 13 14",
        ),
        ("[[1, 2], [3, -4]]", "row 2: [3, -4] is no row of vertices"),
        ("# none\n", "holds no rows of vertices"),
        ("[[[[", "cannot be read as a list of edges"),
    ):
        (tmp_path / "rows.txt").write_text(text, encoding="utf-8")
        capsys.readouterr()
        assert main(["flatten", str(mesh), "--units", "m", "--cut-seam", f"edges:{tmp_path}/rows.txt"]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert f"rows.txt: {words}" in line


@pytest.mark.parametrize(
    ("way", "words"),
    [
        ("plain:0,0,0", "--cut-seam 'plain:0,0,0': give points:, line:, plane:, edges:FILE or marked"),
        ("points:0,0 1,1,1", "--cut-seam 'points:0,0 1,1,1': '0,0' is no place; give X,Y,Z in metres, or the number of a vertex"),
        ("plane:0,0,0", "a plane is a point and a normal, and perhaps a direction; got 1 places"),
        ("line:gore", "--cut-seam 'line:gore': the file has no line 'gore'; valid: none"),
        ("marked", "the file has no lines and no creases"),
        ("plane:0,9,0 0,1,0", "--cut-seam 'plane:0,9,0 0,1,0': the plane misses the garment"),
        ("points:0,0,0.2", "--cut-seam 'points:0,0,0.2'"),
    ],
)  # fmt: skip
def test_the_command_refuses_what_is_no_seam(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], way: str, words: str
) -> None:
    mesh = write_obj(tmp_path / "skirt.obj", skirt())
    assert main(["flatten", str(mesh), "--units", "m", "--cut-seam", way, "--out", str(tmp_path / "out")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert words in line
    assert not (tmp_path / "out").exists()


def test_a_sleeve_above_a_cuff_is_told_by_its_armhole_and_has_its_grain_along_the_arm() -> None:
    surface = solids.shirt()
    wrist = float(surface.vertices[:, 0].max())
    planes = {"armhole": 0.2, "cuff": wrist - 0.05}
    drawn = [
        warpflat.SeamCut(name=f"{name} {side}", plane=((sign * x, 0.5, 0), (1, 0, 0)), nearest=True)
        for name, x in planes.items()
        for side, sign in (("left", 1), ("right", -1))
    ]
    rib = warpflat.SeamCut(name="rib", plane=((0, 0.05, 0), (0, 1, 0)))
    found = cut(surface, *drawn, rib)
    pieces = {piece.name: piece for piece in found.pieces}
    assert {"left_sleeve", "right_sleeve", "left_cuff", "right_cuff", "hem_band"} <= set(pieces)
    for name in ("left_sleeve", "right_sleeve"):
        grain = pieces[name].vertices[pieces[name].lines["grain"][[0, -1]]]
        along = (grain[1] - grain[0]) / np.linalg.norm(grain[1] - grain[0])
        assert abs(along[0]) > 0.98
