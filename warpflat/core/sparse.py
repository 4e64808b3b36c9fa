"""Factors of sparse symmetric matrices."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.sparse import csc_array, eye_array
from scipy.sparse.linalg import splu

from warpflat.core.arrays import FloatArray
from warpflat.core.errors import StepError

__all__ = ["factor_symmetric"]

# What a singular matrix gets on its diagonal, as a share of its largest entry there.
_HELD = 1e-10


def factor_symmetric(matrix: Any, *, dtype: type[np.floating] = np.float64) -> Callable[[FloatArray], FloatArray]:
    """Factor a positive definite or quasi-definite matrix (#N by #N), and return the solution for right sides of #N or #N by #K.

    In single precision (`dtype`) the factor takes half of the memory. Its solution is good to a few digits, enough for a preconditioner.

    Minimum degree on A + A^T fills the least. By default SuperLU joins the last ten columns of each branch of its elimination tree into one
    dense block, as it expects of another order of the columns; that makes a factor of slivers six times as slow, so each column is its own.

    Raises:
        StepError: the matrix is singular even with next to nothing on its diagonal, or its numbers are not finite.
    """

    def factored(system: csc_array) -> Any:
        options = {"SymmetricMode": True}
        return splu(system, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, relax=1, options=options)

    system = csc_array(matrix, dtype=dtype)
    if not np.isfinite(system.data).all():
        raise StepError("faces are crushed until their stiffness is beyond all numbers")
    try:
        factor = factored(system)
    except RuntimeError:
        # A row without any stiffness, as of cloth far smaller than the rest, is held by next to nothing.
        held = max(float(np.abs(system.diagonal()).max(initial=0.0)), 1e-30) * _HELD
        try:
            factor = factored(csc_array(system + held * eye_array(system.shape[0], format="csc", dtype=dtype)))
        except RuntimeError as error:
            raise StepError(
                "faces are too small or too far from the rest for their stiffness: leave them out, or repair the mesh"
            ) from error
    # SuperLU returns its solution column by column; rows of two or three numbers are what all else takes.
    return lambda right: np.ascontiguousarray(factor.solve(np.ascontiguousarray(right, dtype=dtype)), dtype=np.float64)
