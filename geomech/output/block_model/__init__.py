"""The block system before anything runs, as files."""
