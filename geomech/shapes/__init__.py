"""Drawings: outlines, cracks and named edges from TOML or Gmsh, assembled into the model; meshes for pictures."""

from importlib import import_module

# Resolved on first use: Shapely and Gmsh are loaded by those who draw.
_PUBLIC = {
    "Cutting": "cutting",
    "EdgeLine": "parts",
    "FieldFileError": "field_lines",
    "Flaw": "parts",
    "GmshDrawing": "gmsh_drawing",
    "GmshModelError": "gmsh_drawing",
    "GmshUnavailable": "gmsh_session",
    "InteriorMesh": "meshing",
    "Joint": "parts",
    "Mark": "parts",
    "Mend": "noding",
    "ShapeError": "parts",
    "Trace": "parts",
    "Zone": "parts",
    "assemble": "assembly",
    "block_names": "assembly",
    "cut": "cutting",
    "cutting_cracks": "network",
    "mesh_interior": "meshing",
    "read_field_file": "traces",
    "read_gmsh_model": "gmsh_model",
    "rectangle": "outlines",
    "straight_crack": "outlines",
}

__all__ = list(_PUBLIC)


def __getattr__(name: str):
    if name in _PUBLIC:
        return getattr(import_module(f"{__name__}.{_PUBLIC[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
