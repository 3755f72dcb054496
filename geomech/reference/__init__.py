"""Closed forms, published values and independent methods with which results are compared."""
