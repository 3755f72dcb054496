"""Joint laws and bolts, and sums over joints."""
