"""From the pattern to the body and back."""

from __future__ import annotations

import numpy as np
import pytest

from warpflat.core.errors import InputError
from warpflat.mannequin.closest import Closest
from warpflat.mannequin.mannequin import Mannequin
from warpflat.mannequin.pattern_map import PatternMap


@pytest.fixture(scope="module")
def piece() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    front = Mannequin.from_size("EU 38", resolution_mm=20).form("skirt").pieces["front"].surface
    # A layout that is no isometry: x from the angle, y from the height, sheared.
    v = front.vertices
    flat = np.column_stack([0.2 * np.arctan2(v[:, 0], v[:, 2] + 0.02) + 0.1 * v[:, 1], v[:, 1]])
    return v, flat, front.faces


def test_vertices_go_there_and_back(piece: tuple[np.ndarray, np.ndarray, np.ndarray]) -> None:
    body, flat, faces = piece
    mapping = PatternMap(body, flat, faces)
    assert np.abs(mapping.to_body(flat) - body).max() < 1e-12
    assert np.abs(mapping.to_pattern(body) - flat).max() < 1e-12


def test_any_point_goes_there_and_back(piece: tuple[np.ndarray, np.ndarray, np.ndarray]) -> None:
    body, flat, faces = piece
    mapping = PatternMap(body, flat, faces)
    rng = np.random.default_rng(3)
    pick = rng.integers(len(faces), size=400)
    weights = rng.dirichlet(np.ones(3), 400)
    points = np.einsum("nk,nkd->nd", weights, flat[faces[pick][:, :3]])
    there = mapping.to_body(points)
    assert np.abs(there - np.einsum("nk,nkd->nd", weights, body[faces[pick][:, :3]])).max() < 1e-9
    assert np.abs(mapping.to_pattern(there) - points).max() < 1e-9


def test_polyline_lies_on_the_surface(piece: tuple[np.ndarray, np.ndarray, np.ndarray]) -> None:
    body, flat, faces = piece
    mapping = PatternMap(body, flat, faces)
    middle = flat.mean(axis=0)
    drawn = middle + np.array([[-0.12, 0.10], [0.02, -0.2], [0.10, 0.15]])
    on_body = mapping.polyline_to_body(drawn)
    assert len(on_body) > 20
    triangles = np.concatenate([faces[:, :3], faces[:, [0, 2, 3]]]).astype(np.int64)
    # Halfway between two carried points the line is still on the surface: it bends only where the mesh does.
    halfway = 0.5 * (on_body[1:] + on_body[:-1])
    assert Closest(body, triangles)(halfway)[2].max() < 1e-9
    back = mapping.polyline_to_pattern(on_body)
    assert np.abs(back[0] - drawn[0]).max() < 1e-9
    assert np.abs(back[-1] - drawn[-1]).max() < 1e-9
    # Every point that comes back lies on the drawn line.
    away = np.minimum(_distance(back, drawn[0], drawn[1]), _distance(back, drawn[1], drawn[2]))
    assert away.max() < 1e-6


def _distance(points: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    t = np.clip((points - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
    return np.linalg.norm(points - (a + t[:, None] * (b - a)), axis=1)


def test_points_off_the_piece_are_refused(piece: tuple[np.ndarray, np.ndarray, np.ndarray]) -> None:
    mapping = PatternMap(*piece)
    with pytest.raises(InputError, match=r"point 1 .* off the pattern"):
        mapping.to_body(np.array([piece[1][0], [5.0, 5.0]]))
    with pytest.raises(InputError, match=r"point 0 .* off the body"):
        mapping.to_pattern(np.array([[3.0, 0.0, 0.0]]))
    with pytest.raises(InputError, match="#P by 2"):
        mapping.to_body(np.zeros((2, 3)))
    with pytest.raises(InputError, match="do not fit"):
        PatternMap(piece[0], piece[1], np.array([[0, 1, 2, 99999]]))


def test_closest_is_exact_against_brute_force() -> None:
    rng = np.random.default_rng(0)
    vertices = rng.normal(size=(40, 3))
    triangles = rng.integers(40, size=(60, 3))
    triangles = triangles[(np.diff(np.sort(triangles, axis=1), axis=1) > 0).all(axis=1)]
    points = rng.normal(size=(50, 3)) * 1.5
    _, _, distance = Closest(vertices, triangles)(points)
    grid = np.array([(i, j, 40 - i - j) for i in range(41) for j in range(41 - i)]) / 40.0
    dense = np.einsum("gk,tkd->tgd", grid, vertices[triangles]).reshape(-1, 3)
    brute = np.linalg.norm(points[:, None] - dense[None], axis=2).min(axis=1)
    assert (distance <= brute + 1e-12).all()
    assert (brute - distance).max() < 0.06
