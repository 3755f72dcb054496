"""What contacts have in reserve, held against the states that their forces call for."""

from __future__ import annotations

import numpy as np
import pytest

from geomech.dda.joint_laws.coulomb_return import check_states, reserves
from geomech.dda.joint_laws.penalty_springs import Springs
from geomech.model import OPEN, SLIP, STICK


@pytest.mark.parametrize("slack", [0.0, 4e-14, 1e-11])
def test_contacts_leave_their_states_where_nothing_is_left_in_reserve(slack):
    """Loads that come within the round-off of coordinates of what contacts bear, and beyond it. A search for the load
    at which a contact changes goes by its reserve, and would look for ever short of a change that comes later."""
    n, random = 3000, np.random.default_rng(3)
    state, bonded = random.choice([OPEN, STICK, SLIP], n), random.integers(0, 2, n)
    bonded[state == SLIP] = 0
    zero = np.zeros(n)
    springs = Springs(
        normal=10 ** random.uniform(9, 12, n), shear=10 ** random.uniform(9, 12, n), peak=random.uniform(0.0, 1.5, n),
        hold=random.choice([0.0, 1e3], n), cohesion=random.choice([0.0, 1e4], n), tension=random.choice([0.0, 3e3], n),
        friction=zero, sliding=zero, lift=zero, keeps=np.zeros(n, bool), crushing=np.full(n, np.inf),
    )  # fmt: skip
    # Each close to one of its limits: by parts, within and beyond, of what is not known of it.
    beyond = random.uniform(-2.0, 3.0, n)
    rounding, pull = springs.normal * slack, np.where(bonded == 1, springs.tension, 0.0)
    pressed = random.uniform(1e2, 1e5, n)
    strength = springs.peak * pressed + springs.hold + np.where(bonded == 1, springs.cohesion, 0.0)
    unknown = 1e-9 * strength + (1e-3 * springs.shear + springs.peak * springs.normal) * slack
    lifts = (state == SLIP) | (random.random(n) < 0.5)
    normal = np.where(lifts, -pull - beyond * (rounding + 1e-9 * pull), pressed)
    shear = np.where(lifts, 0.0, random.choice([-1.0, 1.0], n) * (strength + beyond * unknown))
    gap = np.where(state == OPEN, -beyond * slack, -normal / springs.normal)
    forces, states = np.column_stack([normal, shear, gap, zero]), (state, np.ones(n), bonded)
    after = check_states(forces, states, tuple(springs), zero, np.full(n, slack))[0]
    reserve = reserves(state, bonded, normal, shear, gap, springs, slack)
    # Where forces are sums of larger numbers, these are known to their last digits.
    digits = 4e-16 * (np.abs(normal) + np.abs(shear) + strength)
    clear = np.abs(reserve) > digits
    assert ((after != state) == (reserve < 0.0))[clear].all()
    for each in (OPEN, STICK, SLIP) if slack else (STICK,):
        mine = clear & (state == each)
        assert mine.sum() > 500 and 0.2 < (reserve[mine] < 0.0).mean() < 0.8
