"""Random and sliding slopes: what must hold of any scene, and what may not change with the step."""
