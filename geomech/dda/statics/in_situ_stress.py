"""Equilibrium of blocks under in-situ stress: stress and contact forces that are consistent before the run starts.

A first-order block carries the mean of a linear stress field, its value at the centroid. Contacts start with the tractions
of the field on their faces, linear along each, as forces at its ends,

    F₀ = ℓ (2 t₀ + t₁)/6,  F₁ = ℓ (t₀ + 2 t₁)/6,  t = −σ·n,

which have the same resultant and moment: where the field balances the weight, so do these forces. Springs are closed by
these as far as the drawing goes (`inherited_contacts`). Then the blocks relax: at free faces, and where joints open or slide
because the field exceeds their strength. (If contacts started without force, joints would slide that bear the stress, while
their normal forces are small, and rounding would decide which.) The positions reached become the reference configuration,
from which displacements count.

With blocks of higher order, contacts start without force: they close by the penalty penetration, and the blocks lose the
corresponding stress. The lost stress is added again and the blocks relax again, by a smaller amount, and so on.

A block of higher order also bears what the field has beyond its mean, as an initial stress: its deflection is counted
from one at which it bears the mean alone (`State.deflection_origin`).
"""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace

import numpy as np

from ...conventions import normal_of, traction
from ...model import SLIP, Blocks, InSituStress, Loads, State
from ..contact_detection.inherited_contacts import InheritedContacts
from ..higher_order.deflected_blocks import DeflectedBlocks
from ..joint_laws.bonds import on_lines
from ..kinematics.tolerances import LITTLE
from ..system import BlockSystem
from .pseudo_time_equilibrium import Equilibrium, equilibrium

log = logging.getLogger(__name__)

#: Largest number of corrections of the stress of blocks of higher order. Each reduces the error by the ratio of contact to
#: total compliance, a fortieth or less with penalty springs.
_PASSES = 12
#: Largest number of joints named in it.
_NAMED = 3


class NoInSituEquilibrium(RuntimeError):
    """The blocks do not come to rest under their stress and loads. The message names the blocks that move; ``found``:
    where the search ended."""

    def __init__(self, message: str, found: Equilibrium | None = None) -> None:
        super().__init__(message)
        self.found = found


@dataclass(frozen=True, eq=False)
class InSituState:
    """Blocks at rest under in-situ stress.

    blocks      with the positions at rest as their reference
    state       at time 0, without velocity and displacement, with stress and contact forces
    settled     m, the largest displacement from the blocks as drawn
    deviation   largest difference between a free block's stress (of higher order: also at its corners) and the in-situ
                stress, relative to the largest in-situ stress: the part that is inconsistent with supports and weights
    """

    blocks: Blocks
    state: State
    settled: float
    deviation: float


