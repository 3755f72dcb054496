"""How long a step may be, how far blocks may move in it, and whether anything went through anything."""
