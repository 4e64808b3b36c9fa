"""Unit vectors, and points that are laid upon others."""

import numpy as np

from warpflat.core.vectors import laid_upon, unit


def test_points_are_found_again_wherever_they_lie():
    target = np.random.default_rng(0).normal(size=(20, 2))
    c, s = np.cos(2.0), np.sin(2.0)
    there = target @ [[c, s], [-s, c]] + [3.0, -1.0]
    np.testing.assert_allclose(laid_upon(target, there), target, atol=1e-12)
    # By some of them, and in space.
    known = np.arange(20) < 6
    np.testing.assert_allclose(laid_upon(target[known], there, known), target, atol=1e-12)
    space = np.random.default_rng(1).normal(size=(9, 3))
    np.testing.assert_allclose(laid_upon(space, space[:, [1, 2, 0]]), space, atol=1e-12)


def test_a_mirror_image_is_not_turned_over():
    target = np.random.default_rng(2).normal(size=(20, 2))
    mirrored = laid_upon(target, target * [-1.0, 1.0])
    a, b = mirrored[1] - mirrored[0], mirrored[17] - mirrored[0]
    u, v = target[1] - target[0], target[17] - target[0]
    assert np.sign(a[0] * b[1] - a[1] * b[0]) == -np.sign(u[0] * v[1] - u[1] * v[0])


def test_what_has_no_length_stays_without():
    np.testing.assert_allclose(unit(np.array([[3.0, 4.0], [0.0, 0.0]])), [[0.6, 0.8], [0.0, 0.0]])
