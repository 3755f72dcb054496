"""Cracks in rectangular plates and strips: published factors F = K/(σ√(πa)) and formulas with their stated accuracy.

Where a published number was rounded or not converged, `boundary_collocation.centre_crack` is the sharper reference.
"""

from __future__ import annotations

import math

#: Centre crack 2a in a long strip of width 2W in tension: a/W → F (Isida 1973, as tabulated by Tada, Paris & Irwin).
#: `boundary_collocation` confirms the digits up to 0.8; at 0.9 it has 2.5795, 8e-4 more.
CENTRE_CRACK_STRIP = {
    0.1: 1.0060, 0.2: 1.0246, 0.3: 1.0577, 0.4: 1.1094, 0.5: 1.1867, 0.6: 1.3033, 0.7: 1.4882, 0.8: 1.8160, 0.9: 2.5776
}  # fmt: skip


#: The same in a plate 2W × 2H pulled by uniform tractions: H/W → a/W → F (computed with 100 to 280 terms of
#: `boundary_collocation`, converged to the digits given).
CENTRE_CRACK_PLATE = {
    1.0: {0.1: 1.0139462, 0.3: 1.1231911, 0.5: 1.3337122, 0.7: 1.6771381, 0.9: 2.7126601},
    2.0: {0.1: 1.0060734, 0.3: 1.0583011, 0.5: 1.1876356, 0.7: 1.4891095, 0.9: 2.5799500},
    3.0: {0.1: 1.0059970, 0.3: 1.0577473, 0.5: 1.1866713, 0.7: 1.4882568, 0.9: 2.5795482},
}


def centre_crack_strip(ratio: float) -> float:
    """F of a centre crack, ``ratio`` = a/W: (1 − λ²/40 + 3λ⁴/50) √sec(πλ/2), within 0.1 % (Tada 1973)."""
    return (1 - 0.025 * ratio**2 + 0.06 * ratio**4) / math.sqrt(math.cos(math.pi * ratio / 2))


def edge_crack_strip(ratio: float) -> float:
    """F of an edge crack in tension, ``ratio`` = a/W: within 0.5 % for any ratio (Tada, Paris & Irwin 1973)."""
    angle = math.pi * ratio / 2
    bracket = 0.752 + 2.02 * ratio + 0.37 * (1 - math.sin(angle)) ** 3
    return math.sqrt(math.tan(angle) / angle) * bracket / math.cos(angle)


#: Edge crack in pure bending, σ = 6M/W²: a/W → F (Kaya & Erdogan 1987; the crack solver at order 8 has the same
#: digits).
EDGE_CRACK_BENDING = {
    0.1: 1.0472, 0.2: 1.0553, 0.3: 1.1241, 0.4: 1.2606, 0.5: 1.4972, 0.6: 1.9140, 0.7: 2.7252, 0.8: 4.6764
}  # fmt: skip


#: Three-point bending by point loads, span 4W, ends W/5 beyond: a/W → K √W/P (240 terms of `bent_beam`, 2e-5).
THREE_POINT_BENDING = {0.3: 6.05566, 0.5: 10.57489, 0.7: 23.36767}


def three_point_bending(ratio: float, load: float, depth: float) -> float:
    """K_I of a beam of span 4W under ``load`` (N/m) at midspan, depth W, edge crack a = ``ratio``·W: stated accuracy
    0.5 % for 0 ≤ a/W ≤ 1.

    Srawley (1976), Int. J. Fracture 12, 475–476; coefficients as in ASTM E399, quoted by Dowling, Mechanical Behavior
    of Materials, fig. 8.13b (the paper itself was not available).
    """
    r = ratio
    f = 3 * math.sqrt(r) * (1.99 - r * (1 - r) * (2.15 - 3.93 * r + 2.7 * r * r)) / (2 * (1 + 2 * r) * (1 - r) ** 1.5)
    return 4 * load / math.sqrt(depth) * f
