"""Rules for the edges of a pattern: which are seams, hems or raw, and how wide their allowance is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from warpflat.core import InputError, nearest
from warpflat.pattern.drafting.piece_parts import DEFAULT_ALLOWANCE, EDGE_KINDS

__all__ = ["EdgeRules"]


@dataclass(frozen=True, kw_only=True)
class EdgeRules:
    """Exceptions for the edges of a pattern.

    Attributes:
        seam, hem: allowance [m] of all edges of these kinds.
        kinds: kind by edge, as "piece.edge", or "edge" for every piece that has one of that name.
        allowances: allowance [m] by edge, named in the same way.
        ease: by seam: how much longer its second side is, as a share of the first.
        eased: by seam: the shares of its length between which the ease lies; all along it if not named.
    """

    seam: float = DEFAULT_ALLOWANCE["seam"]
    hem: float = DEFAULT_ALLOWANCE["hem"]
    kinds: Mapping[str, str] = field(default_factory=dict)
    allowances: Mapping[str, float] = field(default_factory=dict)
    ease: Mapping[str, float] = field(default_factory=dict)
    eased: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def check(self, edges: Mapping[str, Sequence[str]]) -> None:
        """Check that every name is an edge, and that every kind exists.

        Args:
            edges: names of the edges by piece.

        Raises:
            InputError: a name that no piece has (gives the nearest), or an unknown kind.
        """
        for message in self._unknown(edges).values():
            raise InputError(message)
        for name, kind in self.kinds.items():
            if kind not in EDGE_KINDS:
                raise InputError(f"kinds.{name}: unknown kind {kind!r}; {nearest(kind, EDGE_KINDS)}")

    def known(self, edges: Mapping[str, Sequence[str]]) -> tuple[EdgeRules, tuple[str, ...]]:
        """Return the rules without names that no piece has, and a sentence about each of these.

        For names that show in the plane only; `edges` as for :meth:`check`.
        """
        unknown = self._unknown(edges)
        kinds = {name: kind for name, kind in self.kinds.items() if ("kinds", name) not in unknown}
        allowances = {name: width for name, width in self.allowances.items() if ("allowances_mm", name) not in unknown}
        notes = tuple(f"left out of the pattern: {message}" for message in unknown.values())
        return replace(self, kinds=kinds, allowances=allowances), notes

    def _unknown(self, edges: Mapping[str, Sequence[str]]) -> dict[tuple[str, str], str]:
        """Return the names that no piece has, with their table, and a message about each."""
        known = {f"{piece}.{edge}" for piece, names in edges.items() for edge in names}
        known |= {edge for names in edges.values() for edge in names}
        return {
            (key, name): f"{key}: no piece has an edge {name!r}; {nearest(name, known)}"
            for key, mapping in (("kinds", self.kinds), ("allowances_mm", self.allowances))
            for name in mapping
            if name not in known
        }

    def kind(self, piece: str, edge: str, default: str, *, whole: str | None = None) -> str:
        """Return the kind of an edge; what is said of the whole edge that it is a part of holds for it, too."""
        return next((self.kinds[name] for name in _names(piece, edge, whole) if name in self.kinds), default)

    def allowance(self, piece: str, edge: str, kind: str, *, whole: str | None = None) -> float | None:
        """Return the allowance [m] of an edge, or of the whole one that it is a part of; None leaves it to its kind."""
        if kind == "fold":
            return None
        of_kind = {"seam": self.seam, "hem": self.hem}.get(kind)
        named = (self.allowances[name] for name in _names(piece, edge, whole) if name in self.allowances)
        return next(named, of_kind)


def _names(piece: str, edge: str, whole: str | None) -> list[str]:
    """Return the names by which rules find an edge, the most particular first."""
    return [name for part in (edge, whole or edge) for name in (f"{piece}.{part}", part)]
