"""Impacts of blocks whose joint law names a coefficient of restitution e: v′ = −e v across the contact.

An implicit step applies contact forces over its whole length. If blocks collide within the step, the speed that remains
depends on the time of the collision in the step: in Shi's scheme it is anything from zero to all of it. With a
coefficient of restitution the impact is an impulse at the time of the collision:

1. The step is solved as if colliding blocks did not touch. Their gap closes at the root t* of the cubic that has its
   values and rates at both ends of the step.
2. In the geometry at t*, impulses (`ImpulseProblem`) change the normal relative velocity by −(1 + e) u(t*), with Coulomb
   friction along the contact. Closed contacts transmit them, and prevent blocks from approaching because of them.
3. Blocks move with the change of velocity for the rest of the step, dt − t*: no time is lost, and the forces of the
   step do their work along the path without impact, the impulses do theirs.
4. Contacts that have closed again by the end of the step, or that others have made to collide, end it touching and at
   rest.

So neither the rebound nor its time depends on the step length. Energy never increases: e is reduced for the step where
Newton's law would create energy in eccentric impacts with friction (Kane & Levinson 1985). Contacts that close more
slowly than the speed gained by gravity in one step are excluded: there blocks come to rest as without restitution.
Impacts do not strain blocks, since Newton's law contains speeds only.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ...model import OPEN, SLIP
from ..open_close.contact_set import ContactSet
from ..open_close.equations import Settled
from .impulses import ImpulseProblem

#: n: the time of an impact is found to 2⁻ⁿ of the step.
_HALVINGS = 45


@dataclass(frozen=True, eq=False)
class RigidBlocks:
    """Blocks as rigid bodies at the end of a step without impacts: ``centroid`` (n_blocks, 2) m, ``inverse``
    (n_blocks, 3) of mass, mass and moment of inertia, 0 if constrained, and the ``velocity`` (n_blocks, 3), which was
    ``begun`` at its start; ``turn`` (n_blocks,) rad in the step; all contacts' ``normal`` and ``point`` (n, 2)."""

    centroid: np.ndarray
    inverse: np.ndarray
    velocity: np.ndarray
    begun: np.ndarray
    turn: np.ndarray
    normal: np.ndarray
    point: np.ndarray

    def energy(self, velocity: np.ndarray) -> float:
        """J/m of the rigid motion ``velocity`` (n_blocks, 3)."""
        moves = self.inverse > 0.0
        return 0.5 * float((velocity[moves] ** 2 / self.inverse[moves]).sum())


class Rebound(NamedTuple):
    """Result of impacts: rigid ``velocity`` (n_blocks, 3) after them, additional displacement (``moved``, (n_blocks, 3)
    m and rad), and the energies (J/m) dissipated by restitution (``lost``) and friction (``frictional``)."""

    velocity: np.ndarray
    moved: np.ndarray
    lost: float
    frictional: float


