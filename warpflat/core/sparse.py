"""Factors of sparse symmetric matrices."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.sparse import csc_array
from scipy.sparse.linalg import splu

from warpflat.core.arrays import FloatArray

__all__ = ["factor_symmetric"]


def factor_symmetric(matrix: Any, *, dtype: type[np.floating] = np.float64) -> Callable[[FloatArray], FloatArray]:
    """Factor a positive definite or quasi-definite matrix (#N by #N), and return the solution for right sides of #N or #N by #K.

    In single precision (`dtype`) the factor takes half of the memory. Its solution is good to a few digits, enough for a preconditioner.

    Minimum degree on A + A^T fills the least. By default SuperLU joins the last ten columns of each branch of its elimination tree into one
    dense block, as it expects of another order of the columns; that makes a factor of slivers six times as slow, so each column is its own.
    """
    factor = splu(
        csc_array(matrix, dtype=dtype),
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        relax=1,
        options={"SymmetricMode": True},
    )
    # SuperLU returns its solution column by column; rows of two or three numbers are what all else takes.
    return lambda right: np.ascontiguousarray(factor.solve(np.ascontiguousarray(right, dtype=dtype)), dtype=np.float64)
