"""The patterns of one garment in several fabrics, and how far they differ."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from warpflat._version import __version__
from warpflat.core import FloatArray, polyline_length
from warpflat.flat import Flattening, border_loops, border_of

if TYPE_CHECKING:
    from warpflat.garment import Drape

__all__ = ["Comparison", "outline"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Comparison:
    """One scene in several fabrics.

    Attributes:
        name: of the scene.
        results: by fabric, then by piece; the first fabric is what the others are compared with.
        layouts: by fabric, then by piece: #P by 2 [m], laid upon the first fabric's pattern as well as it goes, turned
            and shifted only.
        sewing: by fabric, how its seams and constraints came out, as in `metrics.json`; empty where nothing was sewn.
        drapes: by fabric, sewn and put on the body; empty unless that was asked for.
        notes: on the cuts that all of them have, one sentence each.
    """

    name: str
    results: Mapping[str, Mapping[str, Flattening]]
    layouts: Mapping[str, Mapping[str, FloatArray]]
    sewing: Mapping[str, Mapping[str, Any]]
    drapes: Mapping[str, Drape] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    @property
    def fabrics(self) -> list[str]:
        """Names of the fabrics, in the order asked for."""
        return list(self.results)

    @property
    def pieces(self) -> list[str]:
        """Names of the pieces."""
        return list(self.results[self.fabrics[0]])

    def points(self, piece: str) -> dict[str, int]:
        """Return the named points of a piece, as vertices of its pattern: the ends of its lines on the outline."""
        surface = self.results[self.fabrics[0]][piece].network.surface
        border = set(border_of(surface).tolist())
        names: dict[int, list[str]] = {}
        for name, line in surface.lines.items():
            if len(line) < 2 or line[0] == line[-1]:
                continue
            for vertex, end in ((int(line[0]), "start"), (int(line[-1]), "end")):
                if vertex in border:
                    names.setdefault(vertex, []).append(f"{name} {end}")
        return {" / ".join(label): vertex for vertex, label in names.items()}

    def distances(self, piece: str) -> dict[str, dict[str, float]]:
        """Return by fabric how far each named point lies from that of the first fabric, and the outline's distances [m]."""
        first = self.layouts[self.fabrics[0]][piece]
        border = np.concatenate(border_loops(self.results[self.fabrics[0]][piece].faces))
        found = {}
        for fabric in self.fabrics[1:]:
            apart = np.linalg.norm(self.layouts[fabric][piece] - first, axis=1)
            found[fabric] = {name: float(apart[vertex]) for name, vertex in self.points(piece).items()}
            found[fabric]["outline, most"] = float(apart[border].max())
            found[fabric]["outline, mean"] = float(apart[border].mean())
        return found

    def borders(self, fabric: str, piece: str) -> dict[str, float]:
        """Return the lengths of the lines on the outline, and of the whole outline [m]."""
        result = self.results[fabric][piece]
        loops = border_loops(result.faces)
        edges = {
            frozenset(edge) for loop in loops for edge in zip(loop.tolist(), np.roll(loop, -1).tolist(), strict=True)
        }
        lengths = {"outline": sum(polyline_length(result.positions[loop], closed=True) for loop in loops)}
        for name, line in result.network.surface.lines.items():
            row = line.tolist()
            if len(row) > 1 and all(frozenset(edge) in edges for edge in pairwise(row)):
                lengths[name] = polyline_length(result.positions[line])
        return lengths

    def as_dict(self) -> dict[str, Any]:
        """Return all of `compare.json`."""
        return {
            "schema": 1,
            "warpflat": __version__,
            "scene": self.name,
            "compared_with": self.fabrics[0],
            "fabrics": {
                fabric: {
                    piece: {**result.measures, "border_lengths_m": self.borders(fabric, piece)}
                    for piece, result in pieces.items()
                }
                for fabric, pieces in self.results.items()
            },
            "sewing": {fabric: dict(how) for fabric, how in self.sewing.items()},
            **({"drapes": {name: drape.measures() for name, drape in self.drapes.items()}} if self.drapes else {}),
            "distances_m": {piece: self.distances(piece) for piece in self.pieces},
            "notes": list(self.notes),
        }


def outline(result: Flattening, layout: FloatArray) -> list[FloatArray]:
    """Return the closed border curves of a piece in a layout, each #B by 2 [m]."""
    return [layout[np.append(loop, loop[0])] for loop in border_loops(result.faces)]
