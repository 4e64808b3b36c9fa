"""Sheets come out of solids: of cloth with thickness the outer one, of fins and pockets each its own; what is lost is told."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from obj_files import write_obj
from surface_meshes import quads_between

import warpflat
from warpflat.app.cli.main import main
from warpflat.flat.surface.connectivity import border_loops, euler_characteristic
from warpflat.flat.surface.repair.validate import make_surface
from warpflat.garment.seams.layers import read_garment


def solidified(
    vertices: np.ndarray, quads: np.ndarray, thickness: float, *, rim: bool = True
) -> tuple[np.ndarray, list[list[int]]]:
    """A sheet with thickness to its inner side, as Blender's Solidify makes it: outer faces first, then inner ones and the rim."""
    a, b, c, d = (vertices[quads[:, k]] for k in range(4))
    normal = np.zeros_like(vertices)
    for k in range(4):
        np.add.at(normal, quads[:, k], np.cross(c - a, d - b))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    count = len(vertices)
    sides = {(int(q[k]), int(q[(k + 1) % 4])): None for q in quads for k in range(4)}
    open_sides = [side for side in sides if side[::-1] not in sides] if rim else []
    faces = [*quads.tolist(), *(quads[:, ::-1] + count).tolist()]
    faces += [[b, a, a + count, b + count] for a, b in open_sides]
    return np.vstack([vertices, vertices - thickness * normal]), faces


def bodice(columns: int = 21, rows: int = 26) -> tuple[np.ndarray, np.ndarray]:
    """A front that bulges, wound to the outside (+z)."""
    u, v = (axis.ravel() for axis in np.meshgrid(np.linspace(-1, 1, columns), np.linspace(0, 1, rows)))
    points = np.stack([0.2 * u, 0.5 * v, 0.12 * (1 - u**2) + 0.03 * np.sin(np.pi * v)], axis=-1)
    return points, quads_between((rows, columns))


def sleeve(around: int = 24, rows: int = 21) -> tuple[np.ndarray, np.ndarray]:
    turn, height = 2 * np.pi * np.arange(around) / around, np.linspace(0, 0.5, rows)
    radius = 0.07 - 0.03 * height
    points = np.stack(
        [radius[:, None] * np.cos(turn), np.repeat(height[:, None], around, 1), radius[:, None] * np.sin(turn)], -1
    ).reshape(-1, 3)
    at = np.arange(rows * around).reshape(rows, around)
    return points, np.stack([at[:-1], at[1:], np.roll(at, -1, 1)[1:], np.roll(at, -1, 1)[:-1]], -1).reshape(-1, 4)


@pytest.mark.parametrize("thickness", [0.0005, 0.002, 0.006])
@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize(("sheet", "loops"), [(bodice, 1), (sleeve, 2)])
def test_the_outer_sheet_of_thick_cloth_is_taken(sheet, loops: int, turned: bool, thickness: float) -> None:
    points, quads = sheet()
    vertices, faces = solidified(points, quads, thickness)
    rng = np.random.default_rng(7)
    order = rng.permutation(len(faces))
    faces = [faces[k][::-1] if turned else faces[k] for k in order]
    surface = make_surface(vertices, faces)
    assert len(surface.faces) == len(quads)
    assert len(border_loops(surface.faces)) == loops
    # The outer vertices are the first ones.
    assert surface.input_index.max() < len(points)
    note = next(note for note in surface.notes if "thick" in note)
    told = re.search(r"([\d.]+) mm thick.*\(([\d,]+) cm2\)", note)
    assert told is not None
    assert float(told[1]) == pytest.approx(1e3 * thickness, rel=0.03)
    area = {bodice: 2300, sleeve: 1720}[sheet]
    assert float(told[2].replace(",", "")) == pytest.approx(area, rel=0.15)


def test_thick_cloth_of_another_mesh_on_each_side_is_parted(tmp_path: Path) -> None:
    """As of generated meshes: triangles of any shape, the inner side finer than the outer one."""
    points, quads = sleeve(48, 40)
    vertices, faces = solidified(points, quads, 0.003)
    triangles = []
    for number, face in enumerate(faces):
        if len(quads) <= number < 2 * len(quads):  # inner faces into four about their middle
            vertices = np.vstack([vertices, vertices[face].mean(axis=0)])
            triangles += [[face[k], face[(k + 1) % 4], len(vertices) - 1] for k in range(4)]
        else:
            triangles += [face[:3], [face[0], *face[2:]]]
    surface = make_surface(vertices, triangles)
    assert len(border_loops(surface.faces)) == 2
    assert len(surface.faces) == 2 * len(quads)
    assert surface.input_index.max() < len(points)


