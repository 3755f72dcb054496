"""Benchmarks of cost: steps, kernels, growth, output and start-up."""
