"""A scan read: brought upright, the body model laid on it, its sections and levels; the one reader of mannequins and of `warpflat fit`."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from warpflat.core import FloatArray, InputError
from warpflat.garment.mannequin.body_landmarks import LEVELS
from warpflat.garment.mannequin.scan_levels import ScanLevel, find_levels
from warpflat.garment.mannequin.scan_pose import LEVELS_UP, ScanOptions, turn_scan_upright
from warpflat.garment.mannequin.scan_sections import BodySections
from warpflat.garment.mannequin.slicer import UP, Slicer, largest
from warpflat.garment.mannequin.stand_body import StandingBody, stand_body

__all__ = ["ReadBody", "read_body", "whole_sections"]

# A level of a body lies at most so far from where the mean body has it, as a share of the stature.
_NEIGHBOUR = 0.06


@dataclass(frozen=True, kw_only=True, eq=False)
class ReadBody:
    """A scan's body with its sections and levels.

    Attributes:
        scan: upright; of a body that sits, as it would stand.
        laid: the body on it.
        posed: #V by 3 [m], vertices of the finer body model on the scan, which may sit.
        body, stands: its sections as scanned, and as its mannequin stands.
        found, levels: its levels in both.
        notes: what was found, one sentence each.
        placed: a matrix (3 by 3) and a shift [m], by which points of the scan come upright.
    """

    scan: Slicer
    laid: StandingBody
    posed: FloatArray
    body: BodySections
    stands: BodySections
    found: Mapping[str, ScanLevel]
    levels: Mapping[str, ScanLevel]
    notes: tuple[str, ...]
    placed: tuple[FloatArray, FloatArray]


def read_body(vertices: FloatArray, faces: NDArray[np.int64], options: ScanOptions) -> ReadBody:
    """Fit the body model to a scan, lay it on the scan, and find its levels.

    Args:
        vertices: #V by 3, any unit.
        faces: #F by 3 or 4 (-1 in the last column for a triangle).
        options: what the user knows about the scan.

    Raises:
        InputError: if the mesh is no body that stands on two legs, or its levels do not come in a body's order.
    """
    scan, notes = turn_scan_upright(vertices, faces, options)
    if scan.sits and options.landmarks:
        raise InputError(
            f"scan: landmark {next(iter(options.landmarks))}: the scan sits, and heights are those of standing bodies; leave it out"
        )
    turn, shift = scan.placed
    # A landmark beyond its neighbours would pull the fit off the body.
    stature = float(scan.vertices[:, 1].max())
    about = {name: LEVELS[name][0] * stature for name in LEVELS_UP if name in LEVELS} | dict(options.landmarks)
    for under, over in itertools.pairwise(name for name in LEVELS_UP if name in about):
        if about[over] < about[under] - (0.0 if {under, over} <= set(options.landmarks) else _NEIGHBOUR * stature):
            raise InputError(
                f"scan: {over} ({about[over]:.3f} m) does not lie above {under} ({about[under]:.3f} m) on a body {stature:.2f} m tall; "
                "give landmarks as heights above the floor"
            )
    laid = stand_body(
        scan.vertices,
        scan.triangles,
        faces_ahead=options.facing is not None,
        as_scanned=options.keep_pose and not scan.sits,
        sits=scan.sits,
        landmarks=options.landmarks,
    )
    if laid.unsure is not None:
        given = ", ".join(f"{name} = {height:g} m" for name, height in options.landmarks.items())
        raise InputError(
            f"scan: {laid.unsure}{f', with {given} as given' if given else ''}; a body that stands with its arms off the trunk is needed"
        )
    posed, sits = laid.posed, scan.sits
    if laid.turned:
        scan = Slicer(scan.vertices * [-1.0, 1.0, -1.0], scan.triangles, scan.noise)
        turn, shift = turn * [-1.0, 1.0, -1.0], shift * [-1.0, 1.0, -1.0]
        notes.append("the scan was found to face the other way by the body model")
    if sits:
        # What a tape would measure on the person standing.
        scan = Slicer(laid.stood(scan.vertices), scan.triangles, scan.noise)
        scan.sits, laid = True, replace(laid, posed=laid.vertices)
    with whole_sections():
        crotch = options.landmarks.get("crotch") or _crotch_height(scan, laid)
        crotch -= float(laid.posed[laid.crotch, 1])
        moved = Slicer(laid.stood(scan.vertices), scan.triangles, scan.noise) if laid.moved else scan
        stands = BodySections(laid.vertices, laid, moved, crotch)
        body = BodySections(laid.posed, laid, scan, crotch) if laid.moved else stands
        found = levels = find_levels(body, laid, scan.noise, options.landmarks)
        if laid.undone:
            heights = {name: laid.carried(name, height) for name, height in options.landmarks.items()}
            levels = find_levels(stands, laid, scan.noise, heights)
    return ReadBody(
        scan=scan,
        laid=laid,
        posed=posed,
        body=body,
        stands=stands,
        found=found,
        levels=levels,
        notes=(*notes, *laid.notes),
        placed=(turn, shift),
    )


@contextmanager
def whole_sections() -> Iterator[None]:
    """Say in one line that a mesh is torn or twisted where its sections hold too few points for a step of the way.

    Raises:
        InputError: instead of what NumPy and Qhull raise.
    """
    from scipy.spatial import QhullError

    try:
        yield
    except InputError:
        raise
    except (ValueError, IndexError, QhullError) as error:
        raise InputError(f"scan: its plane sections are too broken to be measured ({error}); repair the mesh") from None


def _crotch_height(scan: Slicer, laid: StandingBody) -> float:
    """Return the height [m] of the first level section of a scan, near the body's crotch, of which the largest part is of both legs."""
    vertex, size = float(laid.posed[laid.crotch, 1]), float(laid.posed[:, 1].max())
    for y in np.arange(vertex - 0.010 * size, vertex + 0.012 * size, 0.001):
        parts = scan.cut(UP, float(y))
        if parts:
            across = largest(parts).points[:, 0]
            if across.min() < -0.02 * size and across.max() > 0.02 * size:
                return float(y)
    return vertex
