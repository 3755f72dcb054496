"""What writes the pages of the manual that are not written by hand."""
