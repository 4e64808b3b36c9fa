"""The certificate: a border against a reference, mirrored faces, vertices wound twice, areas covered twice by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray
from surface_meshes import grid, quads_between

from warpflat.flat.surface.injective import (
    border_edges_of,
    certify,
    crack_edges_of,
    crossings,
    is_injective,
    is_wound_once,
    near_edges,
    overlap_area,
)
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.repair.validate import make_surface

FloatArray = NDArray[np.float64]
NO_CUTS = np.empty(0, dtype=np.int32)


def disk(corners: int) -> Surface:
    """A fan of triangles around vertex 0."""
    angle = 2 * np.pi * np.arange(corners) / corners
    ring = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    k = np.arange(corners)
    return make_surface(
        np.concatenate([np.zeros((1, 3)), ring]), np.stack([0 * k, 1 + k, 1 + (k + 1) % corners], axis=1)
    )


def ring(turns: float, steps: int) -> tuple[Surface, FloatArray]:
    """A band of radii 1 and 2 that runs around its middle, raised in space, and its layout in the plane."""
    s, r = np.meshgrid(np.linspace(0, 2 * np.pi * turns, steps + 1), [2.0, 1.5, 1.0], indexing="ij")
    faces = quads_between(s.shape, turned=True)
    flat = np.stack([r * np.cos(s), r * np.sin(s)], axis=-1).reshape(-1, 2)
    return make_surface(np.column_stack([flat, 0.1 * s.ravel()]), faces), flat


@pytest.mark.parametrize("seed", range(60))
def test_a_border_is_simple_where_shapely_says_so(seed: int):
    random = np.random.default_rng(seed)
    corners = int(random.integers(4, 60))
    surface = disk(corners)
    # Star-shaped, and in every other case shaken so that some edges cross.
    radius = random.uniform(0.2, 1.0, corners)
    layout = np.concatenate([np.zeros((1, 2)), radius[:, None] * surface.vertices[1:, :2]])
    if seed % 2:
        layout[1:] += random.normal(scale=0.3 / corners, size=(corners, 2))
    edges = border_edges_of(surface)
    assert set(edges.tail.tolist()) == set(range(1, corners + 1))
    found = {frozenset(pair) for pair in np.stack(crossings(edges, layout), axis=1).tolist()}
    lines = [shapely.LineString(layout[[a, b]]) for a, b in zip(edges.tail, edges.head, strict=True)]
    expected = {
        frozenset((i, j))
        for i in range(corners)
        for j in range(i)
        if not {edges.tail[i], edges.head[i]} & {edges.tail[j], edges.head[j]} and lines[i].intersects(lines[j])
    }
    assert found == expected
    assert (not found) == shapely.LinearRing(layout[edges.tail]).is_simple


def test_near_edges_are_all_that_are_near():
    surface, flat = ring(0.9, 40)
    edges = border_edges_of(surface)
    lines = shapely.linestrings(np.stack([flat[edges.tail], flat[edges.head]], axis=1))
    i, j = near_edges(edges, flat, 0.3)
    close = np.argwhere(np.triu(shapely.distance(lines[:, None], lines[None]) <= 0.3, k=1))
    assert {tuple(pair) for pair in close.tolist()} <= {*zip(i.tolist(), j.tolist(), strict=True)}
    assert len(i) < len(lines) ** 2 / 4


def test_edges_folded_back_on_each_other_are_found():
    surface = disk(5)
    layout = surface.vertices[:, :2].copy()
    layout[2] = 0.5 * (layout[1] + layout[3])
    assert is_injective(surface, layout)
    layout[2] = layout[1] + 1.5 * (layout[3] - layout[1])
    assert not is_injective(surface, layout)


def test_a_mirrored_face_is_found_inside_a_simple_border():
    vertices, faces = grid(5, 5)
    surface = make_surface(vertices, faces)
    layout = surface.vertices[:, :2].copy()
    assert is_injective(surface, layout)
    inner = int(np.argmin(np.abs(layout - layout.mean(axis=0)).sum(axis=1)))
    layout[inner] += 1.2 * (np.sort(np.unique(layout[:, 0]))[1] - np.sort(np.unique(layout[:, 0]))[0])
    assert not is_injective(surface, layout)


@pytest.mark.parametrize("turn", [0.0, 0.1, 1.7, 3.3])
def test_a_vertex_wound_twice_is_found_where_no_face_is_mirrored(turn: float):
    surface = disk(10)
    once, twice = (turn + turns * 2 * np.pi * np.arange(10) / 10 for turns in (1, 2))
    for angle, wound_once in ((once, True), (twice, False)):
        layout = np.concatenate([np.zeros((1, 2)), np.stack([np.cos(angle), np.sin(angle)], axis=1)])
        assert is_wound_once(surface, layout) is wound_once
        assert is_injective(surface, layout) is wound_once


def test_the_area_covered_twice_is_that_of_the_turns_beyond_one():
    surface, flat = ring(44 / 40, 44)
    # 4 of the 44 steps lie exactly on others.
    step = 0.5 * np.sin(2 * np.pi / 40) * (2.0**2 - 1.0**2)
    assert overlap_area(surface, flat, NO_CUTS) == pytest.approx(4 * step, rel=1e-9)
    assert not certify(surface, flat, NO_CUTS)
    surface, flat = ring(36 / 40, 36)
    assert overlap_area(surface, flat, NO_CUTS) == 0.0
    assert certify(surface, flat, NO_CUTS)


def test_sides_that_only_touch_cover_nothing_twice():
    surface, flat = ring(1.0, 40)
    flat[-3:] = flat[:3]
    assert not is_injective(surface, flat)
    assert overlap_area(surface, flat, NO_CUTS) == 0.0


def test_parts_that_a_cut_has_separated_lie_independently():
    vertices, faces = grid(4, 4)
    whole = make_surface(vertices, faces)
    count, twice = len(whole.vertices), np.concatenate([whole.vertices, whole.vertices + np.array([0.0, 0.0, 1.0])])
    surface = replace(
        whole,
        vertices=twice,
        faces=np.concatenate([whole.faces, np.where(whole.faces < 0, -1, whole.faces + count)]).astype(np.int32),
        input_vertices=twice,
        input_index=np.arange(2 * count, dtype=np.int32),
    )
    assert certify(surface, np.tile(whole.vertices[:, :2], (2, 1)), NO_CUTS)


def test_overlapping_sides_of_a_cut_are_left_to_its_measure_and_those_of_a_slit_are_not():
    # A disk slit from its border to its middle, of 370 degrees.
    steps, degrees = 36, 370.0
    angle = np.radians(degrees) * np.arange(steps + 1) / steps
    seam = 2 * np.pi * np.arange(steps + 1) / steps
    body = [np.zeros((1, 3)), np.stack([np.cos(seam), np.sin(seam), 0 * seam], axis=1)]
    body[1][-1] = body[1][0]
    k = np.arange(steps)
    surface = make_surface(np.concatenate(body), np.stack([0 * k, 1 + k, 2 + k], axis=1))
    assert len(surface.vertices) == steps + 2
    assert crack_edges_of(surface).sum() == 2
    layout = np.concatenate([np.zeros((1, 2)), np.stack([np.cos(angle), np.sin(angle)], axis=1)])
    assert overlap_area(surface, layout, NO_CUTS) > 0.0
    sides = np.array([0, 1, steps + 1], dtype=np.int32)
    assert overlap_area(surface, layout, sides) == 0.0
