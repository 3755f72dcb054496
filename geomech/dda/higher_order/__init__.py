"""Blocks of higher order: displacement in each block is a complete polynomial of order p, so that blocks can bend."""
