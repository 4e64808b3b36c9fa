"""OBJ files as other programs write them: corners, line ends, numbers, continued lines, negative indices."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from warpflat.core.errors import InputError
from warpflat.flat.surface.io.raw_mesh import RawMesh
from warpflat.flat.surface.io.read_obj import read_obj
from warpflat.garment.construction.read_pieces import read_pieces

GRID = 12


def plain(corner: str, *, position: str = "v {x!r} {y!r} {z!r}", end: str = "\n") -> str:
    """A grid of quads and triangles; `corner` writes the corner of a vertex's number."""
    random = np.random.default_rng(4)
    lines = ["# a comment, ö", "o piece"]
    for x, y, z in random.normal(size=(GRID * GRID, 3)).tolist():
        lines.append(position.format(x=x, y=y, z=z))
    lines += [f"vt {u!r} {v!r}" for u, v in random.normal(size=(GRID * GRID, 2)).tolist()]
    lines += ["g side", "l 1 2 3", "usemtl cloth"]
    for row in range(GRID - 1):
        for column in range(GRID - 1):
            first = row * GRID + column + 1
            quad = [first, first + 1, first + GRID + 1, first + GRID]
            lines.append("f " + " ".join(corner.format(v=v) for v in (quad if column % 3 else quad[:3])))
    return end.join([*lines, ""])


def expected() -> tuple[np.ndarray, np.ndarray]:
    """The positions and polygons of :func:`plain`."""
    positions = np.random.default_rng(4).normal(size=(GRID * GRID, 3))
    first = (GRID * np.arange(GRID - 1)[:, None] + np.arange(GRID - 1)).ravel()
    polygons = first[:, None] + [0, 1, GRID + 1, GRID]
    polygons[first % GRID % 3 == 0, 3] = -1
    return positions, polygons


def read(text: str, path: Path) -> RawMesh:
    path.write_bytes(text.encode())
    return read_obj(path)


PLAIN = {
    "vertices": plain("{v}"),
    "texture": plain("{v}/{v}"),
    "texture and normal": plain("{v}/{v}/7"),
    "normal": plain("{v}//{v}"),
    "other texture": plain("{v}/1"),
    "Windows": plain("{v}/{v}", end="\r\n"),
    "tabs and colours": plain("{v}", position="v\t{x!r}  {y!r}\t{z!r} 0.5 0.5 1"),
    "byte order mark": "\ufeff" + plain("{v}"),
    "short numbers": plain("{v}", position="v {x:.2e} {y:.3f} {z:+.1f}"),
}
OTHER = {
    "negative": plain("{v}").replace("f 14 15", "f -131 15"),
    "mixed corners": plain("{v}/{v}").replace("f 14/14", "f 14"),
    "comment behind": plain("{v}").replace("usemtl cloth\n", "usemtl cloth\nf 1 2 3 # corner\n"),
    "indented": plain("{v}").replace("g side", " v 1 2 3"),
    "continued": plain("{v}").replace("f 14 15", "f 14 \\\n15"),
    "Arabic digits": plain("{v}").replace("f 14 15", "f 14 ١٥"),
    "interleaved": re.sub(r"\nl 1 2 3", "\nl 1 2 3" + "\nv 1 2 3\nf 1 2 3" * 40, plain("{v}")),
    "fourth number of some": plain("{v}").replace("\nvt", " 1.0\nvt", 1),
}
WRONG = {
    "f 14 15": (
        "f 14 x",
        "f 14 1_5 16",
        "f 14 /5 16",
        "f 14 0",
        "f 14 999",
        "f 14 #",
        "f 14 1.5",
        "f 14 99999999999999999999 2",
    ),
    "\nvt": ("\nv 1 2\nvt", "\nv 1 2 x\nvt", "\nv 1 2 3,5\nvt", "\nv 1 2 1_0\nvt"),
}


@pytest.mark.parametrize("name", PLAIN)
def test_file_is_read_whole(name: str, tmp_path: Path) -> None:
    mesh = read(PLAIN[name], tmp_path / "a.obj")
    positions, polygons = expected()
    np.testing.assert_allclose(mesh.vertices, positions, rtol=0, atol=0.06 if name == "short numbers" else 0)
    np.testing.assert_array_equal(mesh.polygons, polygons)
    assert {name: row.tolist() for name, row in mesh.chains.items()} == {"side": [0, 1, 2]}
    assert mesh.objects[0] == [(0, "piece")]
    assert mesh.split_corners == (name in ("texture", "texture and normal", "Windows"))


