"""Blocks of higher order: displacement that is a complete polynomial of order p in each block, so that blocks bend."""
