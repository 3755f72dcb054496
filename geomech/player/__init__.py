"""Playback of runs in a browser: a self-contained page, a served page of a run in progress, and a notebook widget."""
