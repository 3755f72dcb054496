"""Impacts of blocks whose joint law names a coefficient of restitution e: v′ = −e v across the contact.

An implicit step holds blocks apart by forces over all of its length. Where one begins to touch within it, how much of
its speed is left depends on the part of the step in which it does: Shi's scheme leaves between nothing and all of it.
With a coefficient of restitution the impact is an impulse at its moment instead:

1. The step is solved as if blocks that come together at a speed did not touch. Their gap closes at the time t* where
   the cubic of its values and rates at both ends does.
2. On the geometry of t*, impulses (`ImpulseProblem`) change the velocity across it by −(1 + e) u(t*), with Coulomb's
   friction along it. Contacts that are closed pass them on, and do not let blocks come nearer for them.
3. Blocks move on with the change of velocity for the rest of the step, dt − t*: no time is lost, and the forces of the
   step have done their work on the way without the impact, which does its own.
4. What has come back by the end of the step, or is met by what others have made of it, ends it touching and at rest.

So neither the rebound nor its time depends on the step. Energy is never gained: e is lowered for this step where
friction and an eccentric impact would (Newton's law allows it, Kane & Levinson 1985). A closing that is slower than
what gravity makes in a step is none of this: there blocks come to rest as without restitution. No impact strains its
blocks: Newton's law knows of speeds alone.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ...model import OPEN, SLIP
from ..open_close.contact_set import ContactSet
from ..open_close.equations import Settled
from .impulses import ImpulseProblem

#: The time of an impact is known to 2⁻ⁿ of the step.
_HALVINGS = 45


@dataclass(frozen=True, eq=False)
class RigidBlocks:
    """Blocks as rigid bodies at the end of a step without impacts: ``centroid`` (n_blocks, 2) m, ``inverse``
    (n_blocks, 3) of mass, mass and moment of inertia, 0 for what is held, and the ``velocity`` (n_blocks, 3), which was
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
    """What impacts have done: rigid ``velocity`` (n_blocks, 3) after them, by what blocks have ``moved`` (n_blocks, 3)
    m and
    rad beside the step's displacement, and the energies (J/m) that restitution (``lost``) and friction (``rubbed``)
    have
    taken."""

    velocity: np.ndarray
    moved: np.ndarray
    lost: float
    rubbed: float


@dataclass(frozen=True, eq=False)
class Striking:
    """Contacts of a step whose blocks come together with a coefficient of restitution.

    which        (n,) bool   of all contacts of the step
    restitution  (n,)        e of each; nan where the law names none
    speed        (n, 2)      m/s, the rigid blocks' relative velocity across the contact and along it as the step begins
    """

    which: np.ndarray
    restitution: np.ndarray
    speed: np.ndarray

    @classmethod
    def of(cls, found: ContactSet, restitution: np.ndarray, speed: np.ndarray, slowest: float) -> Striking | None:
        """None where no open contact with a ``restitution`` (n,) closes faster than ``slowest`` m/s by its ``speed``
        (n, 2) m/s."""
        which = ~np.isnan(restitution) & (found.state == OPEN) & (found.bonded == 0) & (speed[:, 0] < -slowest)
        return cls(which, restitution, speed) if which.any() else None

    def apart(self, gap: np.ndarray, far: float) -> np.ndarray:
        """The starting ``gap`` (n,) m with which these contacts stay open in the step, ``far`` m more than it is."""
        return np.where(self.which, gap + far, gap)

    def back(self, settled: Settled, far: float) -> Settled:
        """What is ``settled`` with the gaps as they are."""
        return replace(settled, gap=np.where(self.which, settled.gap - far, settled.gap))

    def closed(self, gap: np.ndarray) -> np.ndarray:
        """(n,) bool: those that are closed at the end of the step, where contacts have this ``gap`` (n,) m."""
        return self.which & (gap < 0.0)

    def rebound(
        self, found: ContactSet, settled: Settled, struck: np.ndarray, gap: np.ndarray, blocks: RigidBlocks, dt: float
    ) -> Rebound:
        """What comes of the contacts ``struck`` (n,), whose ``gap`` (n,) m at the end of a step of ``dt`` is below
        0."""
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
        # What sticks or was closed goes on as it did; what slides may be stopped.
        along = np.where(hit, ended[:, 1] - there[:, 1], np.where(settled.state[rows] == SLIP, 0.0, ended[:, 1]))
        dull = ended[:, 0] - np.where(hit, there[:, 0], 0.0)
        problem = problem._replace(along=along)
        impulse, after = problem._replace(across=dull - np.where(hit, bouncing * there[:, 0], 0.0)).impulses()
        if bouncing[hit].any():
            at_rest, least = problem._replace(across=dull).impulses()
            share = _without_gain(at_rest, impulse, np.where(hit[:, None], there, ended), problem, least, after)
            impulse, after = at_rest + share * (impulse - at_rest), least + share * (after - least)
        change = problem.speeds(after - blocks.velocity)
        lost, rubbed = _works(impulse, np.where(hit[:, None], there, ended), change)
        # Friction that pushes tips on whose own blow turns them back gives what restitution takes more.
        lost, rubbed = lost + min(rubbed, 0.0), max(rubbed, 0.0)
        moved = problem._replace(
            across=np.zeros(len(rows)), along=np.zeros(len(rows)), velocity=problem.made_by(
                impulse * np.where(hit, dt * (1.0 - part), 0.0)[:, None]
            ),
        ).passed_on(~hit)  # fmt: skip
        return Rebound(after, moved, lost, rubbed)

    def landed(
        self, found: ContactSet, settled: Settled, struck: np.ndarray, gap: np.ndarray, blocks: RigidBlocks,
    ) -> Rebound:  # fmt: skip
        """What comes of contacts ``struck`` (n,) that are closed by ``gap`` (n,) m < 0 for all that: they end the step
        touching and do not come nearer."""
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
    """The contacts that are closed or ``struck`` (n,), and the problem of their impulses but for what it asks of
    them."""
    rows = np.flatnonzero((settled.state != OPEN) | struck)
    friction = np.where(struck, found.springs.friction, settled.springs.friction)[rows]
    nothing, both = np.zeros(len(rows)), (found.block[rows], found.other[rows])
    arms = np.stack([blocks.point[rows] - blocks.centroid[b] for b in both], axis=1)
    return rows, ImpulseProblem(
        *both, blocks.normal[rows], arms, blocks.inverse, blocks.velocity, nothing, nothing, friction,
        (settled.bonded[rows] > 0) & ~struck[rows],
    )  # fmt: skip


