"""Scenes that take no time, as texts: what tests of several folders run where it matters little what is run."""

from geomech.installing.doctor import TORN_PLATE

#: A plate that is pulled until its crack has cut it in two: the one that `geomech doctor --warm` runs.
PLATE = TORN_PLATE


def block(title: str = "", *, moving: bool = False) -> str:
    """A block that lies on the ground, for three steps; ``moving`` in dynamics."""
    return (
        (f'title = "{title}"\n' if title else "")
        + """
[geometry]
zones = [{ name = "ground", rectangle = [0, -1, 3, 0] }, { name = "block", rectangle = [1, 0, 2, 1] }]
[materials.rock]
youngs_modulus_pa = 1e9
poissons_ratio = 0.2
density_kg_m3 = 2000
[zones.ground]
fixed = true
[loads]
gravity_m_s2 = [0, -9.81]
[dda]
time_step_s = 0.01
"""
        + ("dynamic_factor = 1.0\n" if moving else "")
        + "[run]\nend_time_s = 0.03\n"
    )
