"""What worn cloth is asked for, as shares of its fabric's limits: every verdict counts by this."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from warpflat.core.arrays import BoolArray, FloatArray
from warpflat.flat.fabric.fabric import Fabric

__all__ = ["Amount", "Demand", "Way"]

Way = Literal["warp", "weft", "shear", "principal"]

# Cloth that is held at its limit, as by an intended stretch, is not beyond it by rounding.
_AT_LIMIT = 1.0 + 1e-8


@dataclass(frozen=True, kw_only=True, eq=False)
class Demand:
    """What is asked of worn cloth, place by place, as shares of its limits.

    Attributes:
        fabric: the cloth.
        ways: what the columns of `shares` are. Cloth is strained along warp and along weft and sheared between them. An
            isotropic sheet has no threads: it is strained along its principal directions.
        shares: #C by #ways, what is asked over what the fabric allows, signed; beyond 1 or -1 it is more.
    """

    fabric: Fabric
    ways: tuple[Way, ...]
    shares: FloatArray

    @classmethod
    def of(cls, fabric: Fabric, strain_warp: FloatArray, strain_weft: FloatArray, shear: FloatArray) -> Demand:
        """Measure the demand of worn strains.

        Args:
            fabric: the cloth.
            strain_warp, strain_weft: #C, length worn over length flat along the threads, minus 1.
            shear: #C, angle by which worn warp and weft are off the right angle [degrees].
        """
        if not fabric.is_isotropic:
            used = [strain_warp / fabric.strain_limit, strain_weft / fabric.strain_limit, shear / fabric.shear_limit]
            return cls(fabric=fabric, ways=("warp", "weft", "shear"), shares=np.column_stack(used))
        # Squared principal stretches are the eigenvalues of F^T F.
        warp, weft = 1.0 + strain_warp, 1.0 + strain_weft
        middle, half = 0.5 * (warp**2 + weft**2), 0.5 * (warp**2 - weft**2)
        radius = np.hypot(half, warp * weft * np.sin(np.radians(shear)))
        stretches = np.sqrt(np.maximum(np.column_stack([middle + radius, middle - radius]), 0.0))
        return cls(fabric=fabric, ways=("principal", "principal"), shares=(stretches - 1.0) / fabric.strain_limit)

    @property
    def beyond(self) -> BoolArray:
        """#C, true where the cloth is beyond a limit."""
        return np.asarray(self.beyond_by_way.any(axis=1))

    @property
    def beyond_by_way(self) -> BoolArray:
        """#C by #ways, true where the cloth is beyond that limit."""
        return np.asarray(np.abs(self.shares) > _AT_LIMIT)

    @property
    def held_by_way(self) -> BoolArray:
        """#C by #ways, true where that limit holds the cloth: stretched or sheared beyond it. Slack cloth folds instead."""
        return np.asarray(self.held_shares > _AT_LIMIT)

    @property
    def held(self) -> BoolArray:
        """#C, true where the cloth is held beyond a limit."""
        return np.asarray(self.held_by_way.any(axis=1))

    @property
    def slack(self) -> BoolArray:
        """#C, true where the cloth is longer than the surface by more than its limit, and not held beyond another one."""
        return np.asarray(self.beyond & ~self.held)

    @cached_property
    def most(self) -> FloatArray:
        """#C, the largest share of a limit, unsigned."""
        return np.asarray(np.abs(self.shares).max(axis=1))

    @cached_property
    def held_shares(self) -> FloatArray:
        """#C by #ways, the shares of the limits that hold the cloth: those of stretched threads, and of shear, unsigned."""
        shear = np.array([way == "shear" for way in self.ways])
        return np.asarray(np.where(shear, np.abs(self.shares), self.shares))

    def outside(self, area: FloatArray) -> float:
        """Return the share of the cloth that is beyond a limit, by the area of each place, #C [m2]."""
        return float(area[self.beyond].sum() / max(float(area.sum()), 1e-300))

    def amount(self, place: int, way: int) -> Amount:
        """Return what is asked at a place in one way, a column of `shares`."""
        limit = self.fabric.shear_limit if self.ways[way] == "shear" else self.fabric.strain_limit
        return Amount(way=self.ways[way], value=float(self.shares[place, way]) * limit, limit=limit)


@dataclass(frozen=True, kw_only=True)
class Amount:
    """What is asked of cloth at one place in one way.

    Attributes:
        way: along warp or weft, in shear, or along a principal direction.
        value: strain, or shear [degrees].
        limit: the fabric's, in the same unit.
    """

    way: Way
    value: float
    limit: float

    @property
    def state(self) -> str:
        """ "stretched", "slack" or "sheared"."""
        return "sheared" if self.way == "shear" else "stretched" if self.value > 0.0 else "slack"

    @property
    def words(self) -> str:
        """The amount, such as "6.1 % along warp" or "18.2 degrees"."""
        if self.way == "shear":
            return f"{abs(self.value):.1f} degrees"
        return f"{100 * abs(self.value):.1f} %" + ("" if self.way == "principal" else f" along {self.way}")

    @property
    def limit_words(self) -> str:
        """The limit, such as "5 %" or "15 degrees"."""
        return f"{self.limit:.3g} degrees" if self.way == "shear" else f"{100 * self.limit:.3g} %"
