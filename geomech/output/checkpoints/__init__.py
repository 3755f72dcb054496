"""Checkpoints, from which runs are resumed."""
