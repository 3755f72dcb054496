"""Closed forms, published values and second methods that results are compared with."""
