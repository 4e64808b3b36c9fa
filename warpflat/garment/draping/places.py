"""The worst places of a drape, each with a sentence."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from warpflat.core import BoolArray, FloatArray, IntArray, area_words
from warpflat.flat import Demand, border_edges, join_labels, triangulate
from warpflat.garment.draping.sewn_cloth import SewnCloth

__all__ = ["Place", "find_places"]

# A place goes on into another piece if so large a share of it lies there.
_SPREADS = 0.1
# From here on a distance is worth a sentence [m], and a place its own one [m2].
_WORTH, _LEAST_AREA = 3e-3, 2e-4
_MOST = 6


@dataclass(frozen=True, kw_only=True)
class Place:
    """A connected place where the cloth does not lie as designed.

    Attributes:
        kind: "misfit", "strain", "shear", "bridged", or "hang" where the cloth is not meant to touch the body, or is gathered.
        line: the feature line or edge next to its worst vertex, "piece.line".
        worst: the largest distance from the designed surface [m], or strain, or shear [degrees].
        gap: the distance from the body there [m].
        area: flat area [m2].
        words: a sentence.
        vertex: the worst one, of the sewn mesh.
        gapes: whether cloth stands off at an edge of the garment.
        fails: whether the garment does not fit because of it; other places are told.
    """

    kind: str
    line: str
    worst: float
    gap: float
    area: float
    words: str
    vertex: int
    gapes: bool = False
    fails: bool = False

    def as_dict(self) -> dict[str, Any]:
        """Return the entry of `metrics.json`."""
        return {
            "kind": self.kind, "line": self.line, "worst": self.worst, "gap_m": self.gap, "area_m2": self.area,
            "words": self.words, "fails": self.fails,
        }  # fmt: skip


def find_places(
    cloth: SewnCloth,
    areas: FloatArray,
    *,
    misfit: FloatArray,
    meant_to_touch: BoolArray,
    bridged: FloatArray,
    lift: FloatArray,
    gap: FloatArray,
    strains: Mapping[str, FloatArray],
    gathered: BoolArray,
    compared_with: str,
) -> tuple[Place, ...]:
    """Find the connected places of misfit, bridged hollows, and strain and shear beyond the cloth's limits, the largest first.

    Args:
        cloth: the sewn cloth.
        areas: #V, flat areas [m2].
        misfit, bridged: #V, parts of the distance from the designed surface [m].
        meant_to_touch: #V, true where the cloth was designed to lie on the body; elsewhere a misfit is how it hangs.
        lift: #V, how much farther than designed the cloth is from the body [m].
        gap: #V, the distance from the body [m].
        strains: #F, along "warp" and "weft", and "shear" [degrees].
        gathered: #V, true where an elastic draws the cloth together.
        compared_with: what the cloth is compared with, the "designed surface" or the "body".
    """
    found = list[Place]()

    def tell(part: IntArray, worst: int, kind: str, amount: float, words: str, *, gapes: bool = False) -> None:
        area = float(areas[part].sum())
        if area < _LEAST_AREA:
            return
        line = _line_at(cloth, worst)
        piece, _, near = line.partition(".")
        # The leg of a dart is called by the dart.
        near = re.sub(r"\.(left|right)$", "", near).replace("_", " ")
        called = f"{piece.replace('_', ' ')} near {near}" if near else "the cloth"
        # The area of a place that goes on into other pieces is not that of the one that is named.
        share = {name: np.isin(cloth.welded[rows], part).sum() for name, rows in cloth.piece_vertices.items()}
        over = [name.replace("_", " ") for name, count in share.items() if count > _SPREADS * sum(share.values())]
        of = f" of {' and '.join(over)}" if len(over) > 1 else ""
        place = Place(
            kind=kind, line=line, worst=amount, gap=float(gap[worst]), area=area,
            words=f"{called} {words} over {area_words(area)}{of}", vertex=worst, gapes=gapes,
        )  # fmt: skip
        found.append(place)

    # Cloth gapes at an edge of the garment. Inside, as in a flute of a skirt, it stands off.
    edge = np.zeros(len(gap), dtype=bool)
    edge[border_edges(cloth.faces)] = True
    parts = {
        "misfit": np.where(meant_to_touch, misfit, 0.0),
        "hang": np.where(meant_to_touch, 0.0, misfit),
        "bridged": bridged,
    }
    for kind, values in parts.items():
        for part in _parts(cloth, values > _WORTH):
            worst = int(part[values[part].argmax()])
            distance, stands_off = float(values[worst]), lift[worst] > 0.5 * float(values[worst])
            gapes = bool(stands_off and kind == "misfit" and edge[part].any())
            if kind == "bridged":
                words = f"bridges a hollow, {1e3 * distance:.1f} mm off,"
            elif gapes:
                # Its gap to the body is more than its misfit where it was designed off the body, or spans a hollow.
                of_it = f", {1e3 * distance:.1f} mm of it misfit," if gap[worst] - distance > 5e-5 else ""
                words = f"gapes by {1e3 * gap[worst]:.1f} mm{of_it}"
            elif stands_off:
                words = f"stands off {1e3 * distance:.1f} mm from the {compared_with},"
            elif lift[worst] < -0.5 * distance:
                words = f"falls in by {1e3 * distance:.1f} mm"
            else:
                words = f"has moved by {1e3 * distance:.1f} mm"
            tell(part, worst, kind, distance, words, gapes=gapes)
    # The mean of the faces at each vertex.
    used = cloth.faces >= 0
    vertex = cloth.faces[used]
    count = np.maximum(np.bincount(vertex, minlength=len(cloth.designed)), 1)
    at_vertices = [
        np.bincount(vertex, np.broadcast_to(strains[name][:, None], used.shape)[used], minlength=len(count)) / count
        for name in ("warp", "weft", "shear")
    ]
    demand = Demand.of(cloth.fabric, *at_vertices)
    for column, beyond in enumerate(demand.beyond_by_way.T):
        for part in _parts(cloth, beyond):
            worst = int(part[np.abs(demand.shares[part, column]).argmax()])
            amount = demand.amount(worst, column)
            kind = "shear" if amount.way == "shear" else "strain"
            how = "pressed together" if amount.state == "slack" else amount.state
            limit = f", beyond the cloth's limit of {amount.limit_words}"
            if amount.state != "stretched" and gathered[part].any():
                kind, how, limit = "hang", "gathered by its elastic", ""
            tell(part, worst, kind, amount.value, f"is {how} by {amount.words}{limit},")
    order = {"misfit": 0, "strain": 1, "shear": 2, "hang": 3, "bridged": 4}
    found.sort(key=lambda place: (order[place.kind], -abs(place.worst) * place.area))
    return tuple(found[:_MOST])


def _parts(cloth: SewnCloth, chosen: BoolArray) -> list[IntArray]:
    """Return the chosen vertices (#V) in connected parts."""
    triangles, _ = triangulate(cloth.faces)
    a, b = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    inside = chosen[a] & chosen[b]
    label = join_labels(len(chosen), a[inside], b[inside])
    return [np.flatnonzero(label == part).astype(np.int32) for part in np.unique(label[chosen])]


def _line_at(cloth: SewnCloth, vertex: int) -> str:
    """Return the line nearest to a vertex on the designed surface."""
    place = cloth.designed[vertex]
    distances = {
        name: float(np.linalg.norm(cloth.designed[ids] - place, axis=1).min()) for name, ids in cloth.lines.items()
    }
    return min(distances, key=distances.__getitem__) if distances else ""
