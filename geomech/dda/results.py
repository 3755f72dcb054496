"""Input and results of a step: compliance of cracks, contacts, forces in equilibrium, statistics."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from ..model import OPEN, State
from .energy_balance import StepEnergy
from .loads.load_vectors import AppliedForces


class NotConverged(RuntimeError):
    """No acceptable step was found at any length; the message gives the reason and the contact concerned."""


class Unsupported(NotConverged):
    """Blocks that nothing supports move too far in a static step: their ``motion`` (n_blocks, 3), displacement and
    rotation, to a scale, and the ``unbalanced`` (n_blocks, 3) forces and moments on them."""

    def __init__(self, reason: str, motion: np.ndarray, unbalanced: np.ndarray) -> None:
        super().__init__(reason)
        self.motion, self.unbalanced = motion, unbalanced


class CrackedOutline(Protocol):
    """Displacement of the outline of a cracked block of higher order that its polynomials do not represent."""

    def at(self, points: np.ndarray) -> np.ndarray:
        """(n, 2, 4 + m) at undeformed ``points`` (n, 2) of the outline, m per Pa of its generalised stress
        (`higher_order.crack_softening`), and m without stress; in the block's axes."""


@dataclass(frozen=True, eq=False)
class CrackResponse:
    """Response of cracks in blocks: mean crack strain e(σ) = ``offset`` + ``compliance`` σ, current axes.

    ``compliance`` (n_blocks, w, w) 1/Pa, symmetric; ``offset`` (n_blocks, w), engineering shear; w = 3, or more where
    cracked blocks are of higher order: their deflection follows, in their own frames (`higher_order.crack_softening`).
    Zero for an intact block. ``outlines``: of cells, block → what displaces its faces besides.
    """

    compliance: np.ndarray
    offset: np.ndarray
    outlines: dict[int, CrackedOutline] = field(default_factory=dict)

    def __post_init__(self) -> None:
        n, w = len(self.compliance), max(3, np.shape(self.compliance)[-1])
        if np.shape(self.compliance) != (n, w, w) or np.shape(self.offset) != (n, w):
            raise ValueError(
                f"a crack response needs compliance (n_blocks, w, w) and offset (n_blocks, w) with w ≥ 3, "
                f"got {np.shape(self.compliance)} and {np.shape(self.offset)}"
            )

    @classmethod
    def none(cls, n_blocks: int, width: int = 3) -> CrackResponse:
        """That of whole blocks."""
        return cls(np.zeros((n_blocks, width, width)), np.zeros((n_blocks, width)))

    def of_mean_strain(self) -> CrackResponse:
        """Without deflection."""
        return CrackResponse(self.compliance[:, :3, :3].copy(), self.offset[:, :3].copy())

    def copy(self) -> CrackResponse:
        return CrackResponse(self.compliance.copy(), self.offset.copy(), dict(self.outlines))


@dataclass(frozen=True, eq=False)
class StepResult:
    """A finished step.

    state          the new State; ``state.contacts`` refer to its geometry
    dt             s, the time advanced (less than requested if the step was cut)
    contacts       CONTACT rows on the geometry on which the forces acted, with the converged forces
    forces         all other forces, on the same geometry
    acceleration   (n_blocks, 6) mean over the step, including the contribution of mass-proportional damping
    energy         the terms of the step's energy balance
    vertices       (n_vertices, 2) m, that geometry: in dynamics the midpoint configuration
    turn           (n_blocks,) rad, rotation of the blocks there since the start of the step
    arcs           (n_contacts,) m each, the arc and the swing of the contacts (`contact_set`)
    reserve        (n_contacts,) N, distance of each of ``contacts`` from a change of state (`coulomb_return.reserves`)
    overlap        the overlap that created most energy in the step; None without overlap
    statistics     open_close_iterations, dt, step_cuts, kinetic_energy, elastic_energy, contact_energy (J/m),
                   worst_penetration (m), max_displacement_ratio, limit_share (largest ratio of motion to its limit),
                   unbalanced (largest residual of the equations of motion over the largest force in them),
                   unbalanced_ratio (0 at rest, 1 in free flight: see `out_of_balance`)
    """

    state: State
    dt: float
    contacts: np.ndarray
    forces: AppliedForces
    acceleration: np.ndarray
    energy: StepEnergy
    reserve: np.ndarray
    vertices: np.ndarray
    turn: np.ndarray
    arcs: tuple[np.ndarray, np.ndarray]
    statistics: dict[str, float] = field(default_factory=dict)
    overlap: tuple[float, int, int, float, float, float] | None = None


def contact_resultants(contacts: np.ndarray, n_blocks: int, about: np.ndarray) -> np.ndarray:
    """(n_blocks, 3) force x, y and moment about ``about`` (n_blocks, 2) of all contacts on each block, N and N m."""
    rows = contacts[contacts["state"] != OPEN]
    n = rows["normal"]
    along = np.stack([-n[:, 1], n[:, 0]], axis=1)
    force = rows["normal_force"][:, None] * n + rows["shear_force"][:, None] * along
    out = np.zeros((n_blocks, 3))
    for block, sign in ((rows["block"], 1.0), (rows["other"], -1.0)):
        arm = rows["point"] - about[block]
        moment = arm[:, 0] * force[:, 1] - arm[:, 1] * force[:, 0]
        np.add.at(out, block, sign * np.column_stack([force, moment]))
    return out
