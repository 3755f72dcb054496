"""Contact detection: entrance edges, contact points and normals, and the locations of contact springs."""
