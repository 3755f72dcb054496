"""Small scenes of blocks of higher order for the maps of `stability`: those of `stability_scenes` with this order, rock that is
nearly incompressible, frames with re-entrant corners, and a block that spins."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from ... import dda
from ...model import Blocks, DdaSettings, JointLaw, Loads, Material, State
from . import stability_scenes as scenes
from .stability_grid import Map
from .stability_scenes import Outcome, Watch, rectangle

#: Order of the blocks in maps over other quantities.
ORDER = 3
#: Speed of the spinning block, rad/s, and its turns.
SPIN, TURNS = 50.0, 2.0


def incompressible(order: float, missing: float) -> Outcome:
    """The weight that a column of this order transmits, with Poisson's ratio ½ − ``missing``."""
    polygons = [rectangle(-1, -1, 2, 0), rectangle(0, 0, 1, 1), rectangle(0, 1, 1, 2)]
    rock = Material("rock", 10e9, 0.5 - missing, density=2600.0)
    system = scenes.system_of(polygons, [True, False, False], 30.0, [rock], order=int(order))
    total, watch = scenes.carried(system)
    return watch.outcome(scenes.weights_off(system, total))


def frame(order: float, thickness: float) -> Outcome:
    """The weight of a frame on two legs, with two re-entrant corners, whose legs and lintel have this ``thickness``, m."""
    t = thickness
    outline = np.array([[0, 0], [t, 0], [t, 1], [2 - t, 1], [2 - t, 0], [2, 0], [2, 1 + t], [0, 1 + t]])
    rock = Material("rock", 10e9, 0.25, density=2600.0)
    system = scenes.system_of([rectangle(-1, -1, 3, 0), outline], [True, False], 30.0, [rock], order=int(order))
    total, watch = scenes.carried(system)
    return watch.outcome(scenes.weights_off(system, total))


def spinning(order: float, dt: float) -> Outcome:
    """A block of 4 m by 1 m that spins freely: angular momentum and energy after two turns.

    Without Poisson's ratio u = ρω² (a² x − x³/3)/(2E), v likewise, is exact (σx = ρω² (a² − x²)/2), so that the spin ω
    of the stretched block follows from its first one; vibrations are damped.
    """
    density, modulus, half = 2600.0, 10e9, np.array([2.0, 0.5])
    blocks = Blocks.from_polygons([rectangle(-2, -0.5, 2, 0.5)], order=[int(order)])
    settings = DdaSettings(
        dynamic_factor=1.0, time_step=dt, newmark=(0.25, 0.5), damping=0.3, max_displacement_ratio=0.5
    )
    rock = Material("rock", modulus, 0.0, density=density, plane="stress")
    system = dda.BlockSystem(blocks, [rock], [JointLaw("joint")], settings=settings)
    state = State.at_rest(blocks)
    velocity = state.velocity.copy()
    velocity[0, 2] = SPIN
    watch = Watch(system)
    end = watch.run(replace(state, velocity=velocity), Loads(), 2.0 * np.pi * TURNS / SPIN, dt, 20_000)
    # ∫ x u dA of both directions over ∫ r² dA.
    wider = density * SPIN**2 / (2.0 * modulus) * 4.0 / 15.0 * (half**4).sum() / ((half**2).sum() / 3.0)
    spin = SPIN / (1.0 + 2.0 * wider)
    off = max(abs(end.velocity[0, 2] / spin - 1.0), abs(end.rotation[0] / (spin * end.time) - 1.0))
    return watch.outcome(max(off, watch.gain))


def maps(quick: bool) -> Iterator[Map]:
    """The maps of blocks of higher order; ``quick`` takes every second value and fewer steps."""

    def some(*values: float) -> tuple[float, ...]:
        return values[::2] if quick else values

    penalties, steps = some(0.1, 1, 40, 1e3, 1e5), some(1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.1, 1, 10)
    ratios = some(1e-6, 1e-3, 1, 1e3, 1e6)
    most = 50 if quick else 300
    load = "contact forces of a column off its weight"
    yield Map(
        f"order {ORDER}: sliding, 15° on 30°", "travel off the rigid block's, over the travel and three elastic shortenings",
        "penalty / E'", penalties, "dt, s", steps, 5e-2, partial(scenes.incline, 15.0, most, order=ORDER),
    )  # fmt: skip
    yield Map(
        f"order {ORDER}: contrast in a column", load, "stiffness", ratios, "density", ratios, 1e-6,
        partial(scenes.column, order=ORDER),
    )  # fmt: skip
    yield Map(
        f"order {ORDER}: slivers in a column", load, "aspect", some(1, 10, 100, 1000, 1e4), "0 plate, 1 wedge", (0, 1), 1e-4,
        partial(scenes.sliver, order=ORDER),
    )  # fmt: skip
    orders = some(2, 3, 5, 6, 8)
    yield Map(
        "nearly incompressible, by order", load, "order", orders, "1/2 - Poisson's ratio", some(1e-2, 1e-4, 1e-6, 1e-9), 1e-6,
        incompressible,
    )  # fmt: skip
    yield Map(
        "frames with re-entrant corners, by order",
        load,
        "order",
        orders,
        "thickness, m",
        some(0.5, 0.1, 0.03, 0.01),
        1e-6,
        frame,
    )
    yield Map(
        "spinning at 50 rad/s, by order", "spin and turn off, energy gained", "order", orders, "dt, s",
        some(5e-4, 1e-3, 2e-3, 5e-3, 1e-2), 2e-3, spinning,
    )  # fmt: skip
