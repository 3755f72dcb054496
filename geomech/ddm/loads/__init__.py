"""Loads and supports of an elastic body, and its response to unit loads."""
