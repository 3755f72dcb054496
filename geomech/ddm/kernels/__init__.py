"""Influence of straight displacement discontinuity elements on points, in closed form and by series."""
