"""The crack network."""
