"""Pictures and movies of any field that a run has written: displacement, slip, forces, K, stress and others."""
