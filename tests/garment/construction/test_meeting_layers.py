"""Layers on each other and borders beside each other: dropped, sewn or told, never passed over."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from obj_files import write_obj
from surface_meshes import quads_between

from warpflat.flat.surface.io.read import read_surface
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.repair.validate import make_surface
from warpflat.garment.construction.read_pieces import read_pieces
from warpflat.garment.construction.sew_pieces import meeting_borders, unsewn_borders


def _sheet(columns: int = 9, rows: int = 11) -> tuple[Any, Any]:
    """A sheet of 30 x 40 cm that bulges by 4 cm along its length."""
    u, v = (a.ravel() for a in np.meshgrid(np.linspace(0, 0.3, columns), np.linspace(0, 0.4, rows)))
    quads = quads_between((rows, columns))
    return np.stack([u, v, 0.04 * np.sin(np.pi * u / 0.3) * np.sin(np.pi * v / 0.4)], axis=-1), quads


def _doubled(kind: str) -> tuple[Any, Any]:
    points, quads = _sheet()
    rng = np.random.default_rng(0)
    if kind == "turned over":
        return points, quads[:, ::-1]
    if kind == "shifted":
        return points + 1e-6, quads
    if kind == "renumbered":
        order = rng.permutation(len(points))
        return points[order], np.argsort(order)[quads][rng.permutation(len(quads))]
    if kind == "in triangles":
        return points, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    return points, quads[:20]


@pytest.mark.parametrize("kind", ["turned over", "shifted", "renumbered", "in triangles", "a part"])
def test_a_second_layer_is_dropped_with_a_note(kind: str, tmp_path: Path):
    second = _doubled(kind)
    path = write_obj(tmp_path / "double.obj", _sheet(), second, names=("part0", "part1"), digits="")
    area = "308" if kind == "a part" else "1,2"
    for pieces in (read_pieces(path, units="m"), (read_surface(path, units="m"),)):
        assert len(pieces) == 1
        assert len(pieces[0].faces) == 80
        assert pieces[0].notes[0].startswith(f"{len(second[1])} faces of {area}")
        assert "dropped: a second layer" in pieces[0].notes[0]


def _surfaces(*parts: tuple[Any, Any]) -> dict[str, Surface]:
    names = ("front", "back")
    return {name: make_surface(*part, name=name) for name, part in zip(names, parts, strict=True)}


@pytest.mark.parametrize("order", [1, -1])
def test_a_lining_is_a_piece_of_its_own_and_not_sewn_all_around(order: int, tmp_path: Path):
    points, quads = _sheet()
    lining = points * [1, 1, 0.99]  # its border is that of the outer layer, inside it keeps up to 0.4 mm away
    path = write_obj(
        tmp_path / "lined.obj", (points, quads), (lining, quads[:, ::order]), names=("part0", "part1"), digits=""
    )
    pieces = {piece.name: piece for piece in read_pieces(path, units="m")}
    assert len(pieces) == 2
    assert meeting_borders(pieces) == []
    assert "0.00 mm apart for 14" in unsewn_borders(pieces)[0]


def test_a_cushion_is_sewn_all_around():
    points, quads = _sheet()
    both = _surfaces((points, quads), (points * [1, 1, -1], quads[:, ::-1]))
    assert sum(len(pair.vertices[0]) - 1 for pair in meeting_borders(both)) == 36
    assert unsewn_borders(both) == []


def test_borders_that_miss_each_other_are_told():
    points, quads = _sheet()
    mirrored = points * [-1, 1, 1]
    slipped, one_more = mirrored.copy(), mirrored.copy()
    slipped[::9, 2] += 5e-5
    assert unsewn_borders(_surfaces((points, quads), (mirrored, quads[:, ::-1]))) == []
    told = unsewn_borders(_surfaces((points, quads), (slipped, quads[:, ::-1])))
    assert len(told) == 1
    assert "borders of front and back run 0.05 mm apart for 40" in told[0]
    # One vertex more in the middle of one edge: that edge is told, the others are sewn.
    middle = 0.5 * (one_more[36] + one_more[45])
    edges = [_with_vertex(face, 36, 45, len(points)) for face in quads[:, ::-1].tolist()]
    pair = _surfaces((points, quads), (np.vstack([one_more, middle]), edges))
    assert sum(len(seam.vertices[0]) - 1 for seam in meeting_borders(pair)) == 9
    told = unsewn_borders(pair)
    assert len(told) == 1
    assert "run 0.00 mm apart for 4" in told[0]
    far = mirrored - np.array([2e-3, 0, 0])
    assert unsewn_borders(_surfaces((points, quads), (far, quads[:, ::-1]))) == []
    # Of pieces that are sewn to nothing it is told, with the distance that would do.
    told = unsewn_borders(_surfaces((points, quads), (far, quads[:, ::-1])), alone={"front", "back"})
    assert len(told) == 1
    assert "borders of front and back run 2.00 mm apart for 4" in told[0]
    assert "(--meet) 3 makes them meet" in told[0]


def _with_vertex(face: list[int], a: int, b: int, new: int) -> list[int]:
    """Return a face with a vertex more between two of its corners."""
    out = list[int]()
    for k, corner in enumerate(face):
        out += [corner, new] if {corner, face[(k + 1) % len(face)]} == {a, b} else [corner]
    return out