def _turned_back(problem: ImpulseProblem, blocks: RigidBlocks, part: np.ndarray) -> ImpulseProblem:
    """The contacts as they were before this ``part`` (n,) of the step's turns."""

    def back(vectors: np.ndarray, owner: np.ndarray) -> np.ndarray:
        angle = part * blocks.turn[owner]
        c, s = np.cos(angle), np.sin(angle)
        return np.stack([c * vectors[:, 0] + s * vectors[:, 1], c * vectors[:, 1] - s * vectors[:, 0]], axis=1)

    arms = np.stack([back(problem.arms[:, 0], problem.block), back(problem.arms[:, 1], problem.other)], axis=1)
    return problem._replace(normal=back(problem.normal, problem.other), arms=arms)


def _works(impulse: np.ndarray, before: np.ndarray, change: np.ndarray) -> tuple[float, float]:
    """J/m that ``impulse`` (n, 2) across contacts and along them takes, where relative velocities were ``before`` (n,
    2)
    and had this ``change`` (n, 2): −p (u + u′)/2 (Thomson & Tait 1867, § 308)."""
    across, along = (-impulse * (before + 0.5 * change)).sum(axis=0).tolist()
    return across, along


def touching_time(gap: np.ndarray, left: np.ndarray, begun: np.ndarray, ended: np.ndarray, dt: float) -> np.ndarray:
    """(n,) s at which a ``gap`` (n,) m closes that is ``left`` m < 0 after ``dt``, with the rates ``begun`` and
    ``ended``
    m/s: a root of the cubic of these, by halving."""
    low, high = np.zeros(len(gap)), np.ones(len(gap))
    for _ in range(_HALVINGS):
        x = 0.5 * (low + high)
        y = 1.0 - x
        value = y * y * (gap * (1.0 + 2.0 * x) + dt * begun * x) + x * x * (left * (1.0 + 2.0 * y) - dt * ended * y)
        low, high = np.where(value > 0.0, x, low), np.where(value > 0.0, high, x)
    return np.where(gap > 0.0, 0.5 * (low + high) * dt, 0.0)


def _without_gain(
    dull: np.ndarray,
    bounced: np.ndarray,
    before: np.ndarray,
    problem: ImpulseProblem,
    least: np.ndarray,
    most: np.ndarray,
) -> float:
    """The largest part s of the way from impulses ``dull`` to those ``bounced`` (n, 2) that gains no energy; they lead
    to
    velocities ``least`` and ``most`` (n_blocks, 3), where relative ones were ``before`` (n, 2) them."""
    start = problem.speeds(least - problem.velocity)
    way = problem.speeds(most - least)
    more = bounced - dull
    # Work of dull + s more on before + ½ (start + s way), a square in s.
    zeroth = float((dull * (before + 0.5 * start)).sum())
    first = float((more * (before + 0.5 * start)).sum() + 0.5 * (dull * way).sum())
    second = 0.5 * float((more * way).sum())
    if zeroth + first + second <= 0.0 or second <= 0.0:
        return 1.0
    root = first * first - 4.0 * second * min(zeroth, 0.0)
    return float(np.clip((-first + np.sqrt(root)) / (2.0 * second), 0.0, 1.0))
