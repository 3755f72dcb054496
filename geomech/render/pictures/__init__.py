"""Pictures of runs, block systems and mechanisms."""
