"""Indices that are known not to be negative.

Warp counts a negative index from the end of an array. Where it cannot rule that out, it asks at each access; `natural` rules it out. A
`for` over a range that is known only when a kernel runs is counted on in memory, a `while` in a register. Loops over what lies around a
vertex are written so: forces and steps take two thirds of the time.
"""

import warp as wp

wp.set_module_options({"enable_backward": False})


@wp.func
def natural(number: int):
    """The number, which is 0 or more."""
    return wp.max(number, 0)
