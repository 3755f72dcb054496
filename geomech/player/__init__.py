"""Runs that play in a browser: a page in one file, a page of a run that still lasts, a widget in a notebook."""
