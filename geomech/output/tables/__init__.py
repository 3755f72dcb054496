"""Histories as CSV, and the summary of a run."""
