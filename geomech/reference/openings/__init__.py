"""Holes, boreholes, tunnels and roof blocks."""
