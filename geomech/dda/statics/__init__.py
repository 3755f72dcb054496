"""Static equilibrium, in-situ stress, and the factor of safety by strength reduction."""
