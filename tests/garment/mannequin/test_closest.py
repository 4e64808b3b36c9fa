"""The nearest places on a mesh of triangles."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from warpflat.garment.mannequin.closest import Mesh
from warpflat.garment.mannequin.exact_closest import Closest


def test_nearest_places_are_those_of_a_search_over_all_triangles() -> None:
    random = np.random.default_rng(3)
    vertices, triangles = random.normal(size=(60, 3)), random.permutation(60).reshape(20, 3)
    points = random.normal(size=(50, 3))
    found, weights, places = Mesh(vertices, triangles).closest(points)
    exact, shares, distances = Closest(vertices, triangles)(points)
    given = trimesh.Trimesh(vertices, triangles, process=False)
    rows = zip(points, found, weights, places, exact, shares, distances, strict=True)
    for point, face, weight, place, same, share, distance in rows:
        each = trimesh.triangles.closest_point(given.triangles, np.tile(point, (20, 1)))
        far = np.linalg.norm(each - point, axis=1)
        assert np.linalg.norm(place - point) == pytest.approx(far.min(), abs=1e-6)
        assert far[face] == pytest.approx(far.min(), abs=1e-6)
        np.testing.assert_allclose(weight @ vertices[triangles[face]], place, atol=1e-12)
        assert distance == pytest.approx(far.min(), abs=1e-12)
        np.testing.assert_allclose(np.linalg.norm(share @ vertices[triangles[same]] - point), distance, atol=1e-12)


def test_a_place_on_an_edge_has_one_normal_whichever_triangle_it_is_told_of() -> None:
    # Two faces of a roof; vertex normals by area.
    roof = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [1.0, -1.0, 0.0], [-1.0, -2.0, 0.0]])
    mesh = Mesh(roof, np.array([[0, 1, 2], [1, 0, 3]]))
    weights = np.array([[0.3, 0.7, 0.0], [0.7, 0.3, 0.0]])
    first, second = mesh.normals_at(np.array([0, 1]), weights)
    np.testing.assert_allclose(first, second, atol=1e-15)
    assert np.linalg.norm(first) == pytest.approx(1.0)
    assert mesh.normals[0] @ mesh.normals[1] < 0.5
    # Inside a triangle it is nearer to that one's own.
    inside = mesh.normals_at(np.array([0]), np.array([[0.2, 0.2, 0.6]]))[0]
    assert inside @ mesh.normals[0] > first @ mesh.normals[0] + 0.01