@dataclass(frozen=True, eq=False)
class Striking:
    """Contacts of a step whose blocks collide with a coefficient of restitution.

    which        (n,) bool   of all contacts of the step
    restitution  (n,)        e of each; nan if the law has none
    speed        (n, 2)      m/s, normal and tangential relative velocity of the rigid blocks at the start of the step
    """

    which: np.ndarray
    restitution: np.ndarray
    speed: np.ndarray

    @classmethod
    def of(cls, found: ContactSet, restitution: np.ndarray, speed: np.ndarray, slowest: float) -> Striking | None:
        """None if no open contact with a ``restitution`` (n,) closes faster than ``slowest`` m/s, given its ``speed``
        (n, 2) m/s."""
        which = ~np.isnan(restitution) & (found.state == OPEN) & (found.bonded == 0) & (speed[:, 0] < -slowest)
        return cls(which, restitution, speed) if which.any() else None

    def apart(self, gap: np.ndarray, far: float) -> np.ndarray:
        """The starting ``gap`` (n,) m increased by ``far`` m at these contacts, so that they stay open in the step."""
        return np.where(self.which, gap + far, gap)

    def back(self, settled: Settled, far: float) -> Settled:
        """``settled`` with the true gaps, ``far`` m less."""
        return replace(settled, gap=np.where(self.which, settled.gap - far, settled.gap))

    def closed(self, gap: np.ndarray) -> np.ndarray:
        """(n,) bool: these contacts that are closed at the end of the step, with ``gap`` (n,) m."""
        return self.which & (gap < 0.0)

    def rebound(
        self, found: ContactSet, settled: Settled, struck: np.ndarray, gap: np.ndarray, blocks: RigidBlocks, dt: float
    ) -> Rebound:
        """Result of the impacts of the contacts ``struck`` (n,), whose ``gap`` (n,) m at the end of a step of ``dt`` is
        negative."""
        rows, problem = _of_closed(found, settled, struck, blocks)
        hit, bouncing = struck[rows], np.nan_to_num(self.restitution[rows])
        rates = self.speed[rows, 0], problem.speeds(blocks.velocity)[:, 0]
        part = np.where(hit, touching_time(found.gap_before[rows], gap[rows], *rates, dt) / dt, 1.0)
        problem = _turned_back(problem, blocks, 1.0 - part)
        ended = problem.speeds(blocks.velocity)
        there = problem.relative(
            *(
                blocks.begun[b] + part[:, None] * (blocks.velocity - blocks.begun)[b]
                for b in (problem.block, problem.other)
            )
        )
        there[:, 0] = np.minimum(there[:, 0], 0.0)
        # Sticking and closed contacts keep their velocity; sliding ones may be stopped.
        along = np.where(hit, ended[:, 1] - there[:, 1], np.where(settled.state[rows] == SLIP, 0.0, ended[:, 1]))
        plastic = ended[:, 0] - np.where(hit, there[:, 0], 0.0)
        problem = problem._replace(along=along)
        impulse, after = problem._replace(across=plastic - np.where(hit, bouncing * there[:, 0], 0.0)).impulses()
        if bouncing[hit].any():
            at_rest, least = problem._replace(across=plastic).impulses()
            share = _without_gain(at_rest, impulse, np.where(hit[:, None], there, ended), problem, least, after)
            impulse, after = at_rest + share * (impulse - at_rest), least + share * (after - least)
        change = problem.speeds(after - blocks.velocity)
        lost, frictional = _works(impulse, np.where(hit[:, None], there, ended), change)
        # If friction does positive work on tips that the impact turns back, restitution dissipates it.
        lost, frictional = lost + min(frictional, 0.0), max(frictional, 0.0)
        moved = problem._replace(
            across=np.zeros(len(rows)), along=np.zeros(len(rows)), velocity=problem.made_by(
                impulse * np.where(hit, dt * (1.0 - part), 0.0)[:, None]
            ),
        ).passed_on(~hit)  # fmt: skip
        return Rebound(after, moved, lost, frictional)

    def landed(
        self, found: ContactSet, settled: Settled, struck: np.ndarray, gap: np.ndarray, blocks: RigidBlocks,
    ) -> Rebound:  # fmt: skip
        """Result for contacts ``struck`` (n,) that are still closed, ``gap`` (n,) m < 0: they end the step touching and
        do not approach further."""
        rows, problem = _of_closed(found, settled, struck, blocks)
        ended, nothing = problem.speeds(blocks.velocity), np.zeros(len(rows))
        problem = problem._replace(along=nothing, friction=nothing)
        across = np.where(struck[rows], 0.0, np.minimum(ended[:, 0], 0.0))
        impulse, after = problem._replace(across=across).impulses()
        change = problem.speeds(after - blocks.velocity)
        moved = problem._replace(
            across=np.where(struck[rows], -gap[rows], 0.0), velocity=np.zeros_like(blocks.velocity)
        ).impulses()[1]  # fmt: skip
        return Rebound(after, moved, sum(_works(impulse, ended, change)), 0.0)


