"""Benchmarks of accuracy: run time against error, and published values."""
