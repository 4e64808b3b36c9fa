"""Kinds of files, by their endings: what reads those that are read, and what to export from the program of those that are not."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

__all__ = ["FOREIGN", "foreign_words", "other_kind_words"]

_MESH = "export the garment there as OBJ, GLB or USD"
_SEWN = f"{_MESH} with its pattern as texture coordinates, or its pattern as DXF (AAMA)"
_PATTERN = "export its pieces there as DXF (AAMA or ASTM)"
_DRAWING = "open it in a drawing program, such as Inkscape, and save its outlines as plain SVG or DXF in true size"
_SOLID = "mesh its surface there and export it as OBJ or STL"
_POINTS = "make a mesh of its points, as in MeshLab, and export it as PLY or OBJ"
_PICTURE = "trace its outlines in a drawing program, and save them as plain SVG in true size"

#: Files of other programs that are not read, by their endings: what they are, and what to do.
FOREIGN: Mapping[str, tuple[str, str]] = {
    # Patterns
    ".val": ("a pattern of Valentina or Seamly2D", f"{_PATTERN}, or as SVG"),
    ".sm2d": ("a pattern of Seamly2D", f"{_PATTERN}, or as SVG"),
    ".vit": ("a table of measures of Valentina", "give the measures in a [mannequin] table"),
    ".vst": ("a table of measures of Valentina", "give the measures in a [mannequin] table"),
    ".smis": ("a table of measures of Seamly2D", "give the measures in a [mannequin] table"),
    ".smms": ("a table of measures of Seamly2D", "give the measures in a [mannequin] table"),
    ".pds": ("a pattern of Optitex", _PATTERN),
    ".mdl": ("a model of Lectra Modaris", _PATTERN),
    ".iba": ("a piece of Lectra Modaris", _PATTERN),
    ".rul": ("a table of grade rules", "give the DXF beside it, which holds the pieces"),
    ".plt": ("a plotter's file", f"{_PATTERN}, not for a plotter"),
    ".hpgl": ("a plotter's file", f"{_PATTERN}, not for a plotter"),
    ".dwg": ("a drawing of AutoCAD", "save it there as DXF"),
    ".pdf": ("a PDF", _DRAWING),
    ".ai": ("a drawing of Illustrator", _DRAWING),
    ".eps": ("a PostScript drawing", _DRAWING),
    ".ps": ("a PostScript drawing", _DRAWING),
    ".cdr": ("a drawing of CorelDRAW", _DRAWING),
    ".png": ("a picture", _PICTURE),
    ".jpg": ("a picture", _PICTURE),
    ".jpeg": ("a picture", _PICTURE),
    ".tif": ("a picture", _PICTURE),
    ".tiff": ("a picture", _PICTURE),
    ".bmp": ("a picture", _PICTURE),
    ".gif": ("a picture", _PICTURE),
    ".webp": ("a picture", _PICTURE),
    # Garments in three dimensions
    ".zprj": ("a project of CLO or Marvelous Designer", _SEWN),
    ".zpac": ("a garment of CLO or Marvelous Designer", _SEWN),
    ".pac": ("a garment of CLO or Marvelous Designer", _SEWN),
    ".zblk": ("a block of CLO", _SEWN),
    ".avt": ("an avatar of CLO or Marvelous Designer", "export the avatar there as OBJ"),
    ".zfab": ("a fabric of CLO", "give its stiffness in a fabric file: warpflat fabrics --help"),
    ".u3m": ("a fabric in U3M", "give its stiffness in a fabric file: warpflat fabrics --help"),
    ".bw": ("a garment of VStitcher", _SEWN),
    ".sproj": ("a project of Style3D", _SEWN),
    # Surfaces
    ".fbx": ("a scene in FBX", _MESH),
    ".blend": ("a scene of Blender", _MESH),
    ".dae": ("a scene in COLLADA", _MESH),
    ".abc": ("a scene in Alembic", _MESH),
    ".3ds": ("a scene of 3ds Max", _MESH),
    ".max": ("a scene of 3ds Max", _MESH),
    ".ma": ("a scene of Maya", _MESH),
    ".mb": ("a scene of Maya", _MESH),
    ".c4d": ("a scene of Cinema 4D", _MESH),
    ".hip": ("a scene of Houdini", _MESH),
    ".lwo": ("an object of LightWave", _MESH),
    ".lxo": ("a scene of Modo", _MESH),
    ".skp": ("a model of SketchUp", _MESH),
    ".ztl": ("a tool of ZBrush", _MESH),
    ".zpr": ("a project of ZBrush", _MESH),
    ".duf": ("a scene of Daz Studio", _MESH),
    ".pmx": ("a model of MikuMikuDance", _MESH),
    ".bvh": ("a motion without a surface", _MESH),
    ".x3d": ("a scene in X3D", _MESH),
    ".wrl": ("a scene in VRML", _MESH),
    ".3mf": ("a print in 3MF", _MESH),
    ".amf": ("a print in AMF", _MESH),
    ".vtk": ("a grid in VTK", _MESH),
    ".vtp": ("a surface in VTK", _MESH),
    ".msh": ("a mesh of Gmsh", _MESH),
    ".3dm": ("a model of Rhino", _SOLID),
    ".step": ("a solid in STEP", _SOLID),
    ".stp": ("a solid in STEP", _SOLID),
    ".iges": ("surfaces in IGES", _SOLID),
    ".igs": ("surfaces in IGES", _SOLID),
    ".brep": ("a solid of Open CASCADE", _SOLID),
    ".sldprt": ("a part of SolidWorks", _SOLID),
    ".xyz": ("points without faces", _POINTS),
    ".pcd": ("points without faces", _POINTS),
    ".las": ("points without faces", _POINTS),
    ".e57": ("points without faces", _POINTS),
    # Folders that are packed
    ".zip": ("an archive", "unpack it, and give the file in it"),
    ".7z": ("an archive", "unpack it, and give the file in it"),
    ".rar": ("an archive", "unpack it, and give the file in it"),
}
_OWN = {
    "a mesh": (
        (".obj", ".off", ".ply", ".stl", ".glb", ".gltf", ".vrm", ".usd", ".usda", ".usdc", ".usdz"),
        "warpflat flatten reads it",
    ),
    "a pattern": ((".dxf", ".svg", ".json"), "warpflat drape, export and marker read it"),
    "a text in TOML": ((".toml",), "warpflat run reads it"),
}


def foreign_words(path: Path) -> str:
    """Return what a file of another program is, and what to export from it; "" of a kind that is not in the table."""
    found = FOREIGN.get(path.suffix.lower())
    return "" if found is None else f"is {found[0]}, which is not read; {found[1]}"


def other_kind_words(path: Path, wanted: str) -> str:
    """Return which command reads a file that is given where another kind is wanted; "" of a kind that is not in the table."""
    ending = path.suffix.lower()
    for what, (endings, command) in _OWN.items():
        if ending in endings:
            return f"is {what}, not {wanted}: {command}"
    return ""
