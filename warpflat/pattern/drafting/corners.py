"""Corners of a border, and the cracks in it whose legs are those of a dart."""

from __future__ import annotations

import numpy as np

from warpflat.core import FloatArray, IndexArray

__all__ = ["find_corners", "find_cracks"]


#: A border vertex that turns by more than this [rad] is a corner.
CORNER = np.radians(35.0)
#: A corner is measured over this much border [m] on either side: single steps of a ragged border turn anywhere.
WINDOW = 0.012
#: Over a narrow end, from one corner to another within the window, the border turns by more than this [rad].
END = np.radians(135.0)
#: A border that turns back by more than this [rad] is the tip of a crack: a dart that opens by less than 40 degrees.
TIP = np.radians(140.0)
#: The two legs of a crack are as long as each other, within this share.
LEGS = 0.05


class _Border:
    """A closed border, unrolled three times, so that there are places before and after each of the middle round.

    Attributes:
        window: length over which a corner is measured [m].
        places: #P, indices of the middle round.
        along: length [m] up to each place.
    """

    def __init__(self, ring: FloatArray) -> None:
        step = np.linalg.norm(np.roll(ring, -1, axis=0) - ring, axis=1)
        self.ring, self.count = ring, len(ring)
        self.length = float(step.sum())
        self.window = min(WINDOW, self.length / 24)
        self.places = np.arange(self.count, 2 * self.count)
        self.along = np.concatenate([[0.0], np.cumsum(np.tile(step, 3))])[: 3 * self.count]

    def before(self, places: IndexArray, reach: float | FloatArray) -> IndexArray:
        """Return the farthest places within `reach` [m] before others, but at least one step away."""
        return np.minimum(np.searchsorted(self.along, self.along[places] - reach - 1e-12), places - 1)

    def after(self, places: IndexArray, reach: float | FloatArray) -> IndexArray:
        """Return the farthest places within `reach` [m] after others, but at least one step away."""
        return np.maximum(np.searchsorted(self.along, self.along[places] + reach + 1e-12, side="right") - 1, places + 1)

    def turning(self, before: IndexArray, at: IndexArray, after: IndexArray) -> FloatArray:
        """Return the angle [rad] by which chords over places `before`, `at` and `after` turn, positive to the left."""
        a, b, c = (self.ring[places % self.count] for places in (before, at, after))
        arrive, leave = b - a, c - b
        cross = arrive[:, 0] * leave[:, 1] - arrive[:, 1] * leave[:, 0]
        return np.asarray(np.arctan2(cross, np.einsum("ij,ij->i", arrive, leave)))

    def turning_at_vertices(self) -> FloatArray:
        """Return the angle [rad] by which the border turns at each vertex, over the window on either side."""
        here = self.places
        return self.turning(self.before(here, self.window), here, self.after(here, self.window))

    def distance(self, one: IndexArray | int, other: int) -> FloatArray:
        """Return the length [m] of border between vertices, the shorter way round."""
        between = np.abs(self.along[one] - self.along[other])
        return np.minimum(between, self.length - between)


def find_corners(ring: FloatArray) -> set[int]:
    """Return vertices where the border turns by more than :data:`CORNER`, and most within the window around them."""
    border = _Border(ring)
    turns = np.abs(border.turning_at_vertices())
    # The corners at the ends of straps, ties and bindings lie within one window of each other, and the border turns back
    # between them by more than `END`. A tooth of a ragged border turns back too, but the border turns the other way beside
    # it. Each corner turns by more than `CORNER` over a quarter of the distance to the other one, as no rounded end does.
    found: list[tuple[float, float, int, int]] = []
    for steps in range(1, border.count // 2):
        one, other = border.places, border.places + steps
        close = border.along[other] - border.along[one] <= border.window + 1e-12
        if not close.any():
            break
        one, other = one[close], other[close]
        distance_between = border.along[other] - border.along[one]
        triples = [(border.before(one, border.window), one, other), (one, other, border.after(other, border.window))]
        triples += [
            (border.before(at, distance_between / 4), at, border.after(at, distance_between / 4)) for at in (one, other)
        ]
        turned = np.stack([border.turning(*triple) for triple in triples])
        total = turned[0] + turned[1]
        sharp = (np.sign(total) * turned).min(axis=0)
        for k in np.flatnonzero((sharp > CORNER) & (np.abs(total) > END)).tolist():
            found.append(
                (-float(sharp[k]), float(distance_between[k]), int(one[k]) % border.count, int(other[k]) % border.count)
            )
    corners: list[int] = []
    for _, distance, *pair in sorted(found):
        if all(border.distance(i, j) > distance / 2 for i in pair for j in corners if i != j):
            corners += [i for i in pair if i not in corners]
    taken = np.zeros(border.count, dtype=bool)
    taken[corners] = True
    for i in sorted(np.flatnonzero(turns > CORNER).tolist(), key=lambda i: (-turns[i], i)):
        # The window of a corner shows in its neighbours' turns too; the next vertex of a coarse border does not.
        taken[i] |= bool((border.distance(np.flatnonzero(taken), i) > border.window).all())
    return set(np.flatnonzero(taken).tolist())


def find_cracks(ring: FloatArray, corners: set[int], known: set[int]) -> list[tuple[int, int, int]]:
    """Find sharp inward tips between two legs of equal length that end in the nearest corners.

    Args:
        ring: #P by 2 [m], a closed border, counter-clockwise.
        corners: vertices of its corners.
        known: tips that are darts already.

    Returns:
        For each the left mouth, the tip and the right mouth.
    """
    border, count, found = _Border(ring), len(ring), []
    for tip in np.flatnonzero(border.turning_at_vertices() < -TIP).tolist():
        if tip in known:
            continue
        left = next((k for k in range(1, count) if (tip - k) % count in corners), 0)
        right = next((k for k in range(1, count) if (tip + k) % count in corners), 0)
        legs = np.diff(border.along[count + tip + np.array([-left, 0, right])])
        if left and right and abs(legs[0] - legs[1]) <= LEGS * legs.max():
            found.append(((tip - left) % count, tip, (tip + right) % count))
    return found
