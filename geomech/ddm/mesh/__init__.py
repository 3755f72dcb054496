"""Elements on outlines and cracks, and the checks that the geometry must pass before."""
