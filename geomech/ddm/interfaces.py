"""Protocols of a body with cracks and of its solution, for loads, face contact, error estimates and weight functions.

`geomech.ddm.body.Body` and `geomech.ddm.solution.Solution` satisfy them. Modules that these two call use the protocols,
so that imports run in one direction only.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..model import Cracks, DdmSettings, JointLaw, Material
    from .counters import Work
    from .crack_contact.face_equations import FaceEquations
    from .crack_contact.face_laws import FaceLaws, FaceMemory, FaceStates
    from .loads.body_loads import BodyLoad
    from .loads.supports import Support
    from .mesh.elements import Mesh
    from .mesh.half_plane import HalfPlane
    from .system.boundary_system import BoundarySystem
    from .system.influence_matrix import ElementSet


class LoadParts(Protocol):
    """A load on a given body, split into fields and tractions on edges."""

    load: BodyLoad
    particular: Any
    segments: np.ndarray
    tractions: np.ndarray


class CrackedBody(Protocol):
    """A body with cracks: geometry, elements, matrices. Lengths in m, moduli in Pa."""

    loops: list[np.ndarray]
    cracks: Cracks
    material: Material
    settings: DdmSettings
    supports: Sequence[Support]
    support_segments: np.ndarray
    face_laws: Sequence[JointLaw]
    half_plane: HalfPlane | None
    outlined: bool
    rough: bool
    compressed: bool
    area: float
    centroid: np.ndarray
    hole_moments: list[Any]
    mesh: Mesh
    boundary: ElementSet
    faces: ElementSet
    crack_system: Any
    uniform_responses: dict[bytes, Any]
    work: Work
    initial_memory: FaceMemory
    laws: FaceLaws
    face_equations: FaceEquations
    tip_elements: tuple[np.ndarray, ...]
    closing: tuple[np.ndarray, np.ndarray, np.ndarray]
    strain_weights: np.ndarray
    _outside: BoundarySystem
    _cg: Any
    _c_known: np.ndarray
    _w: np.ndarray
    _extent: float
    _reach: float
    _second: np.ndarray
    _tol: float

    @property
    def nu(self) -> float: ...

    @property
    def limits(self) -> list[np.ndarray]: ...

    @property
    def sides(self) -> np.ndarray: ...

    @property
    def refined(self) -> CrackedBody: ...

    @property
    def with_rounded_walls(self) -> CrackedBody | None: ...

    def remeshed(self, settings: DdmSettings) -> CrackedBody: ...

    def decompose(self, load: BodyLoad) -> tuple[Any, list[Any], np.ndarray, np.ndarray]: ...

    def solve(
        self,
        load: BodyLoad,
        warm: Any = None,
        equilibrium_tolerance: float = 1e-6,
        history: Any = None,
        meet_target: bool = True,
    ) -> SolvedBody: ...


class SolvedBody(Protocol):
    """A body under a load, with the state of its cracks."""

    jumps: np.ndarray
    body: CrackedBody
    load: BodyLoad
    closed: np.ndarray
    memory: FaceMemory | None
    began: FaceMemory | None
    face_load: np.ndarray
    tip_errors: np.ndarray

    @property
    def tips(self) -> np.ndarray: ...

    @property
    def face_states(self) -> FaceStates: ...
