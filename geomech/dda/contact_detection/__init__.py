"""Which vertices and edges of blocks meet, and where the springs of their contacts stand."""