def in_situ_state(
    system: BlockSystem, stress: InSituStress, loads: Loads, *, tolerance: float = 1e-9, stress_tolerance: float = 1e-8
) -> InSituState:
    """The blocks of ``system`` at rest under ``stress`` and the ``loads`` of time 0 (gravity, tractions, water …).

    ``tolerance`` of the unbalanced force as in `equilibrium`; the stress of blocks of higher order is corrected until its
    relative change is below ``stress_tolerance``. If ``stress`` is inconsistent with weight and supports, the blocks end
    with a consistent stress, and ``deviation`` gives the difference; consistent components (such as horizontal stress
    between walls) are kept. Raises `NoInSituEquilibrium` when the blocks do not come to rest, and ValueError for blocks whose order is
    found during the run.
    """
    blocks = system.blocks
    if system.order_choice is not None:
        raise ValueError('in-situ stress is not supported in blocks of order "auto" yet: give the order as a number')
    bent = None if system.deflected is None else _Bent(system.deflected, stress)
    centres = np.array([blocks.area_moments(b)[1] for b in range(blocks.n_blocks)])
    given = stress.at(centres)
    given[blocks.fixed] = 0.0
    size = float(np.abs(given).max(initial=0.0))
    if bent is not None:
        size = max(size, float(np.abs(bent.given).max(initial=0.0)))
    state = replace(State.at_rest(blocks), stress=given.copy())
    if bent is None:
        state = _at_rest(system, _pressed(system, state, stress, loads), loads, tolerance)
    else:
        state = bent.at_rest(system, state, loads, tolerance, stress_tolerance * max(size, 1e-300))
    moved = float(np.hypot(*(state.vertices - blocks.vertices).T).max())
    off = float(np.abs(state.stress - given)[~blocks.fixed].max(initial=0.0))
    if bent is not None:
        off = max(off, float(np.abs(bent.beyond_mean(state) - bent.given).max(initial=0.0)))
    off = off / size if size else 0.0
    log.info("in-situ stress: the blocks settle by %.3g m; the stress differs by %.2g of the largest", moved, off)
    _warn_of_sliding(system, state, off)
    rest = replace(state, time=0.0, rotation=np.zeros(blocks.n_blocks), imposed=np.empty(0))
    settled = blocks.with_vertices(state.vertices)
    if bent is not None:
        rest = bent.on(settled, rest)
    return InSituState(settled, rest, moved, off)


def _at_rest(system: BlockSystem, state: State, loads: Loads, tolerance: float) -> State:
    """Equilibrium from ``state``. Raises `NoInSituEquilibrium`."""
    found: Equilibrium = equilibrium(system, state, loads, tolerance=tolerance)
    if not found.converged:
        raise NoInSituEquilibrium(f"the blocks do not come to rest under the in-situ stress: {found.reason}", found)
    return found.state


def _pressed(system: BlockSystem, state: State, stress: InSituStress, loads: Loads) -> State:
    """``state`` of blocks as drawn, with contacts that carry the tractions of ``stress`` on their faces, less the pressure of
    water in them."""
    found = system.contacts_near(state)
    which = np.flatnonzero(found.geometry[:, 4] > 0)
    if not len(which):
        return state
    which, start, _ = on_lines(found.block, found.other, found.geometry, which)
    geometry, size = found.geometry[which], np.diff(start)
    normal, length, point = geometry[:, 1:3], geometry[:, 4], geometry[:, 5:7]
    # The force at an end is half the length times the traction at a third of the face from it: (2 t₀ + t₁)/3.
    first, last = np.repeat(start[:-1], size), np.repeat(start[1:] - 1, size)
    far = np.where(np.arange(len(which)) == first, last, first)
    share = np.where(np.repeat(size == 2, size), 1.0 / 3.0, 0.0)
    at = point + share[:, None] * (point[far] - point)
    force = -length[:, None] * traction(stress.at(at), normal)
    pushes, shear = (np.einsum("na,na->n", force, axis) for axis in (normal, normal_of(normal)))
    if loads.water is not None:
        names = np.array(system.blocks.edge_names, dtype=object)[system.blocks.edge_name[found.edge[which]]]
        pushes -= np.where(np.isin(names, loads.water.dry), 0.0, length * loads.water.pressure_at(at, state.time))
    bonded = found.bonded[which] > 0
    most = np.where(bonded, np.inf, found.springs.peak[which] * np.maximum(pushes, 0.0) + found.springs.hold[which])
    forces = InheritedContacts(
        which, np.where(bonded, pushes, np.maximum(pushes, 0.0)), np.clip(shear, -most, most), found.gap[which],
        np.zeros(len(which)),
    )  # fmt: skip
    return system.with_inherited_contacts(state, found, forces)


