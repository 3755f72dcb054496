"""Systems too large to factor: fast multipoles, GMRES, and a coarse space for long cracks."""
