"""Other methods that the solvers are compared with."""
