"""Options of a drape."""

from __future__ import annotations

from dataclasses import dataclass

from warpflat.core import InputError, is_number

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

    def __post_init__(self) -> None:
        bounds = {
            "friction": (0.0, 2.0), "compression": (0.001, 1.0), "tolerance": (1e-6, 1.0), "max_steps": (1, 10_000_000),
            "gravity": (0.1, 100.0),
        }  # fmt: skip
        for name, (lowest, highest) in bounds.items():
            value = getattr(self, name)
            if not is_number(value) or not lowest <= value <= highest:
                raise InputError(f"drape: {name} = {value!r}; must be a number between {lowest:g} and {highest:g}")
