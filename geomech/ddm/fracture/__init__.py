"""Stress intensity factors, their error estimates, and criteria of crack growth."""
