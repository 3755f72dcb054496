"""How geomech is built into what `pip install` installs."""
