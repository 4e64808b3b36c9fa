"""A cut panel grows as its worn cloth does, and keeps its ease and its grain."""

from __future__ import annotations

import numpy as np
import pytest

from warpflat.flat.surface.repair.validate import make_surface
from warpflat.garment.construction.graded import graded_layout, stretches_worn


@pytest.mark.parametrize("angle", [0.0, 14.0, 45.0])
def test_a_panel_on_a_tube_that_grows_around_is_wider_across_its_worn_girth(angle: float):
    """A third of a tube of radius .1 m and height .3 m, cut 5 % wider than it is worn, its grain off upright by an angle."""
    turn, height = (each.ravel() for each in np.meshgrid(np.linspace(0.0, 2.0, 25), np.linspace(0.0, 0.3, 31)))
    # A chord is as long as the cut's straight rows, so that the tube is developed exactly.
    chord = 2.0 * np.sin(0.5 * 2.0 / 24) * 24 / 2.0

    def worn(radius: float) -> np.ndarray:
        return np.column_stack([radius * np.sin(turn), height, radius * np.cos(turn)])

    first = np.arange(24)[None, :] + 25 * np.arange(30)[:, None]
    faces = np.stack([first, first + 1, first + 26, first + 25], axis=-1).reshape(-1, 4)
    surface = make_surface(worn(0.1), faces, weld=False)
    cosine, sine = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    to_grain = np.array([[cosine, sine], [-sine, cosine]])
    cut = np.column_stack([1.05 * 0.1 * chord * turn, height]) @ to_grain
    grown = np.column_stack([1.1 * 1.05 * 0.1 * chord * turn, height]) @ to_grain
    layout = graded_layout(surface, worn(0.11), cut)
    np.testing.assert_allclose(layout - layout.mean(axis=0), grown - grown.mean(axis=0), atol=2e-6)
    stretched = stretches_worn(surface, cut)
    np.testing.assert_allclose(stretched, np.tile([1.0, 1.0 / 1.05], (len(stretched), 1)), atol=1e-9)


def test_what_does_not_grow_stays_as_it_was_cut():
    """A creased sheet that is turned and moved."""
    rng = np.random.default_rng(3)
    x, y = (each.ravel() for each in np.meshgrid(np.linspace(0.0, 0.2, 21), np.linspace(0.0, 0.3, 31)))
    worn = np.column_stack([x, y, 2e-3 * rng.normal(size=len(x))])
    first = (np.arange(20)[None, :] + 21 * np.arange(30)[:, None]).ravel()
    faces = np.concatenate(
        [np.stack([first, first + 1, first + 22], axis=1), np.stack([first, first + 22, first + 21], axis=1)]
    )
    surface = make_surface(worn, faces, weld=False)
    cut = np.column_stack([x, y]) + 1e-3 * rng.normal(size=(len(x), 2))
    turned = worn @ np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]) + [0.3, 0.0, 1.0]
    np.testing.assert_allclose(graded_layout(surface, turned, cut), cut, atol=1e-6)
