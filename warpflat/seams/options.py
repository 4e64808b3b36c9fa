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
        no: seams that are left closed, by name, as "shoulder" or "shoulder left".
    """

    up: str | None = None
    front: str | None = None
    no: tuple[str, ...] = ()

    def validate(self) -> None:
        """Check the options.

        Raises:
            InputError: an unknown direction, or both along one axis.
        """
        for key, value in (("up", self.up), ("front", self.front)):
            if value is not None and value not in DIRECTIONS:
                raise InputError(f"{key} = {value!r} is no direction; {nearest(str(value), DIRECTIONS)}")
        if self.up and self.front and self.up[1] == self.front[1]:
            raise InputError(
                f"up = {self.up!r} and front = {self.front!r} lie along one axis; they are at right angles"
            )