def test_what_is_no_thick_cloth_stays_closed() -> None:
    import trimesh

    for solid in (
        trimesh.creation.box([0.3, 0.4, 0.05]),
        trimesh.creation.icosphere(3, 0.2),
        trimesh.creation.torus(0.2, 0.05),
    ):
        surface = make_surface(solid.vertices, solid.faces, closed=True)
        assert len(surface.faces) == len(solid.faces)
    # A button.
    button = trimesh.creation.cylinder(0.007, 0.003, sections=24)
    with pytest.raises(warpflat.InputError, match="closed"):
        make_surface(button.vertices, button.faces)


def test_thick_pieces_are_flattened_from_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first, second = solidified(*bodice(), 0.002), solidified(*sleeve(), 0.002)
    count = len(first[0])
    vertices = np.vstack([first[0], second[0] + [1.0, 0.0, 0.0]])
    faces = [*first[1], *([k + count for k in face] for face in second[1])]
    path = write_obj(tmp_path / "thick.obj", (vertices, faces))
    pieces = warpflat.read_pieces(path, units="m")
    assert [len(border_loops(piece.faces)) for piece in pieces] == [1, 2]
    assert [len(border_loops(layer.faces)) for layer in read_garment(path, units="m").layers] == [1, 2]
    bare = ["--units", "m", "--frames", "0", "--no-picture"]
    assert main(["flatten", str(path), *bare, "--component", "all", "--out", str(tmp_path / "all"), "-v"]) == 0
    assert capsys.readouterr().err.count("2 mm thick: its outer sheet was taken") == 2
    assert set(json.loads((tmp_path / "all" / "metrics.json").read_text())["pieces"]) == {"thick_1", "thick_2"}


def shells(sheet, thickness: float, turned: bool = False) -> list[tuple[np.ndarray, np.ndarray]]:
    """The outer and the inner sheet of thick cloth, without a rim: each with vertices of its own."""
    points, quads = sheet()
    vertices, faces = solidified(points, quads, thickness, rim=False)
    rows = np.array(faces)[:, :: -1 if turned else 1]
    count = len(points)
    return [(vertices[:count], rows[: len(quads)]), (vertices[count:], rows[len(quads) :] - count)]


def three_readings(path: Path) -> list[tuple[warpflat.Surface, ...]]:
    return [
        warpflat.read_pieces(path, units="m"), read_garment(path, units="m").layers, (warpflat.read_surface(path, units="m"),)
    ]  # fmt: skip


@pytest.mark.parametrize("thickness", [0.0005, 0.006])
@pytest.mark.parametrize("order", [1, -1])
@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("sheet", [bodice, sleeve])
def test_two_sheets_without_a_rim_are_one_cloth(
    sheet, turned: bool, order: int, thickness: float, tmp_path: Path
) -> None:
    both = shells(sheet, thickness, turned)
    outer = both[0][0]
    for read in three_readings(write_obj(tmp_path / "shells.obj", *both[::order])):
        assert len(read) == 1
        assert np.abs(read[0].vertices[:, None] - outer[None]).max(axis=2).min(axis=1).max() < 1e-8
        note = next(note for note in read[0].notes if "thick" in note)
        assert float(note.split("drawn ")[1].split(" mm")[0]) == pytest.approx(1e3 * thickness, rel=0.03)
        assert "cm2) left out" in note


def test_sheets_and_a_rim_apart_with_a_pocket_and_a_coarser_inner_side(tmp_path: Path) -> None:
    """As programs write that give the front, the back and the side of cloth a material and vertices each."""
    (outer, faces), (inner, inner_faces) = shells(bodice, 0.003)
    at = np.arange(26 * 21).reshape(26, 21)
    ring = np.concatenate([at[0, :-1], at[:-1, -1], at[-1, :0:-1], at[:0:-1, 0]])
    count = len(ring)
    rim = (
        np.vstack([outer[ring], inner[ring]]),
        [[k, (k + 1) % count, count + (k + 1) % count, count + k] for k in range(count)],
    )
    pocket = (
        outer[at[6:13, 3:9].ravel()] + [0, 0, 0.001],
        quads_between((7, 6)),
    )
    coarse = at[::5, ::2]
    coarser = quads_between(coarse, turned=True)
    names = ("inside", "outside", "side", "pocket")
    for below in (inner_faces, coarser):
        used, number = np.unique(below, return_inverse=True)
        inside = inner[used], number.reshape(below.shape)
        path = write_obj(tmp_path / "coat.obj", inside, (outer, faces), rim, pocket, names=names)
        pieces = warpflat.read_pieces(path, units="m")
        assert [piece.name for piece in pieces] == ["outside", "pocket"]
        words = " ".join(pieces[0].notes)
        assert "its outer sheet, outside, was taken, the inner one or the rim (inside, " in words
        assert "the rim (side, " in words


