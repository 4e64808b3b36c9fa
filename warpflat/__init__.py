"""warpflat: flat sewing patterns from 3D garment surfaces, by minimum strain energy on NVIDIA Warp.

>>> import warpflat
>>> result = warpflat.flatten("bodice.obj", units="m", fabric="woven")
>>> warpflat.save_piece(result, "out")

Every name that a script needs is `warpflat.NAME`; it is loaded when it is first used.
"""

from __future__ import annotations

import os
import sys

from warpflat._version import __version__

TYPE_CHECKING = False  # importing typing would take longer than this whole file

if TYPE_CHECKING:
    from typing import Any

    from warpflat.core.errors import InputError
    from warpflat.cutting.cut_piece import cut
    from warpflat.cutting.cut_plan import CutPlan, line_part
    from warpflat.cutting.dart_move import move_dart
    from warpflat.cutting.ledger import make_ledger
    from warpflat.cutting.open_tube import open_tube
    from warpflat.cutting.remedies import advise
    from warpflat.cutting.separate_pieces import separate
    from warpflat.draping.correct_pattern import Correction, correct_pattern
    from warpflat.draping.drape_garment import drape
    from warpflat.draping.drape_pattern import Placement, drape_pattern
    from warpflat.draping.options import DrapeOptions
    from warpflat.draping.recover_pattern import Recovery, recover_pattern
    from warpflat.draping.result import Drape
    from warpflat.draping.write import save_drape
    from warpflat.export.pattern_json import read_pattern_json
    from warpflat.export.piece_files import plot, save_piece
    from warpflat.export.read_dxf import read_dxf
    from warpflat.export.read_pattern import read_pattern
    from warpflat.export.read_svg import read_svg
    from warpflat.export.usd import FrameWriter
    from warpflat.fabric.fabric import Fabric
    from warpflat.fabric.library import find_fabric, load_library
    from warpflat.flattening.develop import develop
    from warpflat.flattening.edit import change_fabric, change_surface
    from warpflat.flattening.fit_report import Remedy
    from warpflat.flattening.flatten_all import flatten_all
    from warpflat.flattening.flatten_piece import flatten
    from warpflat.flattening.gradient import Gradient, gradient
    from warpflat.flattening.progress import Progress
    from warpflat.flattening.result import Flattening
    from warpflat.flattening.step_by_step import RelaxationStep, relaxation
    from warpflat.garment.constraints import FixedLength, Straight
    from warpflat.garment.ease import SeamWish
    from warpflat.garment.edge_rules import EdgeRules
    from warpflat.garment.form_garment import FormGarment, flatten_form
    from warpflat.garment.garment import Garment
    from warpflat.garment.pattern_files import PatternOptions, garment_files, surface_files
    from warpflat.garment.sewing import sew
    from warpflat.garment.to_pattern import pattern_of_garment
    from warpflat.mannequin.forms import Form, form_from_mapping, form_names, shipped_form
    from warpflat.mannequin.mannequin import Mannequin
    from warpflat.mannequin.measurements import size_names
    from warpflat.mannequin.output import write_mannequin
    from warpflat.mannequin.scan_pose import ScanOptions
    from warpflat.model.fit import assess_pattern
    from warpflat.model.network import SpringNetwork
    from warpflat.model.strain import worn_strain
    from warpflat.model.wear import Wear
    from warpflat.pattern.draft import draft_garment
    from warpflat.pattern.marker import Cloth, make_marker
    from warpflat.scene.compare import compare_fabrics, save_comparison
    from warpflat.scene.load import load_scene, make_scene
    from warpflat.scene.run import run_scene
    from warpflat.seams.find import find_seams
    from warpflat.seams.layers import read_layers
    from warpflat.seams.options import SeamCut, SeamOptions
    from warpflat.solver.options import RelaxOptions
    from warpflat.solver.steps import Relaxation
    from warpflat.surface.io.read import read_surface
    from warpflat.surface.mesh import Surface
    from warpflat.surface.paths.lines import line_between, line_from_curve, line_on_plane, with_lines
    from warpflat.surface.repair.validate import make_surface
    from warpflat.surface.shapes import make_shape

_HERE = os.path.dirname(os.path.abspath(__file__))


def _find_kernels() -> None:
    """Import the kernels of a checkout, which lie beside this folder; installed ones lie in it."""
    folder = os.path.join(os.path.dirname(_HERE), "kernels")
    if os.path.isdir(os.path.join(_HERE, "kernels")) or not os.path.isdir(folder):
        return
    from importlib.util import module_from_spec, spec_from_file_location

    spec = spec_from_file_location(
        "warpflat.kernels", os.path.join(folder, "__init__.py"), submodule_search_locations=[folder]
    )
    assert spec is not None
    assert spec.loader is not None
    kernels = module_from_spec(spec)
    sys.modules[spec.name] = kernels
    spec.loader.exec_module(kernels)
    globals()["kernels"] = kernels


_find_kernels()

