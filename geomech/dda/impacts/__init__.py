"""Impacts with a coefficient of restitution: the moment of the impact, impulses, velocities after it."""
