"""Curves of runs and studies."""
