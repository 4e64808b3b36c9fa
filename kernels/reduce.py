"""Sums over blocks of an array, for devices from which copying arrays would be slow.

One thread goes through a block in order, so that a sum repeats bit for bit; sums of sums are taken until few are left.
"""

import warp as wp

wp.set_module_options({"enable_backward": False})


@wp.kernel
def sum_blocks(
    values: wp.array(dtype=wp.float64),
    begin: wp.array(dtype=wp.int32),
    first: int,
    # outputs
    total: wp.array(dtype=wp.float64),
):
    """Sum each block. begin: #B+1, where blocks begin and the last one ends. total: #B."""
    b = wp.tid() + first
    s = wp.float64(0.0)
    for i in range(begin[b], begin[b + 1]):
        s += values[i]
    total[b] = s


@wp.kernel
def subtract(
    a: wp.array(dtype=wp.vec2d),
    b: wp.array(dtype=wp.vec2d),
    first: int,
    # outputs
    difference: wp.array(dtype=wp.vec2d),
):
    """Compute a - b, all #V."""
    i = wp.tid() + first
    difference[i] = a[i] - b[i]
