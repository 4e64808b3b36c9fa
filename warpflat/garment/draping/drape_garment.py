"""A garment is sewn, put on a body, and comes to rest there."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpflat.core import BoolArray, InputError, nearest, start_warp, without_side
from warpflat.flat import Flattening, Surface
from warpflat.garment.construction.form_garment import FormGarment
from warpflat.garment.construction.garment import Garment
from warpflat.garment.draping.body import Body
from warpflat.garment.draping.options import DrapeOptions
from warpflat.garment.draping.relax_drape import DrapedCloth, relax_drape
from warpflat.garment.draping.result import Drape
from warpflat.garment.draping.sewn_cloth import SewnCloth, pieces_of, sew_cloth
from warpflat.garment.mannequin.mannequin import Mannequin
from warpflat.pattern import MIRRORED, unnumbered

__all__ = ["come_to_rest", "drape", "held_vertices", "line_height", "thread_elastics"]

# So often is what an elastic draws in moved towards the body, level.
_LEVELLED = 20


def drape(
    garment: Garment | Flattening | Sequence[Flattening],
    body: Mannequin | Surface | None = None,
    *,
    hold: Sequence[str] = (),
    elastics: Sequence[str] = (),
    options: DrapeOptions | None = None,
    callback: Callable[[int, float], None] | None = None,
    device: str | None = None,
) -> Drape:
    """Sew flat pieces, put them on a body and let them come to rest under gravity, contact and friction.

    The cloth starts at the designed surface; its rest state is the flat pattern in its own thread directions.

    Args:
        garment: of :func:`warpflat.flatten_form` or :func:`warpflat.sew_pieces`, or pieces whose cuts are closed.
        body: a mannequin or a surface, such as a scan's; a garment's own mannequin, or a piece's own surface, if not given.
        hold: lines and edges that stay where they are, as "piece.line", or "line" for every piece that has one: those that
            would be sewn to what is not there.
        elastics: edges that an elastic draws to the body and holds there, such as "waist".
        options: friction, tolerance and limits.
        callback: called with the number of steps and the residual now and then.
        device: Warp device.

    Returns:
        the drape; `converged` is False if it met the step limit before it was at rest.

    Raises:
        InputError: no piece, pieces of different cloths, half pieces, mirrored faces, an unknown line, or nothing holds the garment.
    """
    cloth, pieces = sew_cloth(garment), pieces_of(garment)
    start_warp()
    where = wp.get_device(device)
    mannequin = garment.mannequin if isinstance(garment, FormGarment) else None
    body = mannequin if body is None else body
    surface = body.surface() if isinstance(body, Mannequin) else body
    gripped: list[str] = []
    if surface is None:
        solid = designed = Body(cloth.designed, cloth.faces, device=where)
    else:
        solid = Body(surface.vertices, surface.faces, device=where)
        cloth, gripped = thread_elastics(cloth, elastics, solid)
        designed = Body(cloth.designed, cloth.faces, device=where)
    options = options or DrapeOptions()
    wearer = body if isinstance(body, Mannequin) else mannequin
    worn, frames = come_to_rest(cloth, solid, [*hold, *gripped], options, callback, wearer)
    sources = tuple(source for piece in pieces.values() for source in piece.surface.sources)
    # A cut that `warpflat.advise` has found on one side stands for that on the other side of the body, too.
    cuts = {}
    for name, piece in pieces.items():
        paths = [(remedy.words.partition(",")[0], piece.surface.vertices[remedy.path]) for remedy in piece.remedies]
        cuts[name] = [(words, np.concatenate([path, path * [-1.0, 1.0, 1.0]])) for words, path in paths]
    return Drape(
        cloth=cloth, worn=worn, body=solid, designed=designed, options=options, sources=sources, frames=frames,
        hangs_below=line_height(wearer if mannequin is None else mannequin, "hip"), cuts=cuts, threaded=gripped,
    )  # fmt: skip


def come_to_rest(
    cloth: SewnCloth,
    body: Body,
    hold: Sequence[str],
    options: DrapeOptions,
    callback: Callable[[int, float], None] | None,
    wearer: Mannequin | None,
) -> tuple[DrapedCloth, tuple[NDArray[np.float32], ...]]:
    """Relax sewn cloth on a body, held as in :func:`drape`; return it, and where it was on its way (#V by 3 each [m]).

    Args:
        cloth, body, options, callback: as of :func:`warpflat.garment.draping.relax_drape.relax_drape`.
        hold: lines that stay where they are.
        wearer: whose thighs are where the body is two legs; None if it is no mannequin.

    Raises:
        InputError: an unknown line, or nothing holds the garment.
    """
    frames = list[NDArray[np.float32]]()
    worn = relax_drape(
        cloth, body, options=options, held=held_vertices(cloth, hold), legs=line_height(wearer, "thigh"),
        callback=callback, observer=lambda places: frames.append(places.astype(np.float32)),
    )  # fmt: skip
    worn.check_held()
    return worn, tuple(frames)


def held_vertices(cloth: SewnCloth, hold: Sequence[str]) -> BoolArray:
    """Return which vertices (#V) lie on lines that are held, each "piece.line", or "line" of every piece that has one.

    Raises:
        InputError: an unknown line.
    """
    held = np.zeros(len(cloth.designed), dtype=bool)
    for name in hold:
        lines = [line for line in cloth.lines if name in (line, line.partition(".")[2])]
        if not lines:
            known = [*cloth.lines, *(line.partition(".")[2] for line in cloth.lines)]
            raise InputError(f"drape: hold: line {name!r} is unknown: {nearest(name, known)}")
        for line in lines:
            held[cloth.lines[line]] = True
    return held


def thread_elastics(cloth: SewnCloth, edges: Sequence[str], body: Body) -> tuple[SewnCloth, list[str]]:
    """Return the cloth with edges drawn to the body at their height, as an elastic does, and the lines along them that it holds.

    Args:
        cloth: the sewn cloth.
        edges: what an elastic is threaded through, on whatever piece and side.
        body: what it draws them to.
    """
    called = {line: unnumbered(line.partition(".")[2].removesuffix(MIRRORED)) for line in cloth.lines}
    gripped = [line for line, edge in called.items() if {edge, without_side(edge)} & set(edges)]
    drawn = cloth.designed.copy()
    if gripped:
        rows = np.unique(np.concatenate([cloth.lines[line] for line in gripped]))
        # By alternating projections on the body and on the level of each vertex.
        for _ in range(_LEVELLED):
            drawn[rows] = np.where([True, False, True], body.nearest(drawn[rows])[0], drawn[rows])
    return replace(cloth, designed=drawn), gripped


def line_height(body: Mannequin | None, line: str) -> float:
    """Return the mean height of a line of a mannequin [m]; that of no body lies below everything."""
    return -np.inf if body is None else float(body.line(line)[:, 1].mean())
