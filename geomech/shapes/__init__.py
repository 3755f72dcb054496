"""Drawings: outlines, cracks and named edges from TOML or Gmsh, assembled into the model; meshes for pictures."""

import warnings
from importlib import import_module

# Imported on first use: only drawing needs Shapely and Gmsh.
_PUBLIC = {
    "Cutting": "block_cutting.cutting",
    "EdgeLine": "parts",
    "FieldFileError": "traces.field_lines",
    "Flaw": "parts",
    "GmshDrawing": "gmsh_models.model_drawing",
    "GmshModelError": "gmsh_models.model_drawing",
    "GmshUnavailable": "gmsh_models.session",
    "InteriorMesh": "meshing",
    "Joint": "parts",
    "Mark": "parts",
    "Repair": "block_cutting.noding",
    "ShapeError": "parts",
    "Trace": "parts",
    "Zone": "parts",
    "assemble": "assembly",
    "block_names": "assembly",
    "cut": "block_cutting.cutting",
    "cutting_cracks": "block_cutting.crack_traces",
    "mesh_interior": "meshing",
    "read_field_file": "traces.trace_tables",
    "read_gmsh_model": "gmsh_models.model_files",
    "rectangle": "outlines",
    "straight_crack": "outlines",
}

__all__ = list(_PUBLIC)


def __getattr__(name: str):
    if name == "Mend":
        warnings.warn(f"{__name__}.Mend is now {__name__}.Repair", DeprecationWarning, stacklevel=2)
        name = "Repair"
    if name in _PUBLIC:
        return getattr(import_module(f"{__name__}.{_PUBLIC[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
