"""Files of the block system before a run."""
