"""A drafted pattern read back from `pattern.json`, to write its other files again without drafting anew."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from warpflat.core.arrays import FloatArray
from warpflat.core.errors import InputError
from warpflat.core.input_files import guarded, read_json
from warpflat.core.text import quote_value
from warpflat.core.toml_file import check_table
from warpflat.export.pattern_json import SCHEMA
from warpflat.export.pattern_json_entries import (
    DartEntry,
    EdgeEntry,
    LabelEntry,
    NotchEntry,
    PatternEntry,
    PieceEntry,
    SideEntry,
)
from warpflat.pattern.curves import Curve
from warpflat.pattern.drafted import (
    DraftedCutout,
    DraftedDart,
    DraftedEdge,
    DraftedGarment,
    DraftedPiece,
    DrillHole,
    Notch,
    SeamReport,
)
from warpflat.pattern.label import Label
from warpflat.pattern.piece_parts import Dart, Edge, Hole
from warpflat.pattern.pieces import Garment, Piece, Seam, SeamSide

__all__ = ["pattern_from_json", "read_pattern_json"]


def read_pattern_json(path: str | os.PathLike[str]) -> DraftedGarment:
    """Read the pattern of a file that :func:`warpflat.export.pattern_json.write_pattern_json` wrote.

    Raises:
        InputError: the file is missing, no JSON, of another schema, or does not hold together.
    """
    path = Path(path)
    if path.parent.is_file():
        raise InputError(f"{path.parent}: is a file; give the folder of a run, where its pattern.json lies")
    data = read_json(path, missing="no such file; a run leaves a pattern.json in its folder")
    with guarded(path, "JSON"):
        return pattern_from_json(data)


def pattern_from_json(data: Any) -> DraftedGarment:
    """Return the pattern of the data that :func:`warpflat.export.pattern_json.pattern_json` gave.

    Raises:
        InputError: another schema, a missing key, a value of the wrong kind, or lines that are no pattern.
    """
    if not isinstance(data, Mapping) or "sizes" not in data:
        raise InputError('is no pattern of warpflat: it has no "sizes"')
    if data.get("schema") != SCHEMA:
        raise InputError(
            f"has schema {quote_value(data.get('schema'))}; this version reads {SCHEMA}: run the scene again"
        )
    try:
        return _garment(check_table(PatternEntry, data))
    except InputError as error:
        raise InputError(f"{error}; run the scene again") from None


def _garment(data: PatternEntry) -> DraftedGarment:
    drafted = {
        size: tuple(_piece(name, size, piece) for name, piece in pieces.items()) for size, pieces in data.sizes.items()
    }
    garment = Garment(
        name=data.name,
        pieces={size: tuple(piece.piece for piece in pieces) for size, pieces in drafted.items()},
        seams=[
            Seam(
                name=stitch.name,
                sides=(_side(stitch.sides[0]), _side(stitch.sides[1])),
                ease=stitch.ease,
                eased=(stitch.eased[0], stitch.eased[1]),
            )
            for stitch in data.stitches
            if stitch.kind == "seam"
        ],
        sample_size=data.sample_size,
        words=data.words,
    )
    reports = tuple(
        SeamReport(
            name=seam.name,
            size=seam.size,
            sides=(seam.sides[0], seam.sides[1]),
            length_mm=(seam.length_mm[0], seam.length_mm[1]),
            ease=seam.ease,
            difference_mm=seam.difference_mm,
            local_mm=seam.difference_per_50mm_mm,
        )
        for seam in data.seams
    )
    return DraftedGarment(garment=garment, pieces=drafted, seams=reports)


def _side(parts: Sequence[SideEntry]) -> tuple[SeamSide, ...]:
    return tuple(SeamSide(piece=p.piece, edge=p.edge, reversed=p.reversed, mirrored=p.mirrored) for p in parts)


def _piece(name: str, size: str, data: PieceEntry) -> DraftedPiece:
    frame = np.array(data.frame)
    darts = [
        Dart(name=d.name, left=d.left, right=d.right, fold_to=d.fold_to or None, pleat=d.pleat) for d in data.darts
    ]
    cutouts = {key: _cutout(data, key) for key in data.cutouts}
    fisheyes = {key: np.array(line) for key, line in data.fisheye_darts.items()}
    internal_lines = {key: np.array(line) for key, line in data.internal_lines.items()}
    grain = np.array(data.grain)
    holes = [
        Hole(name=key, points=_to_mesh(cutout.sew_line, frame), allowance=cutout.width)
        for key, cutout in cutouts.items()
    ]
    holes += [Hole(name=key, points=_to_mesh(line, frame), kind="dart") for key, line in fisheyes.items()]
    piece = Piece(
        name=name,
        size=size,
        fabric=data.fabric,
        quantity=data.quantity,
        role=data.role,
        also=data.also,
        marks={
            hole.name: _to_mesh(np.array([hole.at]), frame)[0] for hole in data.drill_holes if hole.name in data.marks
        },
        paired=data.paired,
        title=data.title,
        units=data.printed_units,
        edges=[_edge(edge, frame) for edge in data.edges],
        darts=darts,
        internal_lines={key: _to_mesh(line, frame) for key, line in internal_lines.items()},
        grain=_to_mesh(grain, frame),
        holes=holes,
    )
    return DraftedPiece(
        piece=piece,
        frame=frame,
        edges=tuple(_drafted_edge(edge, d) for edge, d in zip(piece.edges, data.edges, strict=True)),
        cut_line=np.array(data.cut_line),
        darts=tuple(_dart(dart, d) for dart, d in zip(darts, data.darts, strict=True)),
        drill_holes=tuple(DrillHole(name=hole.name, at=np.array(hole.at)) for hole in data.drill_holes),
        notches=tuple(_notch(notch) for notch in data.notches),
        internal_lines=internal_lines,
        cutouts=cutouts,
        fisheyes=fisheyes,
        grain=grain,
        label=_label(data.label),
        notes=tuple(data.notes),
        enlarged=(data.enlarged[0], data.enlarged[1]),
    )


def _label(data: LabelEntry) -> Label:
    return Label(
        at=np.array(data.at),
        lines=tuple(zip(data.lines, data.heights, strict=True)),
        angle=data.angle,
        leader=None if data.leader is None else np.array(data.leader),
    )


def _cutout(data: PieceEntry, name: str) -> DraftedCutout:
    line = data.cutouts[name]
    return DraftedCutout(
        sew_line=np.array(data.cutout_sew_lines.get(name, line)),
        cut_line=np.array(line),
        width=data.cutout_allowances.get(name, 0.0),
    )


def _edge(data: EdgeEntry, frame: FloatArray) -> Edge:
    return Edge(
        name=data.name,
        points=_to_mesh(np.array(data.line), frame),
        kind=data.kind,
        allowance=None if data.kind == "fold" else data.allowance,
        vertices=None if data.mesh_vertices is None else np.array(data.mesh_vertices, dtype=np.int32),
    )


def _drafted_edge(edge: Edge, data: EdgeEntry) -> DraftedEdge:
    return DraftedEdge(
        edge=edge,
        curve=Curve(bezier=np.array(data.bezier), straight=np.array(data.straight)),
        line=np.array(data.line),
        width=data.allowance,
        places=np.array(data.point_lengths),
        fit_error=data.fit_error,
        tolerance=data.tolerance,
    )


def _dart(dart: Dart, data: DartEntry) -> DraftedDart:
    fold = None if data.fold is None else np.array(data.fold)
    return DraftedDart(dart=dart, tip=np.array(data.tip), fold=fold, fold_to=data.fold_to, opening=data.opening)


def _notch(data: NotchEntry) -> Notch:
    return Notch(
        seam=data.seam,
        edge=data.edge,
        length=data.length,
        at=np.array(data.at),
        base=tuple(np.array(base) for base in data.base),
        direction=np.array(data.direction),
        depth=data.depth,
    )


def _to_mesh(points: FloatArray, frame: FloatArray) -> FloatArray:
    """Map points from the drafted piece's coordinates to those of the flat mesh."""
    turn = frame[:, :2]
    return (points - frame[:, 2]) @ turn
