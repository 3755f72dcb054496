"""Closed forms and independent methods for cracks."""
