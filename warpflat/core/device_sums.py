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


# So many values one thread goes through.
_BLOCK = 64


class DeviceSums:
    """Sums, least values and scalar products of each of several ranges, one after the other, of arrays on a device.

    Attributes:
        blocks: where the blocks begin that a first launch goes through, and the last one ends. first_block: of each range the first.
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
        """#P, where the last result is on the device."""
        return self._rooms[-1]

    def sums(self, values: wp.array) -> FloatArray:
        """#P, of float64; the array is to be there as long as this is."""
        return self._of(("sum", id(values)), lambda: self.summing(values))

    def least(self, values: wp.array) -> FloatArray:
        """#P, the least of each; likewise."""
        return self._of(("least", id(values)), lambda: self._launches(least_of_blocks, [values], least_of_blocks))

    def dots(self, a: wp.array, b: wp.array) -> FloatArray:
        """#P, sums of the scalar products of vec2d; likewise."""
        return self._of(("dot", id(a), id(b)), lambda: self._launches(dot_blocks, [a, b], sum_blocks))

    def least_after(self, first: Callable[[wp.array], Launch]) -> LaunchSequence:
        """What puts the least of each range where `result` is, of values for each block, which a launch puts where it is told to."""
        return LaunchSequence([first(self._rooms[0]), *self._rest(least_of_blocks)])

    def of(self, what: LaunchSequence) -> FloatArray:
        """#P, the result of this."""
        what.launch()
        return self._fetched()

    def summing(self, values: wp.array) -> list[Launch]:
        """What puts the sums where `result` is."""
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
        """The kernel over blocks of the values, and what goes on with its results."""
        at, room = self._chain[0], self._rooms[0]
        begun = record(kernel, dim=len(room), inputs=[*given, at], outputs=[room], device=self._device)
        return [begun, *self._rest(on)]

    def _rest(self, kernel: wp.Kernel) -> list[Launch]:
        return [
            record(kernel, dim=len(room), inputs=[before, at], outputs=[room], device=self._device)
            for at, before, room in zip(self._chain[1:], self._rooms, self._rooms[1:], strict=False)
        ]


def _blocks_of(begin: IntArray) -> tuple[IntArray, IntArray]:
    """Where the blocks of ranges begin, and the last one ends; of each range the first block, and how many there are."""
    counts = -(-np.diff(begin) // _BLOCK)
    first = range_offsets(counts)
    inside = np.arange(first[-1]) - np.repeat(first[:-1], counts)
    return np.append(np.repeat(begin[:-1], counts) + _BLOCK * inside, begin[-1]).astype(np.int32), first
