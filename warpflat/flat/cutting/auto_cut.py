"""The table `[auto_cut]` of a scene: when a piece that is cut by itself needs no further cut."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from pydantic import Field

from warpflat.core.sums import weighted_percentile
from warpflat.core.toml_file import Table

if TYPE_CHECKING:
    from warpflat.flat.flattening.result import Flattening

__all__ = ["AutoCutTable", "RankedBy"]

RankedBy = Literal["released", "per_cm"]


class AutoCutTable(Table):
    """Cutting by itself: the best of all candidates, again and again until it is enough (see `warpflat cuts`)."""

    max_cuts: Annotated[int, Field(ge=1, le=20)] = 2
    """At most so many; a mirrored pair counts as one."""
    stop_below: Annotated[float, Field(ge=0.0)] = 0.0
    """A piece of at most this model energy needs no further cut [J]."""
    stop_below_strain: Annotated[float, Field(ge=0.0)] = 0.0
    """A piece of which 98 % is strained by at most this share along warp and weft, as worn, needs no further cut."""
    by: RankedBy = "released"
    """What makes a cut the best: the energy it releases in all, or per centimetre."""

    def is_enough(self, result: Flattening) -> bool:
        """Return whether a piece needs no further cut."""
        worn = result.worn
        strain = np.abs(worn.strain[:, :2]).max(axis=1)
        return (
            result.stages[-1].model_energy_j <= self.stop_below
            or float(weighted_percentile(strain, worn.area, 0.98)) <= self.stop_below_strain
        )
