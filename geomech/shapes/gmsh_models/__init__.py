"""Gmsh models, meshes and CAD files read as drawings."""
