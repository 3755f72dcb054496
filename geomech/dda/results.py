"""What a step takes and gives: the cracks' compliance, the settled contacts, forces in equilibrium, statistics."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..model import OPEN, State
from .energy_balance import StepEnergy
from .loads.load_vectors import AppliedForces


class NotConverged(RuntimeError):
    """No acceptable step was found, however short: the message says why and names the contact concerned."""


@dataclass(frozen=True, eq=False)
class CrackResponse:
    """How cracks soften their blocks: mean crack strain e(σ) = ``offset`` + ``compliance`` σ, current axes.

    ``compliance`` (n_blocks, 3, 3) 1/Pa, symmetric; ``offset`` (n_blocks, 3), engineering shear. Zeros: a whole block.
    """

    compliance: np.ndarray
    offset: np.ndarray

    def __post_init__(self) -> None:
        n = len(self.compliance)
        if np.shape(self.compliance) != (n, 3, 3) or np.shape(self.offset) != (n, 3):
            raise ValueError(
                f"a crack response needs compliance (n_blocks, 3, 3) and offset (n_blocks, 3), "
                f"got {np.shape(self.compliance)} and {np.shape(self.offset)}"
            )


@dataclass(frozen=True, eq=False)
class StepResult:
    """A finished step.

    state          the new State; ``state.contacts`` stand on its geometry
    dt             s, the time it advanced (less than asked if the step was cut)
    contacts       CONTACT rows on the geometry on which the forces acted, with the converged ones
    forces         whatever else acted, on the same geometry
    acceleration   (n_blocks, 6) mean of the unknowns over the step, with what mass-proportional damping adds
    energy         the terms of the step's energy balance
    vertices       (n_vertices, 2) m, that geometry: the middle of the step in dynamics (`dda.kinematics.midpoint_configuration`)
    turn           (n_blocks,) rad, by which blocks have turned there since the step began
    arcs           (n_contacts,) m each, the arc and the swing that the contacts have followed (`contact_set`)
    reserve        (n_contacts,) N, how far each of ``contacts`` is from leaving its state (`contact_states.reserves`)
    overlap        the overlap that brought most energy into the step; None where none did
    statistics     open_close_iterations, dt, step_cuts, kinetic_energy, elastic_energy, contact_energy (J/m),
                   worst_penetration (m), max_displacement_ratio, limit_share (the part of what a step may
                   move that it has used), unbalanced (largest residual of the equations of
                   motion over the largest force in them), unbalanced_ratio (0 at rest, 1 in free flight: see
                   `out_of_balance`)
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
