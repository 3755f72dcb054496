"""Which cracks grow at a load or in a time step, how fast, and what they meet."""
