"""A small scene that is right, for tests to spoil."""

from __future__ import annotations

GOOD = """\
title = "A plate between two loads"

[[geometry.zones]]
name = "rock"
rectangle = [0.0, 0.0, 1.0, 2.0]

[[geometry.cracks]]
name = "flaw"
centre = [0.5, 1.0]
length_m = 0.2
angle_deg = 30

[[geometry.edges]]
name = "load:top"
line = [[0.0, 2.0], [1.0, 2.0]]

[[geometry.edges]]
name = "load:bottom"
line = [[0.0, 0.0], [1.0, 0.0]]

[materials.rock]
youngs_modulus_pa = 20e9
poissons_ratio = 0.25
density_kg_m3 = 2500
k_ic_pa_sqrt_m = 1e6

[[loads.tractions]]
edge = "load:top"
rate_pa_per_s = [0.0, -1e5]

[[loads.tractions]]
edge = "load:bottom"
rate_pa_per_s = [0.0, 1e5]

[run]
end_time_s = 100.0
"""
