"""`python -m geomech` is the command `geomech`."""

import sys

from .cli import main

sys.exit(main())
