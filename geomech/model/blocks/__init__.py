"""Blocks as arrays: polygons, corners, motion, key blocks."""
