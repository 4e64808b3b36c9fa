"""Bricks: names, borders, neighbours; and that the surface is smooth across them."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from warpflat.core.errors import InputError
from warpflat.core.vectors import unit
from warpflat.flat.surface.normals import area_vectors
from warpflat.garment.mannequin.layout import QUARTERS, make_layout
from warpflat.garment.mannequin.mannequin import Mannequin

# The fork turns sharply at the crotch, and its quads fan out there.
_NOT_TRUNK = ("collar", "armhole", "biceps", "elbow", "crotch")


@pytest.fixture(scope="module")
def body() -> Mannequin:
    return Mannequin.from_size("EU 38")


def test_every_face_is_in_one_brick_and_the_mesh_is_manifold(body: Mannequin) -> None:
    layout = body.layout
    total = sum((g.shape[0] - 1) * (g.shape[1] - 1) for g in layout.bricks.values())
    assert total == len(layout.faces) == len(layout.face_brick)
    assert np.array_equal(np.unique(layout.faces), np.arange(layout.vertex_count))
    for faces in (layout.body_faces, layout.faces[~layout.on_body]):
        ahead = np.stack([faces, np.roll(faces, -1, axis=1)], -1).reshape(-1, 2)
        _, twice = np.unique(ahead, axis=0, return_counts=True)
        assert twice.max() == 1  # consistently wound
        _, shared = np.unique(np.sort(ahead, axis=1), axis=0, return_counts=True)
        assert shared.max() == 2


def test_lines_run_along_mesh_edges(body: Mannequin) -> None:
    faces = body.layout.faces
    edges = {
        tuple(sorted(e))
        for k in range(4)
        for e in zip(faces[:, k].tolist(), faces[:, (k + 1) % 4].tolist(), strict=True)
    }
    for name, ids in body.layout.lines.items():
        for pair in itertools.pairwise(ids.tolist()):
            assert tuple(sorted(pair)) in edges, name
    for name in ("bust", "waist", "hip", "neck", "armhole left", "biceps right"):
        assert body.layout.lines[name][0] == body.layout.lines[name][-1]


def test_neighbours_share_their_border_exactly(body: Mannequin) -> None:
    opposite = {"up": "down", "down": "up", "left": "right", "right": "left"}
    chest = body.brick("waist-abdomen/front-left-centre")
    assert chest.neighbours == {
        "up": ("underbust-waist/front-left-centre",), "down": ("abdomen-hip/front-left-centre",),
        "left": ("waist-abdomen/front-left-side",), "right": ("waist-abdomen/front-right-centre",),
    }  # fmt: skip
    ends = {"up": lambda g: g[-1], "down": lambda g: g[0], "left": lambda g: g[:, -1], "right": lambda g: g[:, 0]}
    for side, others in chest.neighbours.items():
        other = body.brick(others[0])
        assert np.array_equal(ends[side](chest.vertices), ends[opposite[side]](other.vertices))
    # Every neighbourhood is mutual.
    for name in body.layout.bricks:
        for others in body.brick(name).neighbours.values():
            for other in others:
                assert any(name in back for back in body.brick(other).neighbours.values()), (name, other)
    assert body.brick("yoke-chest/front-left-side").neighbours["left"] == ("armhole-biceps/arm-left-front",)


def test_names_that_people_type(body: Mannequin) -> None:
    assert body.select("waist-hip/front-left-centre") == [
        "waist-abdomen/front-left-centre", "abdomen-hip/front-left-centre",
    ]  # fmt: skip
    assert set(body.select("neck-waist/front-*")) == set(body.select("shoulder-waist/front-*"))
    assert len(body.select("hip-thigh/*")) == 8
    assert body.brick("across-chest-bust/back-left-side").name == "chest-bust/back-left-side"


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("waist-hipp/front-left-centre", "did you mean 'hip'"),
        ("hip-waist/front-left-centre", "write the upper level first"),
        ("waist-hip/front-left-center", "did you mean 'front-left-centre'"),
        ("waist", "upper-lower/column"),
        ("waist-wrist/*", "not levels of one part"),
        ("waist-hip/front-left-centre", "covers 2 bricks"),
    ],
)
def test_unknown_bricks_are_named(body: Mannequin, name: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        body.brick(name)


def test_unknown_line(body: Mannequin) -> None:
    with pytest.raises(InputError, match="did you mean 'waist'"):
        body.line("waste")


def test_smooth_across_brick_borders(body: Mannequin) -> None:
    """Faces of the trunk turn no more across a brick's border than they do inside bricks."""
    layout = body.layout
    names = list(layout.bricks)
    trunk = np.array([not n.startswith(_NOT_TRUNK) for n in names])[layout.face_brick] & layout.on_body
    normals = unit(area_vectors(body.vertices, layout.faces))
    ends = np.stack([layout.faces, np.roll(layout.faces, -1, axis=1)], -1).reshape(-1, 2)
    owner = np.repeat(np.arange(len(layout.faces)), 4)
    order = np.lexsort(np.sort(ends, axis=1).T)
    key = np.sort(ends, axis=1)[order]
    same = np.flatnonzero((key[1:] == key[:-1]).all(axis=1))
    a, b = owner[order][same], owner[order][same + 1]
    both = trunk[a] & trunk[b]
    a, b = a[both], b[both]
    turn = np.degrees(np.arccos(np.clip(np.einsum("ij,ij->i", normals[a], normals[b]), -1.0, 1.0)))
    border = layout.face_brick[a] != layout.face_brick[b]
    assert border.sum() > 500
    assert np.quantile(turn[border], 0.95) < 1.5 * np.quantile(turn[~border], 0.95)
    assert turn[border].max() < 35.0


def test_quads_are_near_rectangles(body: Mannequin) -> None:
    layout = body.layout
    names = list(layout.bricks)
    trunk = np.array([not n.startswith(_NOT_TRUNK) for n in names])[layout.face_brick]
    q = body.vertices[layout.faces[trunk]]
    angles = []
    for k in range(4):
        u, v = q[:, k - 1] - q[:, k], q[:, (k + 1) % 4] - q[:, k]
        angles.append(
            np.degrees(np.arccos(np.einsum("ij,ij->i", u, v) / np.linalg.norm(u, axis=1) / np.linalg.norm(v, axis=1)))
        )
    angles = np.array(angles)
    assert angles.min() > 30.0
    assert angles.max() < 155.0
    assert np.mean((angles > 60.0) & (angles < 120.0)) > 0.985
    edges = np.linalg.norm(np.roll(q, -1, axis=1) - q, axis=2)
    assert edges.min() > 0.002


def test_counts_depend_on_the_resolution_only() -> None:
    fine, coarse = make_layout(8.0), make_layout(16.0)
    assert fine.columns != coarse.columns
    assert list(fine.bricks) == list(coarse.bricks)
    for layout in (fine, coarse):
        assert len(layout.arms["left"][0]) == len(layout.arms["right"][0])
        assert np.array_equal(layout.mirror[layout.mirror], np.arange(layout.vertex_count))
        assert set(layout.yokes) == set(QUARTERS)
