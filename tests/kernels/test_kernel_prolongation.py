"""Between levels: sums, loads and corrections against NumPy."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
import warp as wp
from devices import DEVICE
from numpy.typing import NDArray
from scipy.sparse import csr_array, random_array
from warpflat.kernels.prolongation import Transpose, Weights, coarse_difference, coarse_load, correct, inject, transfer

FINE, COARSE = 40, 13
RNG = np.random.default_rng(1)
MATRIX = csr_array(random_array((FINE, COARSE), density=0.3, rng=RNG))
KEPT = np.sort(RNG.choice(FINE, COARSE, replace=False)).astype(np.int32)


def weights(matrix: csr_array) -> Weights:
    made = Weights()
    made.offset = wp.array(matrix.indptr.astype(np.int32), dtype=wp.int32, device=DEVICE)
    made.column = wp.array(matrix.indices.astype(np.int32), dtype=wp.int32, device=DEVICE)
    made.weight = wp.array(matrix.data, dtype=wp.float64, device=DEVICE)
    return made


def transpose(matrix: csr_array) -> Transpose:
    row, column = matrix.tocoo().coords
    entry = np.lexsort([row, column]).astype(np.int32)
    made = Transpose()
    made.offset = wp.array(
        np.searchsorted(column[entry], np.arange(matrix.shape[1] + 1)), dtype=wp.int32, device=DEVICE
    )
    made.row = wp.array(row[entry].astype(np.int32), dtype=wp.int32, device=DEVICE)
    made.entry = wp.array(entry, dtype=wp.int32, device=DEVICE)
    return made


def vectors(count: int, seed: int) -> NDArray[np.float64]:
    return np.random.default_rng(seed).normal(size=(count, 2))


def launched(kernel: wp.Kernel, dim: int, *inputs: object, pieces: int = 1) -> NDArray[np.float64]:
    """What the kernel writes, launched in so many pieces."""
    given = [
        wp.array(value, dtype=wp.int32 if value.dtype == np.int32 else wp.vec2d, device=DEVICE)
        if isinstance(value, np.ndarray)
        else value
        for value in inputs
    ]
    result = wp.zeros(dim, dtype=wp.vec2d, device=DEVICE)
    bounds = np.linspace(0, dim, pieces + 1).astype(int)
    for first, end in pairwise(bounds):
        wp.launch(kernel, dim=int(end - first), inputs=[*given, int(first)], outputs=[result], device=DEVICE)
    return np.array(result.numpy())


@pytest.mark.parametrize("pieces", [1, 3])
def test_a_transfer_is_a_product_with_the_matrix(pieces: int):
    coarse = vectors(COARSE, 2)
    up = launched(transfer, FINE, weights(MATRIX), coarse, pieces=pieces)
    np.testing.assert_allclose(up, MATRIX @ coarse, atol=1e-14)


@pytest.mark.parametrize("pieces", [1, 3])
def test_under_its_load_a_coarse_level_has_the_residual_of_the_fine_one(pieces: int):
    residual, force = vectors(FINE, 4), vectors(COARSE, 5)
    load = launched(coarse_load, COARSE, weights(MATRIX), transpose(MATRIX), residual, force, pieces=pieces)
    np.testing.assert_allclose(load + force, MATRIX.T @ residual, atol=1e-14)


def test_places_go_down_and_differences_come_back():
    fine, coarse = vectors(FINE, 6), vectors(COARSE, 7)
    np.testing.assert_array_equal(launched(inject, COARSE, KEPT, fine), fine[KEPT])
    np.testing.assert_array_equal(launched(coarse_difference, COARSE, KEPT, fine, coarse), coarse - fine[KEPT])


def test_a_correction_moves_only_where_a_vertex_is_free():
    base, way = vectors(FINE, 8), vectors(FINE, 9)
    freedom = np.ones((FINE, 2))
    freedom[::3, 0] = 0.0
    np.testing.assert_allclose(
        launched(correct, FINE, base, way, 0.25, freedom), base + 0.25 * way * freedom, atol=1e-15
    )
