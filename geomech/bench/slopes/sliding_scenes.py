"""Slopes whose beds dip out of the face, cut by cross joints: a family of sliding scenes.

The rock is 60 m wide and 40 m high, with a face from the toe (42, 20) to the crest (30, 40), on a fixed base. Beds dip
more steeply than their friction angle and less steeply than the face: the rock above the lowest bed that daylights on
the face slides as one rigid slab, with the acceleration

    a = g (sin β − tan φ cos β)

of every block (β dip, φ friction angle of the beds; Hoek & Bray 1981, plane failure without water). The upper beds then
carry exactly the shear at which they would slide too, so that none has to. (This requires blocks that do not rotate:
slender columns at the face may topple.)
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...model import Problem

GRAVITY = 9.81
#: Friction angles, degrees, of beds and of cross joints.
BEDS, CROSS = 20.0, 30.0
TOE, CREST = (42.0, 20.0), (30.0, 40.0)
#: Young's modulus, Pa: 40 m of such rock settle by 0.2 mm under their weight, ρgH²/(2E), 1 % of the slab's fall in 0.3
#: s at the least dip. (At 20 GPa it would be 5 %.)
STIFF = 100e9
#: Blocks smaller than this part of spacing × spacing are merged with a neighbour: rarely, because it may be one across
#: a bed, which is then no longer plane.
SMALLEST = 2e-3
_ROCK = "[[0, 0], [60, 0], [60, 20], [42, 20], [30, 40], [0, 40]]"
_BASE = "[[-2, -2], [62, -2], [62, 20], [60, 20], [60, 0], [0, 0], [0, 40], [-2, 40]]"
#: m: vertices nearer than this to a bed lie on it; blocks are cut on a grid of 1e-10 m.
_ON_BED = 1e-6


@dataclass(frozen=True)
class Slope:
    """Geometry of a slope.

    Angles in degrees from the horizontal: beds dip to the right (``dip`` > 0), ``cross`` joints rise to it and vary by
    ``deviation``; spacings, and ``length`` and ``gap`` of staggered cross joints (0: continuous), in m; ``seed`` of the
    sets.
    """

    dip: float
    cross: float
    deviation: float
    bed_spacing: float
    cross_spacing: float
    length: float = 0.0
    gap: float = 0.0
    seed: int = 0
    modulus: float = STIFF

    @property
    def acceleration(self) -> float:
        """Acceleration of the rigid slab along the beds, m/s²."""
        dip = math.radians(self.dip)
        return GRAVITY * (math.sin(dip) - math.tan(math.radians(BEDS)) * math.cos(dip))

    def text(self, time_step: float, end: float) -> str:
        """The scene file: motion from rest until ``end``, s."""
        cross = [
            f'[[geometry.joint_sets]]\nname = "cross"\nangle_deg = {self.cross!r}',
            f"angle_deviation_deg = {self.deviation!r}\nspacing_m = {self.cross_spacing!r}\nregion = {_ROCK}",
        ]
        if self.length:
            cross.append(f"length_m = {self.length!r}\ngap_m = {self.gap!r}")
        smallest = SMALLEST * self.bed_spacing * self.cross_spacing
        return "\n".join(
            [
                f'title = "Sliding slope {self.seed}"',
                f'[geometry]\nsmallest_block_m2 = {smallest!r}\nseed = {self.seed}\ndead_ends = "trim"',
                f'[[geometry.zones]]\nname = "rock"\npolygon = {_ROCK}',
                f'[[geometry.zones]]\nname = "base"\npolygon = {_BASE}',
                f'[[geometry.joint_sets]]\nname = "bedding"\nangle_deg = {-self.dip!r}',
                f"spacing_m = {self.bed_spacing!r}\nregion = {_ROCK}",
                *cross,
                f"[materials.rock]\nyoungs_modulus_pa = {self.modulus!r}\npoissons_ratio = 0.25\ndensity_kg_m3 = 2600",
                "[zones.base]\nfixed = true",
                f"[joints.default]\nfriction_angle_deg = {CROSS!r}",
                f'[joints.beds]\nfriction_angle_deg = {BEDS!r}\nedges = ["joint:bedding"]',
                f"[loads]\ngravity_m_s2 = [0, {-GRAVITY!r}]",
                f"[dda]\ndynamic_factor = 1.0\ntime_step_s = {time_step!r}\nmax_displacement_ratio = 0.01",
                f"[run]\nend_time_s = {end!r}",
            ]
        )


def random_slope(seed: int) -> Slope:
    """The slope of a ``seed``: dip 25 to 45°, cross joints at 50 to 90°, spacings of 1 to 5 m, continuous or staggered
    cross joints."""
    rng = np.random.default_rng(seed)
    bed_spacing, cross_spacing = rng.uniform(1.0, 5.0), rng.uniform(1.0, 5.0)
    length = gap = 0.0
    if rng.random() < 0.5:
        length, gap = bed_spacing * rng.uniform(1.5, 4.0), bed_spacing * rng.uniform(0.3, 1.0)
    values = [
        rng.uniform(25.0, 45.0), rng.uniform(50.0, 90.0), rng.uniform(0.0, 5.0), bed_spacing, cross_spacing, length,
        gap,
    ]  # fmt: skip
    return Slope(*(round(float(value), 2) for value in values), seed=seed)


@dataclass(frozen=True, eq=False)
class Slab:
    """The rock above the lowest bed that daylights on the face.

    blocks   (n_blocks,) True for its blocks; ``mass``: kg/m
    dip      of the bed, rad
    whole    no block extends through the bed
    """

    blocks: np.ndarray
    mass: float
    dip: float
    whole: bool

    def work(self, acceleration: float, seconds: float) -> float:
        """Work of gravity on the rigid slab after ``seconds`` from rest, J/m: Σ m g sin β · ½ a t²."""
        return self.mass * GRAVITY * math.sin(self.dip) * 0.5 * acceleration * seconds**2


def slab(slope: Slope, problem: Problem) -> Slab | None:
    """From the blocks as drawn; None if no bed daylights on the face."""
    blocks = problem.blocks
    dip = math.radians(slope.dip)
    normal = np.array([math.sin(dip), math.cos(dip)])
    bed = blocks.edges_named("joint:bedding")
    ends = np.stack([blocks.vertices[bed], blocks.vertices[blocks.next_vertex[bed]]])
    height = ends.mean(axis=0) @ normal
    # Beds through the face; those below the bench, to the right of the toe, are others.
    low, high = np.array(TOE) @ normal, np.array(CREST) @ normal
    through = height[(height > low + _ON_BED) & (height < high - _ON_BED)]
    if not len(through):
        return None
    lowest = float(through.min())
    above = blocks.vertices @ normal - lowest
    least = np.minimum.reduceat(above, blocks.vertex_start[:-1])
    most = np.maximum.reduceat(above, blocks.vertex_start[:-1])
    centroid = np.array([blocks.area_moments(b)[1] for b in range(blocks.n_blocks)])
    top = np.maximum.reduceat(blocks.vertices[:, 1], blocks.vertex_start[:-1])
    free = ~np.asarray(blocks.fixed, bool)
    # The same plane continues below the bench, where nothing daylights: that part lies below the toe.
    over = free & (centroid @ normal > lowest) & (centroid[:, 1] > TOE[1])
    crossed = free & (least < -_ON_BED) & (most > _ON_BED) & (top > TOE[1] + _ON_BED)
    density = np.array([material.density for material in problem.materials])[blocks.material]
    mass = float((density * blocks.areas())[over].sum())
    return Slab(over, mass, dip, not bool(crossed.any()))