def _warn_of_sliding(system: BlockSystem, state: State, off: float) -> None:
    """Warn if joints had to slide before they bear the stress of ``state``, which differs by ``off`` of the largest from
    that given."""
    rows = state.contacts[state.contacts["state"] == SLIP]
    lost = np.abs(rows["shear_force"] * rows["slip"])
    area = np.where(system.fixed, 0.0, system.blocks.areas(state.vertices))
    stored = 0.5 * float(np.einsum("b,bi,bij,bj->", area, state.stress, system.compliance, state.stress))
    # Blocks that bear the given stress have slid as contacts closed, which leaves no trace in it.
    if not (off > LITTLE and lost.sum() > LITTLE * stored):
        return
    names, by_joint = system.blocks.names, dict[tuple[int, int], float]()
    for pair, energy in zip(np.sort(np.stack([rows["block"], rows["other"]], axis=1), axis=1).tolist(), lost.tolist()):
        by_joint[pair[0], pair[1]] = by_joint.get((pair[0], pair[1]), 0.0) + energy
    worst = sorted(by_joint, key=by_joint.__getitem__, reverse=True)[:_NAMED]
    log.warning(
        "in-situ stress: %.3g m of %.3g m of joints slide by up to %.2g m before they bear it (most: %s), as it exceeds their "
        "strength or finds no support at free faces. They dissipate %.2g of the elastic energy stored, and the stress "
        "differs by up to %.2g of the largest from that given. Which joints slide first is not determined: "
        "energies are uncertain by about that share, and displacements of the first steps by up to that slip. Give a stress that the joints bear "
        "(loads.in_situ), or a higher strength",
        float(rows["length"].sum()), float(state.contacts["length"].sum()), float(np.abs(rows["slip"]).max()),
        ", ".join(f"{names[a]} on {names[b]}" for a, b in worst), float(lost.sum()) / max(stored, 1e-300), off,
    )  # fmt: skip


class _Bent:
    """Blocks of higher order under the part of the in-situ ``stress`` beyond the mean of each; ``given`` (n, 3) Pa: that
    part at their corners."""

    def __init__(self, deflected: DeflectedBlocks, stress: InSituStress) -> None:
        self._blocks, self._under = deflected, deflected.under(stress)
        self.given = deflected.stress_of(self._under)

    def stressed(self, state: State) -> State:
        """``state`` with this part of the stress in blocks that do not deflect any further by it."""
        known = self._blocks.at_rest() if state.deflection is None else state.deflection
        origin = np.stack([known[:, 0] - self._under, np.zeros(len(known))], axis=1)
        return replace(state, rotation=np.zeros_like(state.rotation), deflection=known, deflection_origin=origin)

    def at_rest(self, system: BlockSystem, state: State, loads: Loads, tolerance: float, change: float) -> State:
        """Equilibrium under the stress of ``state``, which is corrected until it changes by less than ``change``, Pa."""
        given, before = state.stress, None
        for _ in range(_PASSES):
            state = _at_rest(system, self.stressed(replace(state, stress=given.copy())), loads, tolerance)
            reached = np.concatenate([state.stress, self.beyond_mean(state)])
            if before is not None and np.abs(reached - before).max() <= change:
                break
            before = reached
        return state

    def beyond_mean(self, state: State) -> np.ndarray:
        """(n, 3) Pa at the corners, beyond the mean stress of each block."""
        return self._blocks.stress_of(self._deflections(state)[1])

    def _deflections(self, state: State) -> tuple[np.ndarray, np.ndarray]:
        """(k,) m twice: deflections, and those beyond that without stress."""
        known = self._blocks.at_rest() if state.deflection is None else state.deflection
        return known[:, 0], known[:, 0] - self._blocks.origin(state)[:, 0]

    def on(self, settled: Blocks, state: State) -> State:
        """``state`` with deflections on the basis of the ``settled`` blocks, whose displacements count from there."""
        now, stressed = (self._blocks.on_basis_of(settled, each) for each in self._deflections(state))
        rest = np.stack([now, np.zeros(len(now))], axis=1)
        return replace(state, deflection=rest, deflection_origin=np.stack([now - stressed, now], axis=1))
