"""Pieces that are cut by themselves, and the table `[auto_cut]` of a scene: when one needs no further cut."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import numpy as np
from pydantic import Field

from warpflat.core import InputError, Table, weighted_percentile
from warpflat.flat import RankedBy

if TYPE_CHECKING:
    from warpflat.flat import Flattening, Ledger, RelaxOptions

__all__ = ["AutoCutTable", "cut_automatically"]


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


def cut_automatically(
    result: Flattening, auto: AutoCutTable, *, relax: RelaxOptions | None = None
) -> tuple[Flattening, tuple[Ledger, ...]]:
    """Cut greedily: try the candidates that promise most, make the best that helps, and again until it is enough.

    Args:
        result: the flattened piece.
        auto: when to stop.
        relax: options of the full relaxation, from which the coarse ones of the trials follow.

    Returns:
        The piece as the last trial left it, and the ledger of each round that made a cut.
    """
    from warpflat.flat import find_candidates, make_ledger

    ledgers: list[Ledger] = []
    while len(ledgers) < auto.max_cuts and not auto.is_enough(result):
        try:
            # Of two cuts that mirror each other, both are made or none.
            candidates = [one for one in find_candidates(result) if not one.has_twin]
            ledger = make_ledger(result, relax=relax, by=auto.by, candidates=candidates, listed=False)
        except InputError:
            if not ledgers:
                raise
            break
        best = next((entry for entry in ledger.entries if entry.helps), None)
        if best is None or best.result is None:
            break
        ledgers.append(ledger)
        result = best.result
    return result, tuple(ledgers)
