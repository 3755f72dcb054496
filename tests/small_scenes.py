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


def two_set_slope(bedding: str, cross: str, geometry: str = "", *, rock: str = "") -> str:
    """The geometry, rock and ground of a slope of 40 m with bedding and cross joints, whose tables say ``bedding`` and
    ``cross``; further keys of [geometry] and of [zones.rock]."""
    outline = "[[0, 0], [60, 0], [60, 20], [42, 20], [30, 40], [0, 40]]"
    ground = "[[-2, -2], [62, -2], [62, 20], [60, 20], [60, 0], [0, 0], [0, 40], [-2, 40]]"
    return f"""
[geometry]
seed = 1
dead_ends = "trim"
{geometry}
[[geometry.zones]]
name = "rock"
polygon = {outline}
[[geometry.zones]]
name = "base"
polygon = {ground}
[[geometry.joint_sets]]
name = "bedding"
region = {outline}
{bedding}
[[geometry.joint_sets]]
name = "cross"
angle_deg = 70
angle_deviation_deg = 5
region = {outline}
{cross}
[materials.rock]
youngs_modulus_pa = 20e9
poissons_ratio = 0.25
density_kg_m3 = 2600
[zones.base]
fixed = true
[zones.rock]
{rock}
[joints.default]
friction_angle_deg = 30
[joints.beds]
friction_angle_deg = 20
edges = ["joint:bedding"]
"""