@pytest.mark.parametrize("name", OTHER)
def test_other_spelling_is_the_same_mesh(name: str, tmp_path: Path) -> None:
    mesh = read(OTHER[name], tmp_path / "a.obj")
    positions, polygons = expected()
    more = {"comment behind": 1, "interleaved": 40}.get(name, 0)
    np.testing.assert_array_equal(mesh.vertices[: len(positions)], positions)
    np.testing.assert_array_equal(
        np.unique(mesh.vertices[len(positions) :], axis=0),
        [[1, 2, 3]] * (len(mesh.vertices) > len(positions)) or np.empty((0, 3)),
    )
    np.testing.assert_array_equal(mesh.polygons[more:], polygons)
    np.testing.assert_array_equal(mesh.polygons[:more], [[0, 1, 2, -1]] * more or np.empty((0, 4)))


@pytest.mark.parametrize(("text", "wrong"), [(text, each) for text, all_of in WRONG.items() for each in all_of])
def test_mistake_is_named_with_its_line(text: str, wrong: str, tmp_path: Path) -> None:
    good = plain("{v}")
    path = tmp_path / "a.obj"
    path.write_text(good.replace(text, wrong, 1), encoding="utf-8")
    number = good[: good.index(text)].count("\n") + 1 + wrong.startswith("\n")
    with pytest.raises(InputError, match=f"^line {number}: "):
        read_obj(path)


def test_file_that_is_cut_short_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.obj"
    path.write_text(plain("{v}/{v}").rstrip("\n").rpartition("/")[0])
    with pytest.raises(InputError, match="is cut short"):
        read_obj(path)


def test_no_line_takes_the_name_of_another(tmp_path: Path) -> None:
    rows = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n"
    mesh = read(rows + "g dart\nl 1 2\nl 3 4\ng dart_1\nl 2 3\n", tmp_path / "a.obj")
    lines = {name: row.tolist() for name, row in mesh.chains.items()}
    assert lines == {"dart_1": [0, 1], "dart_2": [2, 3], "dart_1_": [1, 2]}


def panels(style: str) -> str:
    """A front and a back, each a strip of three quads, with their names where different programs write them."""
    points = {
        name: [f"v {x} {y} {z}" for y in (0.0, 0.3) for x in (0.0, 0.1, 0.2, 0.3)]
        for name, z in (("front", 0.1), ("back", -0.1))
    }
    if style == "interleaved":  # vertex by vertex of both
        rows = [row for pair in zip(*points.values(), strict=True) for row in pair]
        corners = {"front": [2 * k + 1 for k in range(8)], "back": [2 * k + 2 for k in range(8)]}
    else:
        rows = [row for one in points.values() for row in one]
        corners = {"front": list(range(1, 9)), "back": list(range(9, 17))}
    faces = {name: [f"f {c[k]} {c[k + 1]} {c[k + 5]} {c[k + 4]}" for k in range(3)] for name, c in corners.items()}
    match style:
        case "name, vertices, faces":
            lines = [line for name in points for line in (f"o {name}", *points[name], *faces[name])]
        case "vertices, name, faces":
            lines = [line for name in points for line in (*points[name], f"g {name}", *faces[name])]
        case "group within an object":
            lines = [
                line
                for name in points
                for line in (f"o {name}", *points[name], "g seam", *faces[name][:1], "g rest", *faces[name][1:])
            ]
        case "groups of one object":
            lines = ["o shirt", *rows, *(line for name in points for line in (f"g {name}", *faces[name]))]
        case "faces in turn":
            turns = zip(faces["front"], faces["back"], strict=True)
            lines = [*rows, *(line for one, other in turns for line in ("g front", one, "g back", other))]
        case _:
            lines = [*rows, *(line for name in points for line in (f"o {name}", *faces[name]))]
    return "\n".join([*lines, ""])


@pytest.mark.parametrize(
    "style",
    [
        "name, vertices, faces", "vertices, name, faces", "all vertices first", "interleaved", "groups of one object",
        "group within an object", "faces in turn",
    ],
)  # fmt: skip
def test_objects_keep_their_names_wherever_their_vertices_stand(style: str, tmp_path: Path) -> None:
    file = tmp_path / "shirt.obj"
    file.write_text(panels(style))
    front, back = read_pieces(file, units="m", meet=0.0)
    assert (front.name, back.name) == ("front", "back")
    assert (front.vertices[:, 2] == 0.1).all()
    assert (back.vertices[:, 2] == -0.1).all()
    # Vertices count from their object's first one, where objects have theirs in turn.
    last = [piece.input_index.max() for piece in (front, back)]
    assert last == ([14, 15] if style == "interleaved" else [7, 7])


def test_groups_that_share_vertices_are_one_object(tmp_path: Path) -> None:
    file = tmp_path / "shirt.obj"
    file.write_text(panels("all vertices first") + "o strap\nf 4 9 13 8\n")
    (piece,) = read_pieces(file, units="m", meet=0.0)
    assert piece.name == "shirt"
