"""Rounding noise: what linear solves and reductions return, as if another processor had rounded it.

    python -m pytest -q tests/flat/solver --rounding 1         the tests under the noise of a seed
    python tests/rounding.py 1 run scenes/dome.toml       a command under it
    python benchmarks/goldens.py --rounding 1 2 3         goldens under three

BLAS has kernels for each processor, which add in other orders, and so do vectorised loops. Here each number is multiplied by
1 + 1e-14 z, single precision by as many of its own units. z is a normal deviate that follows from the seed, the number's bits and
its place in the array: the same sum gets the same noise again, as on one processor, and a piece and its mirror image do not. Whole
numbers stay: their sums are exact on every processor.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import wraps
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["RoundingNoise", "disturb"]

NOISE = 1e-14  # of double precision, relative
DEVIATES = 1 << 16

# Where the package gets its solves and reductions. NumPy's own methods, as `a.sum()` and `a @ b`, cannot be reached.
DOORS = {
    "numpy": ("average", "bincount", "convolve", "dot", "einsum", "inner", "mean", "sum", "tensordot", "vdot"),
    "numpy.linalg": ("det", "eigh", "eigvalsh", "inv", "lstsq", "norm", "pinv", "solve", "svd"),
    "scipy.linalg": ("cho_solve", "lstsq", "solve", "solve_banded", "solve_triangular", "solveh_banded"),
    "scipy.sparse.linalg": ("cg", "factorized", "splu", "spsolve"),
}


class RoundingNoise:
    """Multiplies numbers by 1 + 1e-14 z."""

    def __init__(self, seed: int) -> None:
        """Draw the deviates of a seed."""
        self._deviates = np.random.default_rng(seed).standard_normal(DEVIATES)

    def of_array(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return floating numbers of any shape with noise; others as they are."""
        if values.dtype not in (np.float32, np.float64):
            return values
        relative = NOISE * np.finfo(values.dtype).eps / np.finfo(np.float64).eps
        flat = values.ravel()
        bits = flat.view(f"u{values.dtype.itemsize}") + np.arange(flat.size, dtype=np.uint64)
        # Multiplicative hashing (Knuth, The Art of Computer Programming 6.4): the upper bits of a product with the golden ratio.
        key = bits * np.uint64(0x9E3779B97F4A7C15) >> np.uint64(64 - 16)
        change = (flat * (relative * self._deviates[key])).astype(values.dtype)
        # What is infinite stays so.
        return (flat + np.where(flat != np.rint(flat), change, 0)).reshape(values.shape)

    def of(self, result: Any) -> Any:
        """Return what a solve or a reduction has returned with noise: numbers, several of them, a factor, a solver."""
        if isinstance(result, np.floating):
            return result.dtype.type(self.of_array(np.asarray(result)))
        if isinstance(result, np.ndarray):
            return self.of_array(result)
        if isinstance(result, tuple):
            parts = [self.of(part) for part in result]
            return type(result)(*parts) if hasattr(result, "_fields") else tuple(parts)
        if hasattr(result, "solve"):
            return _Factor(result, self)
        return self.after(result) if callable(result) else result

    def after(self, function: Callable[..., Any]) -> Callable[..., Any]:
        """Return a function whose results have noise."""

        @wraps(function)
        def disturbed(*given: Any, **options: Any) -> Any:
            result = function(*given, **options)
            arrays = [one for one in given if isinstance(one, np.ndarray)]
            if isinstance(result, np.ndarray) and any(np.may_share_memory(one, result) for one in arrays):
                return result  # a view, no sum
            noisy, out = self.of(result), options.get("out")
            if out is None:
                return noisy
            out[...] = noisy
            return out

        return disturbed


class _Factor:
    """SuperLU's factor, whose solutions have noise."""

    def __init__(self, factor: Any, noise: RoundingNoise) -> None:
        self._factor, self.solve = factor, noise.after(factor.solve)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._factor, name)


def disturb(seed: int) -> None:
    """Let all solves and reductions of this process, and of its forks, have the noise of a seed; before the package is loaded."""
    assert "warpflat.core.sparse" not in sys.modules, "the package has fetched its functions already"
    noise = RoundingNoise(seed)
    for name, functions in DOORS.items():
        module = import_module(name)
        for function in functions:
            setattr(module, function, noise.after(getattr(module, function)))


if __name__ == "__main__":
    disturb(int(sys.argv[1]))
    from warpflat.app.cli.main import main

    sys.exit(main(sys.argv[2:]))
