"""Sums over the pieces of arrays on a CUDA device, so that one number per piece is copied to the host."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence

import numpy as np
import warp as wp

from warpflat.core.arrays import FloatArray, IntArray
from warpflat.core.launch import Launch, record
from warpflat.core.launch import Sequence as LaunchSequence
from warpflat.core.sums import range_offsets
from warpflat.kernels.reduce import dot_blocks, least_of_blocks, sum_blocks

__all__ = ["DeviceSums"]


# Values that one thread adds up.
_BLOCK = 64


class DeviceSums:
    """Sums, least values and scalar products over consecutive ranges of arrays on a device.

    Attributes:
        blocks: first value of each block that a thread of the first launch reduces, and the end of the last block.
        first_block: number of the first block of each range, and the count of blocks.
    """

    def __init__(self, counts: Sequence[int], device: wp.Device) -> None:
        """Prepare sums over consecutive ranges of these lengths."""
        self._device, self._begin, self._chain = device, range_offsets(counts), list[wp.array]()
        ends = self._begin
        while True:
            blocks, first = _blocks_of(ends)
            if not self._chain:
                self.first_block = first
            if len(blocks) == len(ends):
                break
            self._chain.append(wp.array(blocks, dtype=wp.int32, device=device))
            ends = first
        self._chain.append(wp.array(ends, dtype=wp.int32, device=device))
        self.blocks = self._chain[0]
        self._rooms = [wp.empty(len(at) - 1, dtype=wp.float64, device=device) for at in self._chain]
        self._host = wp.empty(len(counts), dtype=wp.float64, device="cpu", pinned=device.is_cuda)
        self._known: dict[Hashable, LaunchSequence] = {}

    @property
    def result(self) -> wp.array:
        """#P, the last result, on the device."""
        return self._rooms[-1]

    def sums(self, values: wp.array) -> FloatArray:
        """Return the sum of each range of float64, #P; the array must live as long as this object."""
        return self._of(("sum", id(values)), lambda: self.summing(values))

    def least(self, values: wp.array) -> FloatArray:
        """Return the least value of each range, #P; the array must live as long as this object."""
        return self._of(("least", id(values)), lambda: self._launches(least_of_blocks, [values], least_of_blocks))

    def dots(self, a: wp.array, b: wp.array) -> FloatArray:
        """Return the sum of scalar products of vec2d in each range, #P; the arrays must live as long as this object."""
        return self._of(("dot", id(a), id(b)), lambda: self._launches(dot_blocks, [a, b], sum_blocks))

    def least_after(self, first: Callable[[wp.array], Launch]) -> LaunchSequence:
        """Return launches that leave the least value of each range in `result`; `first` makes the one that fills the blocks."""
        return LaunchSequence([first(self._rooms[0]), *self._rest(least_of_blocks)])

    def of(self, what: LaunchSequence) -> FloatArray:
        """Launch a sequence and return its result, #P."""
        what.launch()
        return self._fetched()

    def summing(self, values: wp.array) -> list[Launch]:
        """Return launches that leave the sums in `result`."""
        return self._launches(sum_blocks, [values], sum_blocks)

    def _of(self, key: Hashable, make: Callable[[], list[Launch]]) -> FloatArray:
        known = self._known.get(key)
        if known is None:
            known = self._known[key] = LaunchSequence(make())
        return self.of(known)

    def _fetched(self) -> FloatArray:
        wp.copy(self._host, self.result)
        if self._device.is_cuda:
            wp.synchronize_stream(self._device)
        return np.array(self._host.numpy())

    def _launches(self, kernel: wp.Kernel, given: Sequence[wp.array], on: wp.Kernel) -> list[Launch]:
        """Return the launch of a kernel over blocks of the values, and those that reduce its results."""
        at, room = self._chain[0], self._rooms[0]
        begun = record(kernel, dim=len(room), inputs=[*given, at], outputs=[room], device=self._device)
        return [begun, *self._rest(on)]

    def _rest(self, kernel: wp.Kernel) -> list[Launch]:
        return [
            record(kernel, dim=len(room), inputs=[before, at], outputs=[room], device=self._device)
            for at, before, room in zip(self._chain[1:], self._rooms, self._rooms[1:], strict=False)
        ]


def _blocks_of(begin: IntArray) -> tuple[IntArray, IntArray]:
    """Return the ends of the blocks of ranges, and the number of each range's first block followed by the count."""
    counts = -(-np.diff(begin) // _BLOCK)
    first = range_offsets(counts)
    inside = np.arange(first[-1]) - np.repeat(first[:-1], counts)
    return np.append(np.repeat(begin[:-1], counts) + _BLOCK * inside, begin[-1]).astype(np.int32), first
