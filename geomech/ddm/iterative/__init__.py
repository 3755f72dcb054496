"""Iterative solution of systems too large to factor: fast multipole method, GMRES, and a coarse space for long
cracks."""
