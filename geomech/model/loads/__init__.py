"""Loads and given motion as functions of time."""
