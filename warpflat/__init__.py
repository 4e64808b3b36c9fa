"""warpflat: flat sewing patterns from 3D garment surfaces, by minimum strain energy on NVIDIA Warp.

>>> import warpflat
>>> result = warpflat.flatten(warpflat.read_surface("bodice.obj", units="m"), fabric="woven")
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

    from warpflat.app.scene.compare import compare_fabrics, save_comparison
    from warpflat.app.scene.load import load_scene, make_scene
    from warpflat.app.scene.run import run_scene
    from warpflat.core.errors import InputError
    from warpflat.flat.cutting.cut_piece import cut
    from warpflat.flat.cutting.cut_plan import CutPlan, line_part
    from warpflat.flat.cutting.dart_move import move_dart
    from warpflat.flat.cutting.ledger import make_ledger
    from warpflat.flat.cutting.open_tube import open_tube
    from warpflat.flat.cutting.remedies import advise
    from warpflat.flat.cutting.separate_pieces import separate
    from warpflat.flat.fabric.fabric import Fabric
    from warpflat.flat.fabric.library import find_fabric, load_library
    from warpflat.flat.flattening.develop import develop
    from warpflat.flat.flattening.edit import change_fabric, change_surface
    from warpflat.flat.flattening.fit_report import Remedy
    from warpflat.flat.flattening.flatten_all import flatten_all
    from warpflat.flat.flattening.flatten_piece import flatten
    from warpflat.flat.flattening.gradient import Gradient, gradient
    from warpflat.flat.flattening.progress import Progress
    from warpflat.flat.flattening.result import Flattening
    from warpflat.flat.flattening.step_by_step import RelaxationStep, relaxation
    from warpflat.flat.model.fit import assess_pattern
    from warpflat.flat.model.network import SpringNetwork
    from warpflat.flat.model.strain import worn_strain
    from warpflat.flat.model.wear import Wear
    from warpflat.flat.solver.options import RelaxOptions
    from warpflat.flat.solver.steps import Relaxation
    from warpflat.flat.surface.io.read import read_surface
    from warpflat.flat.surface.mesh import Surface
    from warpflat.flat.surface.paths.lines import line_between, line_from_curve, line_on_plane, with_lines
    from warpflat.flat.surface.repair.validate import make_surface
    from warpflat.flat.surface.shapes import make_shape
    from warpflat.garment.construction.constraints import FixedLength, Straight
    from warpflat.garment.construction.ease import SeamWish
    from warpflat.garment.construction.edge_rules import EdgeRules
    from warpflat.garment.construction.form_garment import FormGarment, flatten_form
    from warpflat.garment.construction.garment import Garment
    from warpflat.garment.construction.pattern_files import PatternOptions, garment_files, surface_files
    from warpflat.garment.construction.sewing import sew
    from warpflat.garment.construction.to_pattern import pattern_of_garment
    from warpflat.garment.draping.correct_pattern import Correction, correct_pattern
    from warpflat.garment.draping.drape_garment import drape
    from warpflat.garment.draping.drape_pattern import Placement, drape_pattern
    from warpflat.garment.draping.options import DrapeOptions
    from warpflat.garment.draping.recover_pattern import Recovery, recover_pattern
    from warpflat.garment.draping.result import Drape
    from warpflat.garment.draping.write import save_drape
    from warpflat.garment.mannequin.forms import Form, form_from_mapping, form_names, shipped_form
    from warpflat.garment.mannequin.mannequin import Mannequin
    from warpflat.garment.mannequin.measurements import size_names
    from warpflat.garment.mannequin.output import write_mannequin
    from warpflat.garment.mannequin.scan_pose import ScanOptions
    from warpflat.garment.seams.find import find_seams
    from warpflat.garment.seams.layers import read_layers
    from warpflat.garment.seams.options import SeamCut, SeamOptions
    from warpflat.pattern.drafting.draft import draft_garment
    from warpflat.pattern.drafting.marker import Cloth, make_marker
    from warpflat.pattern.export.pattern_json import read_pattern_json
    from warpflat.pattern.export.piece_files import plot, save_piece
    from warpflat.pattern.export.read_dxf import read_dxf
    from warpflat.pattern.export.read_pattern import read_pattern
    from warpflat.pattern.export.read_svg import read_svg
    from warpflat.pattern.export.usd import FrameWriter

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
    "Cloth": "pattern.drafting.marker",
    "Correction": "garment.draping.correct_pattern",
    "CutPlan": "flat.cutting.cut_plan",
    "Drape": "garment.draping.result",
    "DrapeOptions": "garment.draping.options",
    "EdgeRules": "garment.construction.edge_rules",
    "Fabric": "flat.fabric.fabric",
    "FixedLength": "garment.construction.constraints",
    "Flattening": "flat.flattening.result",
    "Form": "garment.mannequin.forms",
    "FormGarment": "garment.construction.form_garment",
    "FrameWriter": "pattern.export.usd",
    "Garment": "garment.construction.garment",
    "Gradient": "flat.flattening.gradient",
    "InputError": "core.errors",
    "Mannequin": "garment.mannequin.mannequin",
    "PatternOptions": "garment.construction.pattern_files",
    "Placement": "garment.draping.drape_pattern",
    "Progress": "flat.flattening.progress",
    "Recovery": "garment.draping.recover_pattern",
    "RelaxOptions": "flat.solver.options",
    "Relaxation": "flat.solver.steps",
    "RelaxationStep": "flat.flattening.step_by_step",
    "Remedy": "flat.flattening.fit_report",
    "ScanOptions": "garment.mannequin.scan_pose",
    "SeamCut": "garment.seams.options",
    "SeamOptions": "garment.seams.options",
    "SeamWish": "garment.construction.ease",
    "SpringNetwork": "flat.model.network",
    "Straight": "garment.construction.constraints",
    "Surface": "flat.surface.mesh",
    "Wear": "flat.model.wear",
    "advise": "flat.cutting.remedies",
    "assess_pattern": "flat.model.fit",
    "change_fabric": "flat.flattening.edit",
    "change_surface": "flat.flattening.edit",
    "compare_fabrics": "app.scene.compare",
    "correct_pattern": "garment.draping.correct_pattern",
    "cut": "flat.cutting.cut_piece",
    "develop": "flat.flattening.develop",
    "draft_garment": "pattern.drafting.draft",
    "drape": "garment.draping.drape_garment",
    "drape_pattern": "garment.draping.drape_pattern",
    "find_fabric": "flat.fabric.library",
    "find_seams": "garment.seams.find",
    "flatten": "flat.flattening.flatten_piece",
    "flatten_all": "flat.flattening.flatten_all",
    "flatten_form": "garment.construction.form_garment",
    "form_from_mapping": "garment.mannequin.forms",
    "form_names": "garment.mannequin.forms",
    "garment_files": "garment.construction.pattern_files",
    "gradient": "flat.flattening.gradient",
    "line_between": "flat.surface.paths.lines",
    "line_from_curve": "flat.surface.paths.lines",
    "line_on_plane": "flat.surface.paths.lines",
    "line_part": "flat.cutting.cut_plan",
    "load_library": "flat.fabric.library",
    "load_scene": "app.scene.load",
    "make_ledger": "flat.cutting.ledger",
    "make_marker": "pattern.drafting.marker",
    "make_scene": "app.scene.load",
    "make_shape": "flat.surface.shapes",
    "make_surface": "flat.surface.repair.validate",
    "move_dart": "flat.cutting.dart_move",
    "open_tube": "flat.cutting.open_tube",
    "pattern_of_garment": "garment.construction.to_pattern",
    "plot": "pattern.export.piece_files",
    "read_dxf": "pattern.export.read_dxf",
    "read_layers": "garment.seams.layers",
    "read_pattern": "pattern.export.read_pattern",
    "read_pattern_json": "pattern.export.pattern_json",
    "read_pieces": "flat.surface.io.read_pieces",
    "read_surface": "flat.surface.io.read",
    "read_svg": "pattern.export.read_svg",
    "recover_pattern": "garment.draping.recover_pattern",
    "relaxation": "flat.flattening.step_by_step",
    "run_scene": "app.scene.run",
    "save_comparison": "app.scene.compare",
    "save_drape": "garment.draping.write",
    "save_piece": "pattern.export.piece_files",
    "separate": "flat.cutting.separate_pieces",
    "sew": "garment.construction.sewing",
    "sew_pieces": "garment.construction.sew_pieces",
    "shipped_form": "garment.mannequin.forms",
    "size_names": "garment.mannequin.measurements",
    "surface_files": "garment.construction.pattern_files",
    "with_lines": "flat.surface.paths.lines",
    "worn_strain": "flat.model.strain",
    "write_mannequin": "garment.mannequin.output",
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
