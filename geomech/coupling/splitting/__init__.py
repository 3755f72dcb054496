"""Splits blocks that cracks have cut through; the parts inherit forces, joint memory and loads."""