def test_sheets_that_look_the_same_way_or_lie_unevenly_stay_two(tmp_path: Path) -> None:
    outer, (inner, faces) = shells(bodice, 0.004)
    lining = inner, faces[:, ::-1]
    wedge = outer[0] - np.linspace(0.0, 0.02, len(inner))[:, None] * [0, 0, 1], faces
    for second in (lining, wedge):
        assert len(warpflat.read_pieces(write_obj(tmp_path / "two.obj", outer, second), units="m")) == 2


def with_fin(height: float = 0.02) -> tuple[np.ndarray, list[list[int]], int]:
    """A bodice with a fin on the middle of it: vertices, faces with those of the fin last, and how many these are."""
    points, quads = bodice()
    column = np.arange(5, 21) * 21 + 10
    fin = points[column] + [0, 0, height]
    new = len(points) + np.arange(len(column))
    faces = [[int(column[k]), int(column[k + 1]), int(new[k + 1]), int(new[k])] for k in range(len(column) - 1)]
    return np.vstack([points, fin]), [*quads.tolist(), *faces], len(faces)


def test_a_fin_comes_off_with_its_area() -> None:
    vertices, faces, fin = with_fin()
    surface = make_surface(vertices, faces)
    assert len(surface.faces) == len(faces) - fin
    assert euler_characteristic(surface.faces) == 1
    assert len(border_loops(surface.faces)) == 1
    words = " ".join(surface.notes)
    assert "15 edges at which more than two faces meet" in words
    assert re.search(r"1 small sheet left out \(6\d cm2\)", words)


def test_a_large_sheet_at_an_edge_is_a_piece_of_its_own(tmp_path: Path) -> None:
    vertices, faces, fin = with_fin(0.15)
    with pytest.raises(warpflat.InputError, match=r"faces meet there .* falls into 2 sheets of 500 and 15 faces"):
        make_surface(vertices, faces)
    assert len(make_surface(vertices, faces, component=1).faces) == fin
    path = write_obj(tmp_path / "fin.obj", (vertices, faces))
    pieces = warpflat.read_pieces(path, units="m")
    assert [len(piece.faces) for piece in pieces] == [len(faces) - fin, fin]
    assert any("1 sheet came off" in note for note in pieces[0].notes)


def test_a_pocket_comes_off_whole_and_the_front_under_it_stays(tmp_path: Path) -> None:
    points, quads = bodice()
    at = np.arange(26 * 21).reshape(26, 21)
    patch = at[6:13, 3:9]
    inside = patch[1:, 1:-1]  # joined to the front at the bottom and both sides, open at the top
    place = {int(v): len(points) + k for k, v in enumerate(inside.ravel())}
    pocket = [[place.get(int(v), int(v)) for v in face] for face in quads_between(patch)]
    vertices = np.vstack([points, points[inside.ravel()] + [0, 0, 0.008]])
    pieces = warpflat.read_pieces(write_obj(tmp_path / "pocket.obj", (vertices, [*pocket, *quads.tolist()])), units="m")
    assert sorted(len(piece.faces) for piece in pieces) == [len(pocket), len(quads)]
    front = max(pieces, key=lambda piece: len(piece.faces))
    assert set(front.input_index.tolist()) == set(range(len(points)))
    assert all(euler_characteristic(piece.faces) == 1 for piece in pieces)


