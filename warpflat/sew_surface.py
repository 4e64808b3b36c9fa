"""One flattened surface, cut or not: both sides of its darts and partings made equally long, its constraints kept."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from warpflat.constraints import Constraint
from warpflat.flattening import Flattening
from warpflat.relax import RelaxOptions
from warpflat.seam_lengths import SeamLengths, polyline_length
from warpflat.sewing import SeamPair, Sewn, sew

__all__ = ["SewnSurface", "sew_surface"]


@dataclass(frozen=True, kw_only=True, eq=False)
class SewnSurface:
    """A surface relaxed under the seams of its cuts and under constraints.

    Attributes:
        result: the piece, whole, also where cuts have parted it.
        sewn: how it went.
        seams: of the cuts, measured.
    """

    result: Flattening
    sewn: Sewn
    seams: tuple[SeamLengths, ...]

    def metrics(self) -> dict[str, Any]:
        """What `metrics.json` says of it besides its pieces."""
        return {
            "seams": [seam.as_dict() for seam in self.seams],
            "constraints": [held.as_dict() for held in self.sewn.constraints],
            "sewing": self.sewn.as_dict(),
        }


def sew_surface(
    result: Flattening, constraints: Sequence[Constraint] = (), *, options: RelaxOptions | None = None
) -> SewnSurface | None:
    """Relax a piece on, so that its darts' legs match and its constraints are kept; None if it has neither.

    Args:
        result: flattened, perhaps cut.
        constraints: on its lines.
        options: of the relaxation.

    Raises:
        InputError: a constraint names a line that the piece has not, or asks what the line cannot be.
    """
    name = result.surface.name
    pairs = [
        SeamPair(
            name=made.name if len(made.seams) == 1 else f"{made.name}_{number}",
            pieces=(name, name),
            vertices=(seam.left, seam.right),
        )
        for made in result.cuts
        for number, seam in enumerate(made.seams, start=1)
    ]
    if not pairs and not constraints:
        return None
    sewn = sew({name: result}, pairs, constraints=constraints, options=options)
    after = sewn.pieces[name]
    seams = tuple(
        SeamLengths(
            name=pair.name,
            sides=(f"{name}.{pair.name}.left", f"{name}.{pair.name}.right"),
            length_3d=polyline_length(after.network.surface.vertices[pair.vertices[0]]),
            lengths=(
                polyline_length(after.positions[pair.vertices[0]]),
                polyline_length(after.positions[pair.vertices[1]]),
            ),
            price=held.price,
        )
        for pair, held in zip(pairs, sewn.held, strict=False)
    )
    return SewnSurface(result=after, sewn=sewn, seams=seams)
