"""Mapped traces from DXF, CSV and GeoJSON."""
