"""Benchmarks of cost: what steps, kernels, growth, output and start-up take."""