def test_doubled_faces_with_vertices_of_their_own_are_one_sheet(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for apart in (0.0, 2e-5):
        points, quads = sleeve(16, 11)
        vertices = np.vstack([points, points + apart])
        path = write_obj(
            tmp_path / "double.obj", (vertices, [*quads.tolist(), *(quads[:, ::-1] + len(points)).tolist()])
        )
        for more in ([], ["--component", "all"], ["--seams", "auto"]):
            out = tmp_path / f"{apart}{''.join(more)}"
            bare = ["--units", "m", "--frames", "0", "--no-picture", "-v", "--out", str(out)]
            assert main(["flatten", str(path), *bare, *more]) == 0
            assert "dropped" in capsys.readouterr().err
            pieces = json.loads((out / "metrics.json").read_text())["pieces"]
            assert sum(piece["faces"] for piece in pieces.values()) in (len(quads), 2 * len(quads)), pieces.keys()


def test_one_twisted_quad_is_cut_with_a_note() -> None:
    points, quads = bodice()
    quads = quads.copy()
    quads[200] = quads[200][[0, 2, 1, 3]]
    surface = make_surface(points, quads)
    assert any("quad" in note and "cut" in note for note in surface.notes)
    assert len(border_loops(surface.faces)) == 1


def some_faces(points: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    used, place = np.unique(faces, return_inverse=True)
    return points[used], place.reshape(faces.shape)


@pytest.mark.parametrize("finer", [False, True])
def test_layers_that_lie_on_each_other_in_part_are_told_with_their_area(finer: bool, tmp_path: Path) -> None:
    points, quads = bodice()
    column = quads % 21
    left, right = quads[column.max(axis=1) <= 14], quads[column.min(axis=1) >= 8]
    if finer:  # by triangles: no face has the vertices of another
        right = np.concatenate([right[:, [0, 1, 3]], right[:, [1, 2, 3]]])
    both = some_faces(points, left), some_faces(points, right)
    path = write_obj(tmp_path / "two.obj", *both, names=("left", "right"))
    pieces = warpflat.read_pieces(path, units="m")
    assert [piece.name for piece in pieces] == ["left", "right"]
    assert [note for note in pieces[0].notes if "left and right lie on each other over 622 cm2" in note]
    # A garment whose seams are found is one layer there.
    (layer,) = read_garment(path, units="m").layers
    assert len(border_loops(layer.faces)) == 1
    assert euler_characteristic(layer.faces) == 1
    assert [
        note for note in layer.notes if "of 622 cm2 dropped: a second layer that lies on another part there" in note
    ]
    # Side by side they are no second layer.
    beside = some_faces(points, quads[column.min(axis=1) >= 14])
    apart = write_obj(tmp_path / "side.obj", some_faces(points, left), beside)
    assert not any("lie on each other" in note for note in warpflat.read_pieces(apart, units="m")[0].notes)


@pytest.mark.parametrize("welded", [False, True])
def test_thick_panels_that_are_glued_rim_to_rim_are_one_sheet_each(welded: bool, tmp_path: Path) -> None:
    def panel(left: float) -> tuple[np.ndarray, list[list[int]]]:
        points = np.stack(
            [np.tile(np.linspace(left, left + 0.3, 16), 21), np.repeat(np.linspace(0, 0.4, 21), 16), np.zeros(336)], -1
        )
        return solidified(points, quads_between((21, 16)), 0.003)

    both = panel(0.0), panel(0.3)
    path = write_obj(tmp_path / "glued.obj", *both, names=("one", "other"))
    if welded:
        count = len(both[0][0])
        places, number = np.unique(np.vstack([each[0] for each in both]).round(9), axis=0, return_inverse=True)
        faces = [*both[0][1], *([k + count for k in face] for face in both[1][1])]
        path = write_obj(tmp_path / "welded.obj", (places, [[number.ravel()[k] for k in face] for face in faces]))
    pieces, (layer,) = warpflat.read_pieces(path, units="m"), read_garment(path, units="m").layers
    assert [len(piece.faces) for piece in pieces] == ([600] if welded else [300, 300])
    assert (len(layer.faces), len(border_loops(layer.faces))) == (600, 1)
    assert any("3 mm thick" in note for note in layer.notes)
    assert any("1 wall between sheets left out (12 cm2)" in note for note in layer.notes) == welded


def test_thick_panels_whose_outer_edges_alone_touch_are_one_sheet_each(tmp_path: Path) -> None:
    """Their rims stand at an angle: joined there without a look at their thickness they are one closed body."""
    points, _ = bodice()
    edge = points.reshape(26, 21, 3)[:, -1]
    beside = np.stack([edge + np.array([0.02 * k, 0.0, 0.0]) for k in range(16)], axis=1).reshape(-1, 3)
    quads = quads_between((26, 16))
    path = write_obj(tmp_path / "rims.obj", solidified(*bodice(), 0.003), solidified(beside, quads, 0.003))
    (layer,) = read_garment(path, units="m").layers
    assert (len(layer.faces), len(border_loops(layer.faces))) == (875, 1)
    assert sum("3 mm thick" in note for note in layer.notes) == 2
