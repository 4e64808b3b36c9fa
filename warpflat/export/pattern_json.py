"""Patterns as JSON with everything: edges, cut lines, notches, darts, seams as stitches, the map to the mesh."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from pydantic_core import to_json

from warpflat._version import __version__
from warpflat.core.output import atomic_path
from warpflat.pattern.cut_list import cut_list
from warpflat.pattern.drafted import DraftedEdge, DraftedGarment, DraftedPiece
from warpflat.pattern.pieces import SeamSide

__all__ = ["SCHEMA", "pattern_json", "write_pattern_json"]

#: Increased when a reader of the old form would misread the new one.
SCHEMA = 1


def pattern_json(garment: DraftedGarment) -> dict[str, Any]:
    """Return the whole pattern as plain lists and numbers: lengths in metres, angles in radians, y along the grain.

    A stitch sews two sides. Each side lists its edges in the order in which the seam meets them, and whether the seam
    runs against the edge's own direction (counter-clockwise round its piece); "mirrored" is an edge of the copy that is
    cut turned over. An edge's `point_lengths` are the lengths along its line at the points of its mesh's border, and
    `fit_error` is the largest distance of the curve from them. Numbers are not rounded.
    """
    sample = next(iter(garment.pieces.values()))
    stitches: list[dict[str, Any]] = [
        {
            "name": seam.name,
            "kind": "seam",
            "ease": seam.ease,
            "eased": list(seam.eased),
            "sides": [[_side(part) for part in side] for side in seam.sides],
        }
        for seam in garment.garment.seams
    ]
    stitches += [
        {
            "name": f"{piece.name}.{dart.dart.name}",
            "kind": "dart",
            "ease": 0.0,
            "eased": [0.0, 1.0],
            "sides": [
                [_side(SeamSide(piece=piece.name, edge=dart.dart.left))],
                [_side(SeamSide(piece=piece.name, edge=dart.dart.right, reversed=True))],
            ],
        }
        for piece in sample
        for dart in piece.darts
    ]
    return {
        "schema": SCHEMA,
        "warpflat": __version__,
        "units": "m",
        "name": garment.name,
        "sample_size": garment.garment.sample,
        "words": dict(garment.garment.words),
        "sizes": {size: {piece.name: _piece(piece) for piece in pieces} for size, pieces in garment.pieces.items()},
        "cut_list": {
            size: {cloth: [asdict(entry) for entry in rows] for cloth, rows in cut_list(pieces).items()}
            for size, pieces in garment.pieces.items()
        },
        "stitches": stitches,
        "seams": [
            {
                "name": report.name,
                "size": report.size,
                "sides": list(report.sides),
                "length_mm": list(report.length_mm),
                "ease": report.ease,
                "difference_mm": report.difference_mm,
                "difference_per_50mm_mm": report.local_mm,
                "matches": report.matches,
            }
            for report in garment.seams
        ],
    }


def write_pattern_json(garment: DraftedGarment, path: str | os.PathLike[str]) -> None:
    """Write :func:`pattern_json`; the file appears whole or not at all."""
    with atomic_path(path) as temporary:
        temporary.write_bytes(to_json(pattern_json(garment), indent=1) + b"\n")


def _side(side: SeamSide) -> dict[str, Any]:
    return {"piece": side.piece, "edge": side.edge, "reversed": side.reversed, "mirrored": side.mirrored}


def _piece(piece: DraftedPiece) -> dict[str, Any]:
    return {
        "fabric": piece.piece.fabric,
        "quantity": piece.piece.quantity,
        "role": piece.piece.role,
        "also": dict(piece.piece.also),
        "enlarged": list(piece.enlarged),
        "marks": sorted(piece.piece.marks),
        "paired": piece.piece.paired,
        "title": piece.piece.title,
        "printed_units": piece.piece.units,
        "on_fold": piece.piece.on_fold,
        "frame": piece.frame.tolist(),
        "edges": [_edge(edge) for edge in piece.edges],
        "cut_line": piece.cut_line.tolist(),
        "darts": [
            {
                "name": dart.dart.name,
                "left": dart.dart.left,
                "right": dart.dart.right,
                "tip": dart.tip.tolist(),
                "fold": None if dart.fold is None else dart.fold.tolist(),
                "fold_to": dart.fold_to,
                "opening": dart.opening,
                "pleat": dart.dart.pleat,
                "length_mm": [1000 * piece.edge(leg).length for leg in (dart.dart.left, dart.dart.right)],
            }
            for dart in piece.darts
        ],
        "notches": [
            {
                "seam": notch.seam,
                "edge": notch.edge,
                "length": notch.length,
                "at": notch.at.tolist(),
                "base": [base.tolist() for base in notch.base],
                "direction": notch.direction.tolist(),
                "depth": notch.depth,
                "double": notch.double,
            }
            for notch in piece.notches
        ],
        "drill_holes": [{"name": hole.name, "at": hole.at.tolist()} for hole in piece.drill_holes],
        "internal_lines": _lists(piece.internal_lines),
        "cutouts": _lists({name: cutout.cut_line for name, cutout in piece.cutouts.items()}),
        "cutout_sew_lines": _lists({name: cutout.sew_line for name, cutout in piece.cutouts.items()}),
        "cutout_allowances": {name: cutout.width for name, cutout in piece.cutouts.items()},
        "fisheye_darts": _lists(piece.fisheyes),
        "grain": piece.grain.tolist(),
        "label": {
            "at": piece.label.at.tolist(),
            "lines": [text for text, _ in piece.label.lines],
            "heights": [height for _, height in piece.label.lines],
            "angle": piece.label.angle,
            "leader": None if piece.label.leader is None else piece.label.leader.tolist(),
        },
        "notes": list(piece.notes),
    }


def _edge(edge: DraftedEdge) -> dict[str, Any]:
    return {
        "name": edge.name,
        "kind": edge.kind,
        "allowance": edge.width,
        "length": edge.length,
        "bezier": edge.curve.bezier.tolist(),
        "straight": edge.curve.straight.tolist(),
        "line": edge.line.tolist(),
        "fit_error": edge.fit_error,
        "tolerance": edge.tolerance,
        "point_lengths": edge.places.tolist(),
        "mesh_vertices": None if edge.edge.vertices is None else np.asarray(edge.edge.vertices).tolist(),
    }


def _lists(lines: Mapping[str, Sequence[Any] | np.ndarray[Any, Any]]) -> dict[str, Any]:
    return {name: np.asarray(line).tolist() for name, line in lines.items()}
