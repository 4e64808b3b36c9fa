"""Options of a drape."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from warpflat.core import expect_within

__all__ = ["DrapeOptions"]


@dataclass(frozen=True, kw_only=True)
class DrapeOptions:
    """Options of a drape.

    Attributes:
        friction: Coulomb's coefficient of cloth on the body; a lined garment on skin has .2 to .4.
        compression: largest share of the tensile stiffness that is left under compression. Cloth wrinkles at a scale
            finer than the mesh, as in a tension field; at full stiffness the mesh chatters and does not come to rest.
        tolerance: the cloth is at rest when the mean force that is left is at most this share of a vertex's weight.
        max_steps: of dynamic relaxation.
        gravity: [m/s2].
    """

    friction: float = 0.3
    compression: float = 0.1
    tolerance: float = 5e-3
    max_steps: int = 20_000
    gravity: float = 9.80665

    #: Least and largest value of each; a scene's `[drape]` has the same.
    BOUNDS: ClassVar[Mapping[str, tuple[float, float]]] = {
        "friction": (0, 2), "compression": (0.001, 1), "tolerance": (1e-6, 1), "max_steps": (1, 10_000_000),
        "gravity": (0.1, 100),
    }  # fmt: skip

    def __post_init__(self) -> None:
        expect_within(self, self.BOUNDS, "drape")
