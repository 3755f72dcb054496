"""Checks across the tables of a scene."""
