"""Landmarks of the test bodies by vertices of the mesh that they share: seen once, they hold on every mix, scaling and pose.

Elbow and knee lie between the two rings of edges at which all four bodies bend most: the shape of one body's joint may
mislead, its vertices do not. The fold under the bust is four vertices on the woman, and the same four on everybody; bust points are the
middles of two rings.
"""

from __future__ import annotations

import numpy as np

# The first edge of each ring: at the wrist, below and above the elbow, at the upper arm; below and above the knee.
_ARM = {
    "left": ((10567, 10566), (10544, 10050), (10545, 10032), (10516, 10455)),
    "right": ((3902, 3901), (3879, 3382), (3880, 3364), (3851, 3789)),
}
_KNEE = {"left": ((11237, 11239), (11218, 11220)), "right": ((4619, 4621), (4600, 4602))}
_FOLD = (8538, 8539, 1866, 1867)
# The rings around both bust points.
_BUST = (*range(8450, 8466), *range(1778, 1794))


class Landmarks:
    """Landmarks of bodies with these faces, #F by 4, -1 in the last column for a triangle."""

    def __init__(self, faces: np.ndarray) -> None:
        self._near: dict[int, set[int]] = {}
        self._quads: dict[frozenset[int], set[int]] = {}
        for i, quad in enumerate(faces[faces[:, 3] >= 0].tolist()):
            for a, b in zip(quad, quad[1:] + quad[:1], strict=True):
                self._near.setdefault(a, set()).add(b)
                self._near.setdefault(b, set()).add(a)
                self._quads.setdefault(frozenset((a, b)), set()).add(i)
        self._arm = {side: [self._ring(*start) for start in starts] for side, starts in _ARM.items()}
        self._knee = {side: [self._ring(*start) for start in starts] for side, starts in _KNEE.items()}

    def bones(self, points: np.ndarray, side: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the middles of wrist and elbow [m] and the unit direction of the upper arm from there."""
        wrist, below, above, upper = (points[ring].mean(axis=0) for ring in self._arm[side])
        elbow = 0.5 * (below + above)
        return wrist, elbow, (upper - elbow) / np.linalg.norm(upper - elbow)

    def knee(self, points: np.ndarray, side: str) -> float:
        """Return the height [m] of a knee."""
        return float(np.mean([points[ring, 1].mean() for ring in self._knee[side]]))

    def fold(self, points: np.ndarray) -> float:
        """Return the height [m] of the fold under the bust."""
        return float(points[list(_FOLD), 1].mean())

    def bust(self, points: np.ndarray) -> float:
        """Return the height [m] of the bust points."""
        return float(points[list(_BUST), 1].mean())

    def _ring(self, first: int, second: int) -> list[int]:
        """Return the closed ring of edges that starts with an edge and runs straight through vertices of four quads."""
        path = [first, second]
        while True:
            before, at = path[-2:]
            beside = self._quads[frozenset((before, at))]
            ahead = [v for v in self._near[at] if v != before and not beside & self._quads[frozenset((at, v))]]
            if len(self._near[at]) != 4 or len(ahead) != 1:
                raise ValueError(f"the ring from {first} ends at vertex {at}")
            if ahead[0] == first:
                return path
            path.append(ahead[0])
