"""Loads and prescribed motion as functions of time."""
