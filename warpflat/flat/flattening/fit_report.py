"""Reports on the fit: the entry `wear` of `metrics.json`, and what would help, in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from warpflat.core.arrays import IntArray
from warpflat.core.short_repr import short_repr
from warpflat.flat.model.fit import TOLERATED, WornFit
from warpflat.flat.model.wear import Wear

__all__ = ["Remedy", "garment_wear", "no_cut_words", "remedy_words", "wear_measures"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Remedy:
    """A cut, sewn as a dart or a seam, that may relieve a misfit.

    Attributes:
        words: what to cut.
        path: vertices of the uncut surface.
        length: [m].
        outside: share of the cloth beyond the limit once it is made, by trial and unsewn; None if it was not tried.
        table: that makes it as one of a scene's `[[cuts]]`; None where a scene cannot.
    """

    __repr__ = short_repr

    words: str
    path: IntArray
    length: float
    outside: float | None = None
    table: Mapping[str, Any] | None = None

    def as_dict(self) -> dict[str, Any]:
        """Return the remedy as an entry of `would_help` in `metrics.json`."""
        return {
            "cut": self.words,
            "length_m": self.length,
            "outside_after": self.outside,
            **({} if self.table is None else {"table": dict(self.table)}),
        }


def wear_measures(
    fit: WornFit, *, wear: Wear | None = None, unsewn: WornFit | None = None, remedies: Sequence[Remedy] = ()
) -> dict[str, Any]:
    """Build the entry `wear` of a piece in `metrics.json`.

    Args:
        fit: how the piece sits.
        wear: how it is meant to be worn, if that was asked for.
        unsewn: how it sat before it was sewn, if it was.
        remedies: cuts that may help.
    """
    measures = {**(asdict(wear) if wear is not None else {}), **fit.as_dict()}
    if unsewn is not None:
        measures["outside_unsewn"] = unsewn.outside
    measures["would_help"] = [remedy.as_dict() for remedy in remedies]
    return measures


def garment_wear(pieces: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """Build the entry `wear` of a garment from the entries of its pieces in `metrics.json`.

    Args:
        pieces: by name, with `wear` and `area_m2`.
    """
    worn = {name: piece["wear"] for name, piece in pieces.items()}
    area = {name: float(piece["area_m2"]) for name, piece in pieces.items()}
    unfit = {name: wear for name, wear in worn.items() if wear["held"] > TOLERATED}
    shares = {
        key: sum(wear[key] * area[name] for name, wear in worn.items()) / sum(area.values())
        for key in ("outside", "held", "slack")
    }
    return {
        **shares,
        "where_not": [f"{name}: {words}" for name, wear in unfit.items() for words in wear["where_not"]],
        "would_help": [{"piece": name, **remedy} for name, wear in unfit.items() for remedy in wear["would_help"]],
    }


def remedy_words(remedy: Mapping[str, Any], outside: float | None = None, *, sewn: bool = False) -> str:
    """Return a remedy as a line of text.

    Args:
        remedy: as in `metrics.json`.
        outside: share of the cloth beyond the limit without it, if that is to be shown.
        sewn: whether the piece is sewn; both shares are those of the unsewn piece.
    """
    after = remedy["outside_after"]
    if after is None:
        return f"may help: {remedy['cut']}"
    before = "" if outside is None else f"{100 * outside:.1f} % -> "
    unsewn = ", unsewn" if sewn else ""
    return f"would help: {remedy['cut']}: {before}{100 * after:.1f} % beyond the limit{unsewn}"


def no_cut_words(outside: float, *, sewn: bool) -> str:
    """Return what helps a piece that no cut helps.

    Args:
        outside: share of its cloth beyond the limit.
        sewn: whether the piece is sewn; the share is that of the unsewn piece.
    """
    if sewn and outside <= TOLERATED:
        return "without its seams the piece fits; relax its seams, folds or constraints, or choose a stretchier fabric"
    return "would help: another fabric, or another stretch; no single dart does"
