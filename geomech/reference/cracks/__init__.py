"""Closed forms and second methods for cracks."""