def _of_closed(
    found: ContactSet, settled: Settled, struck: np.ndarray, blocks: RigidBlocks
) -> tuple[np.ndarray, ImpulseProblem]:
    """The contacts that are closed or ``struck`` (n,), and their impulse problem without required velocities."""
    rows = np.flatnonzero((settled.state != OPEN) | struck)
    friction = np.where(struck, found.springs.friction, settled.springs.friction)[rows]
    nothing, both = np.zeros(len(rows)), (found.block[rows], found.other[rows])
    arms = np.stack([blocks.point[rows] - blocks.centroid[b] for b in both], axis=1)
    return rows, ImpulseProblem(
        *both, blocks.normal[rows], arms, blocks.inverse, blocks.velocity, nothing, nothing, friction,
        (settled.bonded[rows] > 0) & ~struck[rows],
    )  # fmt: skip


def _turned_back(problem: ImpulseProblem, blocks: RigidBlocks, part: np.ndarray) -> ImpulseProblem:
    """The ``problem`` in the geometry before the fraction ``part`` (n,) of the rotations in the step."""

    def back(vectors: np.ndarray, owner: np.ndarray) -> np.ndarray:
        angle = part * blocks.turn[owner]
        c, s = np.cos(angle), np.sin(angle)
        return np.stack([c * vectors[:, 0] + s * vectors[:, 1], c * vectors[:, 1] - s * vectors[:, 0]], axis=1)

    arms = np.stack([back(problem.arms[:, 0], problem.block), back(problem.arms[:, 1], problem.other)], axis=1)
    return problem._replace(normal=back(problem.normal, problem.other), arms=arms)


def _works(impulse: np.ndarray, before: np.ndarray, change: np.ndarray) -> tuple[float, float]:
    """J/m dissipated by normal and by tangential ``impulse`` (n, 2), with relative velocities ``before`` (n, 2) and
    their ``change`` (n, 2): −p (u + u′)/2 (Thomson & Tait 1867, § 308)."""
    across, along = (-impulse * (before + 0.5 * change)).sum(axis=0).tolist()
    return across, along


def touching_time(gap: np.ndarray, left: np.ndarray, begun: np.ndarray, ended: np.ndarray, dt: float) -> np.ndarray:
    """(n,) s: time at which a ``gap`` (n,) m closes that is ``left`` m < 0 after ``dt``, with the rates ``begun`` and
    ``ended`` m/s: root of the cubic with these values, by bisection."""
    low, high = np.zeros(len(gap)), np.ones(len(gap))
    for _ in range(_HALVINGS):
        x = 0.5 * (low + high)
        y = 1.0 - x
        value = y * y * (gap * (1.0 + 2.0 * x) + dt * begun * x) + x * x * (left * (1.0 + 2.0 * y) - dt * ended * y)
        low, high = np.where(value > 0.0, x, low), np.where(value > 0.0, high, x)
    return np.where(gap > 0.0, 0.5 * (low + high) * dt, 0.0)


def _without_gain(
    plastic: np.ndarray,
    bounced: np.ndarray,
    before: np.ndarray,
    problem: ImpulseProblem,
    least: np.ndarray,
    most: np.ndarray,
) -> float:
    """The largest s in [0, 1] for which impulses ``plastic`` + s (``bounced`` − ``plastic``) (n, 2) create no energy. The two
    give the velocities ``least`` and ``most`` (n_blocks, 3); relative velocities ``before`` (n, 2)."""
    start = problem.speeds(least - problem.velocity)
    way = problem.speeds(most - least)
    more = bounced - plastic
    # Work of plastic + s more on before + ½ (start + s way), quadratic in s.
    zeroth = float((plastic * (before + 0.5 * start)).sum())
    first = float((more * (before + 0.5 * start)).sum() + 0.5 * (plastic * way).sum())
    second = 0.5 * float((more * way).sum())
    if zeroth + first + second <= 0.0 or second <= 0.0:
        return 1.0
    root = first * first - 4.0 * second * min(zeroth, 0.0)
    return float(np.clip((-first + np.sqrt(root)) / (2.0 * second), 0.0, 1.0))
