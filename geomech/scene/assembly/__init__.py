"""Conversion of a scene's tables to loads, joint laws, jointing and supports of the problem."""
