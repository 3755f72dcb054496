"""Random and sliding slopes: invariants of any scene, and independence of the time step."""
