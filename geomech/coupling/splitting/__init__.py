"""Blocks that cracks have cut through become two or more, with forces, faces and loads inherited."""