_HOME = {
    "Cloth": "pattern.marker",
    "Correction": "draping.correct_pattern",
    "CutPlan": "cutting.cut_plan",
    "Drape": "draping.result",
    "DrapeOptions": "draping.options",
    "EdgeRules": "garment.edge_rules",
    "Fabric": "fabric.fabric",
    "FixedLength": "garment.constraints",
    "Flattening": "flattening.result",
    "Form": "mannequin.forms",
    "FormGarment": "garment.form_garment",
    "FrameWriter": "export.usd",
    "Garment": "garment.garment",
    "Gradient": "flattening.gradient",
    "InputError": "core.errors",
    "Mannequin": "mannequin.mannequin",
    "PatternOptions": "garment.pattern_files",
    "Placement": "draping.drape_pattern",
    "Progress": "flattening.progress",
    "Recovery": "draping.recover_pattern",
    "RelaxOptions": "solver.options",
    "Relaxation": "solver.steps",
    "RelaxationStep": "flattening.step_by_step",
    "Remedy": "flattening.fit_report",
    "ScanOptions": "mannequin.scan_pose",
    "SeamCut": "seams.options",
    "SeamOptions": "seams.options",
    "SeamWish": "garment.ease",
    "SpringNetwork": "model.network",
    "Straight": "garment.constraints",
    "Surface": "surface.mesh",
    "Wear": "model.wear",
    "advise": "cutting.remedies",
    "assess_pattern": "model.fit",
    "change_fabric": "flattening.edit",
    "change_surface": "flattening.edit",
    "compare_fabrics": "scene.compare",
    "correct_pattern": "draping.correct_pattern",
    "cut": "cutting.cut_piece",
    "develop": "flattening.develop",
    "draft_garment": "pattern.draft",
    "drape": "draping.drape_garment",
    "drape_pattern": "draping.drape_pattern",
    "find_fabric": "fabric.library",
    "find_seams": "seams.find",
    "flatten": "flattening.flatten_piece",
    "flatten_all": "flattening.flatten_all",
    "flatten_form": "garment.form_garment",
    "form_from_mapping": "mannequin.forms",
    "form_names": "mannequin.forms",
    "garment_files": "garment.pattern_files",
    "gradient": "flattening.gradient",
    "line_between": "surface.paths.lines",
    "line_from_curve": "surface.paths.lines",
    "line_on_plane": "surface.paths.lines",
    "line_part": "cutting.cut_plan",
    "load_library": "fabric.library",
    "load_scene": "scene.load",
    "make_ledger": "cutting.ledger",
    "make_marker": "pattern.marker",
    "make_scene": "scene.load",
    "make_shape": "surface.shapes",
    "make_surface": "surface.repair.validate",
    "move_dart": "cutting.dart_move",
    "open_tube": "cutting.open_tube",
    "pattern_of_garment": "garment.to_pattern",
    "plot": "export.piece_files",
    "read_dxf": "export.read_dxf",
    "read_layers": "seams.layers",
    "read_pattern": "export.read_pattern",
    "read_pattern_json": "export.pattern_json",
    "read_pieces": "surface.io.read_pieces",
    "read_surface": "surface.io.read",
    "read_svg": "export.read_svg",
    "recover_pattern": "draping.recover_pattern",
    "relaxation": "flattening.step_by_step",
    "run_scene": "scene.run",
    "save_comparison": "scene.compare",
    "save_drape": "draping.write",
    "save_piece": "export.piece_files",
    "separate": "cutting.separate_pieces",
    "sew": "garment.sewing",
    "sew_pieces": "garment.sew_pieces",
    "shipped_form": "mannequin.forms",
    "size_names": "mannequin.measurements",
    "surface_files": "garment.pattern_files",
    "with_lines": "surface.paths.lines",
    "worn_strain": "model.strain",
    "write_mannequin": "mannequin.output",
}

__all__ = [
    "Cloth",
    "Correction",
    "CutPlan",
    "Drape",
    "DrapeOptions",
    "EdgeRules",
    "Fabric",
    "FixedLength",
    "Flattening",
    "Form",
    "FormGarment",
    "FrameWriter",
    "Garment",
    "Gradient",
    "InputError",
    "Mannequin",
    "PatternOptions",
    "Placement",
    "Progress",
    "Recovery",
    "RelaxOptions",
    "Relaxation",
    "RelaxationStep",
    "Remedy",
    "ScanOptions",
    "SeamCut",
    "SeamOptions",
    "SeamWish",
    "SpringNetwork",
    "Straight",
    "Surface",
    "Wear",
    "__version__",
    "advise",
    "assess_pattern",
    "change_fabric",
    "change_surface",
    "compare_fabrics",
    "correct_pattern",
    "cut",
    "develop",
    "draft_garment",
    "drape",
    "drape_pattern",
    "find_fabric",
    "find_seams",
    "flatten",
    "flatten_all",
    "flatten_form",
    "form_from_mapping",
    "form_names",
    "garment_files",
    "gradient",
    "line_between",
    "line_from_curve",
    "line_on_plane",
    "line_part",
    "load_library",
    "load_scene",
    "make_ledger",
    "make_marker",
    "make_scene",
    "make_shape",
    "make_surface",
    "move_dart",
    "open_tube",
    "pattern_of_garment",
    "plot",
    "read_dxf",
    "read_layers",
    "read_pattern",
    "read_pattern_json",
    "read_pieces",
    "read_surface",
    "read_svg",
    "recover_pattern",
    "relaxation",
    "run_scene",
    "save_comparison",
    "save_drape",
    "save_piece",
    "separate",
    "sew",
    "sew_pieces",
    "shipped_form",
    "size_names",
    "surface_files",
    "with_lines",
    "worn_strain",
    "write_mannequin",
]


def __getattr__(name: str) -> Any:
    # Names are loaded when first used, so that `import warpflat` and `warpflat --help` cost nothing.
    if name not in _HOME:
        raise AttributeError(f"module 'warpflat' has no attribute {name!r}")
    from importlib import import_module

    value = getattr(import_module(f"warpflat.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
