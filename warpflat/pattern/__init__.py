"""From flat pieces to a pattern for the cutting table."""

from warpflat.pattern.draft import DraftedGarment, DraftedPiece, draft_garment, draft_piece
from warpflat.pattern.from_mesh import piece_from_mesh
from warpflat.pattern.marker import Cloth, Marker, make_marker
from warpflat.pattern.pieces import Dart, Edge, Garment, Hole, Piece, Seam, SeamSide

__all__ = [
    "Cloth",
    "Dart",
    "DraftedGarment",
    "DraftedPiece",
    "Edge",
    "Garment",
    "Hole",
    "Marker",
    "Piece",
    "Seam",
    "SeamSide",
    "draft_garment",
    "draft_piece",
    "make_marker",
    "piece_from_mesh",
]
