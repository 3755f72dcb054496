"""Loads on blocks: forces, water, bolts, prescribed motion, viscous boundaries."""
