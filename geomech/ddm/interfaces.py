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
    support_segments: np.ndarray
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
    on_bases: dict[bytes, tuple[np.ndarray, ...]]
    work: Work
    _outside: BoundarySystem
    _c_known: np.ndarray
    _extent: float
    _loads: Any
    _reach: float
    _second: np.ndarray
    _tol: float

    @property
    def nu(self) -> float: ...

    @property
    def supports(self) -> Sequence[Support]: ...

    @property
    def face_laws(self) -> Sequence[JointLaw]: ...

    @property
    def uniform_responses(self) -> dict[bytes, Any]: ...

    def condensed_contact(self, closed: np.ndarray | None = None) -> Any: ...

    @property
    def initial_memory(self) -> FaceMemory: ...

    @property
    def laws(self) -> FaceLaws: ...

    @property
    def face_equations(self) -> FaceEquations: ...

    @property
    def tip_elements(self) -> tuple[np.ndarray, ...]: ...

    @property
    def opens(self) -> bool: ...

    @property
    def closing(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]: ...

    @property
    def strain_weights(self) -> np.ndarray: ...

    @property
    def limits(self) -> list[np.ndarray]: ...

    @property
    def sides(self) -> np.ndarray: ...

    @property
    def refined(self) -> CrackedBody: ...

    @property
    def with_rounded_walls(self) -> CrackedBody | None: ...

    def remeshed(self, settings: DdmSettings) -> CrackedBody: ...

    def boundary_unknowns(self, load: np.ndarray, jumps: np.ndarray) -> np.ndarray: ...

    def reduced_transposed(self, on_faces: np.ndarray) -> np.ndarray: ...

    def tractions(self, unknowns: np.ndarray, jumps: np.ndarray) -> tuple[np.ndarray, np.ndarray]: ...

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
