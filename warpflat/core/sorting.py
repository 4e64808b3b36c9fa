"""Sorting of whole numbers, faster than NumPy's general sorts."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpflat.core.arrays import IntArray

__all__ = ["counting_sort", "sort_with_order", "stable_argsort"]


def counting_sort(keys: IntArray, count: int) -> tuple[IntArray, IntArray]:
    """Sort whole numbers by counting them.

    It is done by transposing a sparse matrix with one entry in each row.

    Args:
        keys: #N, whole numbers from 0 to below `count`.
        count: of the different numbers there may be.

    Returns:
        #N, the stable order that sorts the keys; #count+1, where the entries of each number begin in it.
    """
    from scipy.sparse import csr_array

    rows = np.arange(len(keys) + 1, dtype=np.int32)
    by_key = csr_array((np.empty(len(keys), dtype=np.int8), keys, rows), shape=(len(keys), count)).tocsc()
    return by_key.indices, by_key.indptr


def stable_argsort(keys: NDArray[np.integer]) -> NDArray[np.int64]:
    """Return the order that a stable argsort gives, several times as fast, for whole numbers from 0 on."""
    return sort_with_order(keys)[1]


def sort_with_order(keys: NDArray[np.integer]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return whole numbers from 0 on, sorted, and the stable order that sorts them.

    Sorting numbers is several times as fast as finding their order, so each number gets its index as its last digits.
    """
    digits = len(keys).bit_length()
    if int(keys.max(initial=0)).bit_length() + digits > 63:
        order = np.argsort(keys, kind="stable")
        return keys[order].astype(np.int64), order
    with_index = keys.astype(np.int64)
    with_index <<= digits
    with_index |= np.arange(len(keys))
    with_index.sort()
    order = with_index & ((1 << digits) - 1)
    with_index >>= digits
    return with_index, order
