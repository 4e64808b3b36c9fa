"""Pieces that are nearly closed: flattened without flips, with a note that names the cut."""

from __future__ import annotations

import numpy as np
import pytest

from warpflat.flat.flattening.edit import change_surface
from warpflat.flat.flattening.flatten_piece import flatten, nearly_closed_notes
from warpflat.flat.surface.mesh import Surface
from warpflat.flat.surface.repair.validate import make_surface
from warpflat.flat.surface.shapes import bodice, dome

RADIUS, ROWS, COLUMNS = 0.1, 10, 16


def sphere(hole: float) -> Surface:
    """A sphere from its lower pole up to a hole of this half angle [degrees]."""
    down = np.linspace(np.pi, np.radians(hole), ROWS + 1)[1:, None]
    around = np.linspace(0.0, 2.0 * np.pi, COLUMNS, endpoint=False)[None]
    ring = [np.sin(down) * np.cos(around), np.cos(down) + 0.0 * around, np.sin(down) * np.sin(around)]
    vertices = RADIUS * np.concatenate([[[0.0, -1.0, 0.0]], np.stack(ring, axis=-1).reshape(-1, 3)])
    j = np.arange(COLUMNS)
    faces = [np.stack([0 * j, 1 + j, 1 + (j + 1) % COLUMNS], axis=1)]
    for row in range(ROWS - 1):
        a, b = 1 + row * COLUMNS + j, 1 + row * COLUMNS + (j + 1) % COLUMNS
        faces += [np.stack([a, a + COLUMNS, b + COLUMNS], axis=1), np.stack([a, b + COLUMNS, b], axis=1)]
    return make_surface(vertices, np.concatenate(faces))


@pytest.mark.parametrize("hole", [60.0, 10.0])
def test_a_sphere_with_a_hole_is_flattened_without_flips_and_with_a_note_on_its_cut(hole: float) -> None:
    result = flatten(sphere(hole))
    assert result.converged
    assert result.flipped_faces == 0
    assert np.isfinite(result.positions).all()
    (note,) = [note for note in result.notes if "nearly closed" in note]
    # Down the meridian from the hole to the pole, along edges.
    assert "to vertex 0 would" in note
    length = ROWS * 2e2 * RADIUS * np.sin(np.radians(180.0 - hole) / ROWS / 2.0)
    assert f"a cut of {length:.1f} cm" in note


def test_the_note_is_of_the_surface_that_a_piece_was_moved_to() -> None:
    result = flatten(sphere(60.0))
    larger = change_surface(result, 1.2 * result.surface.vertices)
    told = [[note for note in piece.notes if "nearly closed" in note] for piece in (result, larger)]
    assert told == [nearly_closed_notes(piece.surface) for piece in (result, larger)]
    assert told[0] != told[1]


def test_pieces_that_lie_flat_get_no_such_note() -> None:
    assert nearly_closed_notes(dome(resolution=11)) == []
    assert nearly_closed_notes(bodice(resolution=11)) == []
    assert nearly_closed_notes(sphere(100.0)) == []
