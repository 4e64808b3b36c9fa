"""`flatten_all`: many surfaces of one fabric, one after the other."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

from numpy.typing import ArrayLike

from warpflat.core.errors import InputError, expect_callback, expect_each
from warpflat.flat.fabric.fabric import DEFAULT_FABRIC, Fabric
from warpflat.flat.flattening.flatten_piece import (
    DevelopedPiece,
    check_settings,
    develop_piece,
    relax_developed,
)
from warpflat.flat.flattening.progress import Progress
from warpflat.flat.flattening.result import Flattening
from warpflat.flat.model.membrane import ModelChoice
from warpflat.flat.model.wear import Wear
from warpflat.flat.solver.options import RelaxOptions
from warpflat.flat.surface.mesh import Surface

__all__ = ["flatten_all"]


def flatten_all(
    surfaces: Sequence[Surface],
    *,
    fabric: Fabric | str = DEFAULT_FABRIC,
    datum: str | Sequence[str | ArrayLike | None] | None = None,
    grain_angle: float | Sequence[float] = 0.0,
    model: ModelChoice = "auto",
    wear: Wear | None = None,
    relax: RelaxOptions | None = None,
    callback: Callable[[int, Progress], bool | None] | None = None,
    device: str | None = None,
) -> list[Flattening]:
    """Flatten several pieces, say all of a garment or one in ten sizes: the patterns that :func:`warpflat.flatten` gives of each.

    All are developed before the first is relaxed, so that a piece that cannot be flattened is refused at once. But a stretch
    that one of them has no use for is a note here, as others may have.

    Args:
        surfaces: the pieces.
        fabric, model, wear, relax, device: as :func:`warpflat.flatten` takes them, one for all.
        datum: one name for all, or a sequence of what `flatten` takes, for each surface one.
        grain_angle: one for all, or a sequence with one for each surface [degrees].
        callback: called with the number of the surface and its `Progress`, for the developments (step 0) and after every step, for one
            surface after the other.

    Returns:
        A `Flattening` for each surface, in their order, each with a network of its own.

    Raises:
        InputError: a piece cannot be flattened; one line says which, and why.
    """
    expect_each(surfaces, Surface, "surfaces", "a Surface")
    expect_callback(callback)
    count = len(surfaces)
    named = datum is None or isinstance(datum, str)
    if not named:
        expect_each(datum, object, "datum", "for one surface, or one name for all")
    datums: Sequence[str | ArrayLike | None] = [datum] * count if named else list(datum)  # type: ignore[arg-type, list-item]
    if len(datums) != count:
        raise InputError(
            f"datum has {len(datums)} entries for {count} surfaces; give one name for all, or one for each"
        )
    angles = list(grain_angle) if isinstance(grain_angle, Sequence) else [grain_angle] * count
    if len(angles) != count:
        raise InputError(
            f"grain_angle has {len(angles)} entries for {count} surfaces; give one for all, or one for each"
        )
    settings = [
        check_settings(fabric, grain_angle=angle, model=model, wear=wear, relax=relax, device=device)
        for angle in angles
    ]

    def develop(number: int, piece: Surface) -> DevelopedPiece:
        try:
            return develop_piece(
                piece, datums[number], settings[number], None if callback is None else partial(callback, number)
            )
        except InputError as error:
            named = repr(piece.name) in str(error)
            raise InputError(str(error) if named else f"piece {piece.name!r} (surface {number}): {error}") from None

    return [relax_developed(piece) for piece in [develop(number, surface) for number, surface in enumerate(surfaces)]]
