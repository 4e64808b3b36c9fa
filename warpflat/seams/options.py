"""How seams are looked for; known before anything is computed, so that a scene can be checked."""

from __future__ import annotations

from dataclasses import dataclass

from warpflat.core.errors import InputError, nearest

__all__ = ["DIRECTIONS", "SeamOptions"]

DIRECTIONS = ("+x", "-x", "+y", "-y", "+z", "-z")


@dataclass(frozen=True, kw_only=True)
class SeamOptions:
    """How seams are looked for.

    Attributes:
        up, front: directions as "+y" and "+z"; found from the shape if not given.
        no: seams that are left closed, by name, as "shoulder" or "shoulder left"; "dart" for no darts.
        limit: share of the cloth that may stay beyond its strain limit before further seams and darts are looked for.
        smooth: wrinkles of draped or scanned cloth are smoothed over this length before anything is cut [m]; 0 leaves them.
        most_pieces: at most so many of one layer; as many as are usual for its kind if not given.
    """

    up: str | None = None
    front: str | None = None
    no: tuple[str, ...] = ()
    limit: float = 0.02
    most_pieces: int | None = None
    smooth: float = 0.0

    def forbids(self, seam: str) -> bool:
        """Return whether a seam is to be left closed."""
        return any(seam == no or seam.startswith(f"{no} ") for no in self.no)

    def validate(self) -> None:
        """Check the options.

        Raises:
            InputError: an unknown direction, or both along one axis.
        """
        for key, value in (("up", self.up), ("front", self.front)):
            if value is not None and value not in DIRECTIONS:
                raise InputError(f"{key} = {value!r} is no direction; {nearest(str(value), DIRECTIONS)}")
        if not 0.0 <= self.smooth <= 0.1:
            raise InputError(f"smooth = {1e3 * self.smooth:g} mm is out of range; it lies between 0 and 100 mm")
        if not 0.0 <= self.limit <= 1.0:
            raise InputError(f"limit = {self.limit:g} is no share of the cloth; it lies between 0 and 1")
        if self.most_pieces is not None and not 1 <= self.most_pieces <= 1000:
            raise InputError(f"most_pieces = {self.most_pieces} is no number of pieces from 1 to 1000")
        if self.up and self.front and self.up[1] == self.front[1]:
            raise InputError(
                f"up = {self.up!r} and front = {self.front!r} lie along one axis; they are at right angles"
            )
