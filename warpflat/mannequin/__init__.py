"""The mannequin: a dress form of bricks from a size, from measurements or from a scan, and the forms on it."""

from __future__ import annotations

from warpflat.mannequin.blend import Adjustment
from warpflat.mannequin.carry import Carrier
from warpflat.mannequin.forms import Form, FormResult, PieceRecipe, form_from_mapping, form_names, shipped_form
from warpflat.mannequin.mannequin import Level, Mannequin
from warpflat.mannequin.measurements import size_names
from warpflat.mannequin.output import write_mannequin
from warpflat.mannequin.pieces import FormPiece, FormSeam
from warpflat.mannequin.scan_pose import ScanOptions

__all__ = [
    "Adjustment",
    "Carrier",
    "Form",
    "FormPiece",
    "FormResult",
    "FormSeam",
    "Level",
    "Mannequin",
    "PieceRecipe",
    "ScanOptions",
    "form_from_mapping",
    "form_names",
    "shipped_form",
    "size_names",
    "write_mannequin",
]
