"""Limits of a time step: its length, how far blocks may move, and detection of vertices that crossed an outline."""
