"""Slanted crack in a plate in tension: measured initiation angles (Erdogan & Sih 1963)."""

from __future__ import annotations

import math

#: The plates: plexiglas sheets 9 × 18 in with a central crack of 2 in, m.
HALF_WIDTH, HALF_HEIGHT, HALF_LENGTH = 0.5 * 9 * 0.0254, 0.5 * 18 * 0.0254, 0.0254
POISSONS_RATIO = 1 / 3

#: β between crack and tension → mean initiation angle, degrees (Erdogan & Sih 1963, J. Basic Engng
#: 85, 519–527, in the means of Sih 1974, Int. J. Fracture 10, 305–321, Table 1). Neither paper was at hand: angles and
#: the sheets' sizes were read where a boundary-element code is compared with that table (github.com/l-s-campos/BEM_gmsh,
#: commit 2b55f3b, scripts/crack/erdogan_sih_mts.jl), and are those of earlier notes from the literature. Single cracks
#: scattered by degrees.
MEASURED_TURN = {30.0: 62.4, 40.0: 55.6, 50.0: 51.1, 60.0: 43.1, 70.0: 30.7, 80.0: 17.3}


def largest_hoop_stress(beta_deg: float) -> float:
    """Angle (degrees) of the largest hoop stress for a crack at β to the tension in the infinite plane: the root of sin
    θ = cot β (3 cos θ − 1) (Erdogan & Sih 1963, closed form)."""
    ratio = 1 / math.tan(math.radians(beta_deg))
    return math.degrees(2 * math.atan(2 * ratio / (1 + math.sqrt(1 + 8 * ratio**2))))
