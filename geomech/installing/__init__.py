"""How geomech is built into what `pip install` installs, and what a machine lacks to run it (`doctor`)."""
