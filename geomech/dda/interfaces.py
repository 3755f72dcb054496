"""Protocols of a system of blocks and of an attempted step, for the modules that compute and limit a step.

`geomech.dda.system.BlockSystem` and `geomech.dda.time_step.Attempt` implement them. Arrays are by block (n_blocks,)
unless stated otherwise; units are m, kg, s, Pa.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

if TYPE_CHECKING:
    from ..model import Blocks, DdaSettings, State
    from .contact_detection.contact_finder import ContactFinder
    from .kinematics.newmark import TimeScheme
    from .linear_solver.assembly import Pattern
    from .loads.load_vectors import LoadMap


class AttemptedStep(Protocol):
    """A solved step: ``increment`` (n_blocks, 6) of the unknowns, ``vertices`` (n_vertices, 2) before it, ``largest``
    displacement of a vertex."""

    state: State
    increment: np.ndarray
    vertices: np.ndarray
    moments: np.ndarray
    largest: float

    def path(self, after: np.ndarray) -> tuple[np.ndarray, np.ndarray]: ...


class SteppedSystem(Protocol):
    """Blocks with the data that are kept from step to step: materials, mass, constraints, contact finder, time scheme.

    ``free`` is the row of each block in the equations, −1 if it is fixed; ``moving`` are the numbers of the blocks that
    have a row. ``next`` and ``owner`` are by vertex. ``no_compliance`` (n_blocks, 3, 3) and ``no_offset`` (n_blocks, 3)
    are those of blocks without cracks. ``reach`` m: static steps are
    solved by operator splitting (`open_close.static_splitting`), and blocks that move beyond it are given up; None: they are
    not.
    """

    blocks: Blocks
    settings: DdaSettings
    scheme: TimeScheme
    finder: ContactFinder
    load_map: LoadMap
    density: np.ndarray
    mass: np.ndarray
    stiffness: np.ndarray
    compliance: np.ndarray
    no_compliance: np.ndarray
    no_offset: np.ndarray
    fixed: np.ndarray
    free: np.ndarray
    moving: np.ndarray
    turns: np.ndarray
    rigid: np.ndarray
    constrained: np.ndarray | None
    taken_out: np.ndarray | None
    next: np.ndarray
    vertex_start: np.ndarray
    owner: np.ndarray
    half_diagonal: float
    rounding: float
    warned: set[str]
    allowed_penetration: float
    reach: np.ndarray | None

    @property
    def step_limit(self) -> float: ...

    def pattern_of(self, block: np.ndarray, other: np.ndarray, moments: np.ndarray, linked: Any) -> Pattern: ...
