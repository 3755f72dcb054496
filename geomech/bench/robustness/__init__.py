"""Where the solvers stay right: maps over contrasts, slivers, steps and speeds."""
