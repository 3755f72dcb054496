"""Traces mapped in the field: DXF, CSV and GeoJSON."""
