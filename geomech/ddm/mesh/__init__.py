"""Boundary and crack elements, and the checks that a geometry must pass before it is meshed."""
