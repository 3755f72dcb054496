"""An elastic body with cracks: its matrices, computed once for a geometry, and its solution under any load.

By Somigliana's identity the total stress in the rock is the sum of the stresses of the boundary tractions (Kelvin line
forces), of the boundary displacement and the opening and slip of cracks (displacement jumps), and of a particular
field; the plane outside the boundary is then at rest. So the traction on the *outside* of the boundary must vanish,

    A_ΓΓ u + A_ΓC w + g = 0,        A_CΓ u + A_CC w + r = −p n,

with u the boundary displacement and w slip and opening. A_ΓΓ is factored once; all else uses the Schur complement S =
A_CC − A_CΓ A_ΓΓ⁻¹ A_ΓC of the crack unknowns. The matrices depend only on geometry and ν.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ..model import Cracks, DdmSettings, JointLaw, Material
from ..model.blocks.polygon import area_moments
from ..model.former_names import folded_argument, gathered_arguments
from .adaptivity import finer, for_target
from .condensation import Condensed, Operators, influence_on_boundary
from .counters import Work
from .crack_contact.face_contact import settle_faces
from .crack_contact.face_equations import FaceEquations
from .crack_contact.face_laws import SMOOTH, FaceLaws, FaceMemory, all_smooth, check_laws
from .crack_contact.uniform_contact import UniformContact, condenses
from .fracture.chord_error import with_halved_chords
from .fracture.target_error import refined_to_target
from .fracture.tip_elements import tip_elements
from .fracture.weight_functions import TipFunctionals
from .interfaces import CrackedBody
from .iterative.boundary_gmres import IteratedBoundary, is_iterated
from .iterative.crack_gmres import FACTORABLE, IterativeCrackSystem, compressed, is_compressed
from .iterative.gmres import NotSolved
from .loads.body_loads import BodyLoad
from .loads.load_vectors import Applied, apply, check_equilibrium
from .loads.supports import Holds, Support, called, marks, place, values_at
from .loads.uniform_stress_response import Response, is_simple, scales, uniform_stress_response_of
from .loads.unit_load_cache import UnitLoad, UnitLoads, on_elements
from .mesh.edge_location import OFF
from .mesh.elements import Mesh, mesh, outline_edges
from .mesh.geometry_checks import check_cracks, check_outline, new_segments
from .mesh.half_plane import HalfPlane, without_outline
from .mesh.point_location import outlined
from .solution import LoadTractions, Solution
from .system.bordered_factor import SMALLEST_BORDERED, Bordered, WholeMatrix
from .system.boundary_system import BoundarySystem
from .system.displacement_jumps import closing, strain_weights
from .system.influence_matrix import ElementSet, influence, reuse
from .system.schur_complement import WORTHWHILE, CrackSystem

_log = logging.getLogger(__name__)

#: Number of solutions under uniform stress from which the contact of cracks that have grown is condensed, which takes as
#: long as three solutions.
WORTH_CONDENSING = 5


@dataclass(frozen=True, eq=False)
class Reuse:
    """What a body takes over from others.

    previous   an earlier body whose unchanged elements are reused, factors included (`bordered_factor`); growth then
               costs the rows and columns of the new elements
    work       operation counts that it adds to; None: counts of its own
    """

    previous: Body | None = None
    work: Work | None = None


class Body:
    """An elastic body with cracks.

    ``loops``: (n, 2) arrays, the outline counter-clockwise, then holes clockwise; [] for the infinite plane; or a
    `HalfPlane`, the rock below a free surface, where cracks may end. ``holes``: further holes in either direction, also
    in the infinite plane and below a surface. ``cracks``: those of this body. ``reuse``: what it takes over from an
    earlier body: that body, or `Reuse`. ``face_laws``: laws of the crack faces (`face_laws`), selected by the ``law`` of
    each crack segment.
    ``counts``: operations that setting up the body took; ``work``: operations since then of all bodies that share it.
    Raises ValueError, naming the item, if the geometry is not a body, and numpy.linalg.LinAlgError if cracks cut off a
    part.

    >>> rock = Material("rock", 17e9, 0.21, k_ic=2e6)
    >>> crack = Cracks.from_polylines([np.array([[-1.0, 0.0], [1.0, 0.0]])])
    >>> tips = ddm.Body([], crack, rock).solve(ddm.BodyLoad(remote_stress=[0.0, 1e6, 0.0])).tips
    >>> [f"{k:.4f}" for k in tips["k_i"] / (1e6 * np.sqrt(np.pi))]  # a crack in tension: σ √(πa)
    ['1.0000', '1.0000']
    """

    given_loops: list[np.ndarray]
    loops: list[np.ndarray]
    outlined: bool
    compressed: bool
    area: float
    centroid: np.ndarray
    hole_moments: list[Any]
    crack_system: CrackSystem | IterativeCrackSystem
    _second: np.ndarray
    _reach: float
    _factored_after_all: bool
    _outside: BoundarySystem
    condensation: Condensed | Operators
    lean: bool
    in_number: bool

    @folded_argument("half_plane", "loops", without_outline)
    @gathered_arguments("reuse", Reuse)
    def __init__(
        self,
        loops: Sequence[np.ndarray] | HalfPlane,
        cracks: Cracks,
        material: Material,
        settings: DdmSettings | None = None,
        reuse: Reuse | Body | None = None,
        holes: Sequence[np.ndarray] = (),
        supports: Sequence[Support] = (),
        face_laws: Sequence[JointLaw] = SMOOTH,
    ):
        reuse = reuse if isinstance(reuse, Reuse) else Reuse(reuse)
        previous = reuse.previous
        self.half_plane = half_plane = loops if isinstance(loops, HalfPlane) else None
        loops = [] if isinstance(loops, HalfPlane) else list(loops)
        self.material, self.cracks = material, cracks
        #: The settings given; ``settings`` are those of the mesh, which may follow from a target error.
        self.requested = DdmSettings() if settings is None else settings
        self.settings = settings = for_target(self.requested)
        self._finer: Body | None = None
        self._finer_before: Body | None = None
        if previous is not None and previous.requested == self.requested:
            self.settings = settings = previous.settings
            self._finer_before = previous._finer or previous._finer_before
        self.supports, self.face_laws = tuple(supports), tuple(face_laws)
        check_laws(self.face_laws, cracks)
        self.rough = not all_smooth(self.face_laws)
        if previous is not None and (
            previous.settings != settings
            or previous.nu != material.effective_poissons_ratio
            or previous.supports != self.supports
            or previous.half_plane != half_plane
        ):
            previous = None
        self.counts = {"elements": 0, "elements_new": 0, "boundary_assemblies": 0, "boundary_factorisations": 0}
        self.work = Work() if reuse.work is None else reuse.work
        given = [*loops, *holes]
        same = previous if previous is not None and _same_loops(previous.given_loops, given) else None
        if same is None and self.supports:
            previous = None
        self.given_loops = [np.array(loop, dtype=float) for loop in given]
        self.loops = check_outline(loops, holes) if same is None else same.loops
        self.outlined = outlined(self.loops) if same is None else same.outlined
        edges = outline_edges(self.loops)[0] if same is None else same.mesh.edges
        if half_plane is not None:
            edges = self._in_half_plane(half_plane, edges)
        check_cracks(cracks, edges, self.loops, None if same is None else new_segments(cracks, same.cracks))
        points = self._vertices
        self._extent = float(np.ptp(points, axis=0).max()) if len(points) else 1.0
        self._tol = 8e-16 * float(np.abs(points).max()) if len(points) else 0.0
        marked: list[tuple[np.ndarray, int]] = []
        if self.supports:
            if not self.outlined:
                raise ValueError("supports need a body with an outline")
            self.support_segments = place(self.supports, edges, self._extent)
            marked = marks(self.supports, self.support_segments, self.loops, settings.grading_layers)
        self.mesh: Mesh = mesh(self.loops, cracks, settings, marked, None if same is None else same.mesh, half_plane)
        self.boundary: ElementSet = self.mesh.boundary
        self.faces: ElementSet = self.mesh.cracks
        self._measure(same)
        holds = Holds(self.boundary, self.supports, self.support_segments, self._extent) if self.supports else None
        many = self._is_iterated(previous, holds)
        self._functionals: tuple[tuple, TipFunctionals] | None = None
        #: Bodies with trial kinks (`f_criterion`), by kink length and direction number.
        self.trials: dict[float, dict[int, Body]] = {}
        #: Responses to uniform stress, by the states of the crack faces (`uniform_stress_response`).
        self.uniform_responses: dict[bytes, Response] = {}
        #: Whether it is one of many bodies; number of solutions under uniform stress; its `condensed_contact`, if looked
        #: for.
        self.in_number = previous is not None and previous.in_number
        self._grown, self._steps = previous is not None, 0
        self.uniform_solutions = 0
        self._condensed: tuple[UniformContact | None] | None = None
        #: Where faces stand on bases, and how unit tractions move them by the states of the cracks (`rigid_bases`).
        self.on_bases: dict[bytes, tuple[np.ndarray, ...]] = {}
        #: What has been warned of at faces on bases.
        self.warned_of_bases: set[str] = set()
        self._assemble(previous, holds, many)

    def _is_iterated(self, previous: Body | None, holds: Holds | None) -> bool:
        """Whether the boundary is solved iteratively; ``compressed`` says so of the cracks. Raises ValueError for a half-plane
        with too many unknowns on holes."""
        half_plane, unknowns = self.half_plane, self.boundary.n_unknowns
        self._factored_after_all = previous is not None and previous._factored_after_all
        solver = "dense" if self._factored_after_all else self.settings.solver
        holes_supported = holds is not None and bool(self.mesh.edge_loop[holds.sources.source].any())
        many = half_plane is None and is_iterated(solver, unknowns, holds, holes_supported)
        factored = previous is not None and not previous.compressed and previous.faces.n > 0
        self.compressed = is_compressed("compressed" if many else solver, self.faces.n_unknowns, factored)
        if half_plane is not None and unknowns > FACTORABLE:
            raise ValueError(
                f"half-plane: {unknowns} unknowns on holes, but below a free surface no more than {FACTORABLE} can be solved: "
                "set a larger target_error, or draw the surface as a side of a large block"
            )
        return many

    def _measure(self, same: Body | None) -> None:
        """Compute area, centroid and moments of the rock and its holes, or copy those of a body with the ``same``
        loops."""
        if self.outlined and same is not None:
            self.area, self.centroid, self._second = same.area, same.centroid, same._second
            self._reach, self.hole_moments = same._reach, same.hole_moments
        elif self.outlined:
            self.area, self.centroid, self._second = area_moments(self.loops)
            self._reach = float(np.ptp(self.loops[0], axis=0).max())
            self.hole_moments = [area_moments([hole[::-1]])[:2] for hole in self.loops[1:]]
        else:
            self.area, self.centroid = (
                np.inf,
                np.zeros(2) if self.half_plane is None else np.array(self.half_plane.point),
            )

    @property
    def n_unknowns(self) -> int:
        """Unknowns on boundary and cracks."""
        return self.boundary.n_unknowns + self.faces.n_unknowns

    @property
    def nu(self) -> float:
        return self.material.effective_poissons_ratio

    @property
    def outline(self) -> list[np.ndarray] | HalfPlane:
        """The loops or the half-plane without holes, as `Body` takes them."""
        return self.loops[: int(self.outlined)] if self.half_plane is None else self.half_plane

    @property
    def holes(self) -> list[np.ndarray]:
        """The holes, clockwise."""
        return self.loops[int(self.outlined) :]

    def remeshed(self, settings: DdmSettings, previous: Body | None = None) -> Body:
        """The same body with another mesh; ``previous`` as in `Body`."""
        return Body(
            self.outline, self.cracks, self.material, settings, Reuse(previous), self.holes, self.supports, self.face_laws
        )  # fmt: skip

    @property
    def refined(self) -> Body:
        """The same body with the next finer mesh (at the highest order the one below); cached. It has the same
        requested settings."""
        if self._finer is None:
            self._finer = self.remeshed(finer(self.settings), self._finer_before)
            self._finer.requested, self._finer_before = self.requested, None
        return self._finer

    @cached_property
    def with_rounded_walls(self) -> Body | None:
        """The same body with every chord of a curved wall halved (`with_halved_chords`); None where all are straight."""
        halved = with_halved_chords(self)
        if halved is None:
            return None
        loops, cracks, supports = halved
        n = int(self.outlined)
        outline = loops[:n] if self.half_plane is None else self.half_plane
        return Body(
            outline, cracks, self.material, self.settings, None, loops[n:], supports, self.face_laws
        )  # fmt: skip

    def _in_half_plane(self, half_plane: HalfPlane, edges: np.ndarray) -> np.ndarray:
        """``edges`` (m, 2, 2) and a piece of the free surface. Raises ValueError if anything is not below the
        surface."""
        half_plane.check_inside(self.loops, self.cracks)
        return np.concatenate([edges, half_plane.edge(self._vertices)])

    @property
    def _vertices(self) -> np.ndarray:
        """(n, 2) of the loops and of the cracks."""
        return np.concatenate([*self.loops, self.cracks.nodes, np.empty((0, 2))])

    @property
    def limits(self) -> list[np.ndarray]:
        """Loops that bound the rock: outline, holes, and one around the region above a free surface."""
        if self.half_plane is None:
            return self.loops
        return [*self.loops, self.half_plane.region_above_surface(self._vertices)]

    @property
    def sides(self) -> np.ndarray:
        """(m, 2, 2) edges of the loops, and the piece of a free surface above the structure."""
        if self.half_plane is None:
            return self.mesh.edges
        return np.concatenate([self.mesh.edges, self.half_plane.edge(self._vertices)])

    def reusable_for(self, loops: list[np.ndarray], cracks: Cracks, material: Material) -> Body | None:
        """This body if ``loops``, ``cracks`` and ``material`` equal its own, else None. If names or birth cycles of
        cracks differ, the result is a copy that shares everything else."""
        own = self.cracks
        same = (
            material == self.material
            and _same_loops(self.given_loops, loops)
            and all(
                np.array_equal(getattr(own, name), getattr(cracks, name))
                for name in ("nodes", "segments", "aperture", "surface", "law")
            )
            # The iterative solution groups elements by crack.
            and (not self.compressed or np.array_equal(own.crack, cracks.crack))
        )
        if not same:
            return None
        if all(np.array_equal(getattr(own, name), getattr(cracks, name)) for name in ("crack", "block", "birth_cycle")):
            return self
        again = copy(self)
        again.cracks, again._functionals = cracks, None
        vars(again).pop("tip_elements", None)
        return again

    def _assemble(self, previous: Body | None, holds: Holds | None, iterated: bool) -> None:
        nu, tol = self.nu, self._tol
        c, old = self.faces, previous
        outside = old._outside if old else None
        system = BoundarySystem(self.mesh, nu, tol, self._extent, holds, outside, work=self.work, iterated=iterated)
        self._outside = system
        self.boundary = g = system.elements
        g_old, same_boundary = system.at_old, system.unchanged
        c_old = c.found_in(old.faces if old else None)
        c_seen = c.same_place_in(old.faces if old else None, c_old)
        self.counts["elements"] = g.n + c.n
        self.counts["elements_new"] += int((g_old < 0).sum() + (c_old < 0).sum())
        if not same_boundary:
            self.counts["boundary_assemblies"] = self.counts["boundary_factorisations"] = int(g.n > 0)
        self.work.boundary_assemblies += self.counts["boundary_assemblies"]
        self.work.boundary_factorisations += self.counts["boundary_factorisations"]
        self.work.elements_assembled += self.counts["elements_new"]
        self.work.bodies += 1

        if system.holds is not None:
            self._c_known = system.holds.known(c, nu, tol)
        self._loads = UnitLoads(
            self.mesh, self.centroid, self.material, tol, self._extent, self.outlined, system.anchors
        )
        if old is not None and same_boundary:
            self._loads.inherit(old._loads, c_seen)

        if (self.compressed or iterated) and not (old and (old.compressed or old._outside.iterated)):
            of = [f"{g.n_unknowns} on the boundary"] * iterated + [f"{c.n_unknowns} on cracks"] * self.compressed
            _log.info("solved iteratively instead of by factorization: %s", ", ".join(of))
        if self.compressed:
            known_rows = old.condensation.on_cracks if old and isinstance(old.condensation, Operators) else None
            rows = reuse(known_rows, c_seen, g_old, c, g, lambda r, k: system.influence_on(c.take(r), k), "C")
            on_boundary, crack = influence_on_boundary(system, c, np.arange(c.n)), self.cracks.crack[c.source]
            on_both = system.factor if isinstance(system.factor, IteratedBoundary) else None
            following, self.crack_system = compressed(c, crack, system.solve, on_boundary, rows, nu, tol, on_both)
            self.condensation, self.lean = Operators(system, c, following, rows), False
            return
        # G, A_ΓC and S are extended by the rows and columns of new elements. A_CΓ and A_CC are not kept: they are
        # cheaper to recompute if the boundary changes than to carry along.
        kept = old if old is not None and same_boundary and not old.compressed else None
        before = None if kept is None else kept.condensation
        if isinstance(before, Condensed):
            self.condensation = both = Condensed(system, c, before, c_old, c_seen)
        else:
            self.condensation = both = Condensed(system, c)
        cg = both.rows

        def schur(r: np.ndarray, k: np.ndarray) -> np.ndarray:
            direct = influence(c.take(r), c.take(k), nu, tol)
            if not g.n:
                return direct
            # Column-major like the first: subtracting arrays of different order takes several times as long.
            if len(k) < c.n and len(r) > len(k):
                # (Of all rows: picking most of G costs more than a product with few columns.)
                product = cg @ both.columns_of(k).T
                return direct - (product if len(r) == c.n else product[c.unknowns(r)])
            if len(r) == c.n:
                return direct - (both.columns.dense @ cg.dense.T).T
            rows = cg.of(r).T
            return direct - (both.moved_transposed(rows) if len(k) == c.n else both.columns_of(k) @ rows).T

        before_growth = None if kept is None else kept.crack_system
        assert not isinstance(before_growth, IterativeCrackSystem)
        known = None if before_growth is None else before_growth.matrix
        self.lean = old is not None and old.lean
        # Where many faces close or have friction, the equations of open ones are hardly asked for.
        alone = self.lean and c.n_unknowns >= WORTHWHILE and (self.rough or bool(self.closing[1].any()))
        if known is None or not known.n or c.n_unknowns < SMALLEST_BORDERED or alone:
            whole = reuse(None if known is None else known.dense, c_old, c_old, c, c, schur)
            matrix: Bordered | WholeMatrix = Bordered.whole(c, whole)
        else:
            matrix = known.grown(c, c_old, c_seen, schur)
        self.crack_system = CrackSystem(matrix, self.work, before_growth, c_old)
        if self.lean:
            both.release_columns()

    def end_step(self) -> None:
        """A load step ends. One of many bodies, none of whose cracks has grown in a whole step, gives up what only growth
        needs. From then on its contact may be condensed."""
        self._steps += 1
        if self._steps == 2 and self.in_number and self._grown:
            self.stop_growing()
            self._grown = False

    @property
    def for_growth(self) -> int:
        """Bytes that one of many bodies keeps for further growth alone: factors of the boundary."""
        return self.condensation.for_growth if self.in_number and self._grown else 0

    def stop_growing(self) -> None:
        """Give up what is kept `for_growth`."""
        self.condensation.release()

    def retire(self) -> None:
        """Give up what only further loads need, once a body with grown cracks has taken this one's place."""
        if self.lean and isinstance(self.crack_system, CrackSystem):
            self.condensation.retire()
            self.crack_system.retire()
            if "face_equations" in vars(self):
                self.face_equations.forget()
            self._loads.forget()
            self._condensed = (None,)

    def forget_states(self) -> None:
        """Give up the factors of contact states and the loads of one of many bodies, whose contact is condensed: these take
        as much memory as its matrices. Of faces with friction, factors of open ones and of all but the last states are given up,
        where others are kept. From then on factors of a large boundary are given up after every use too."""
        self._outside.sparing = self.in_number
        if not self.in_number or not isinstance(self.crack_system, CrackSystem):
            return
        if self.rough and self.crack_system.bases:
            self.crack_system.release_open()
            # Contacts of moving blocks slide, and hardly any load segment comes back.
            self._loads.forget()
            self.face_equations.keep_last()
        elif not self._grown and condenses(self):
            self.crack_system.retire()
            self._loads.forget()

    def forget_loads(self) -> None:
        """Give up what one of many bodies keeps for loads that recur, while it needs no solutions."""
        if self.in_number:
            self._loads.forget()

    def _imposed(self, applied: Applied) -> np.ndarray:
        """(h_unknowns,) 2μ times the displacement that supports prescribe, minus that of particular fields."""
        holds, load = self._outside.holds, applied.load
        assert holds is not None  # of a body with supports
        values = () if load.displacements is None else load.displacements
        if load.displacements is not None and len(values) != len(self.supports):
            raise ValueError(f"{len(self.supports)} supports but {len(values)} imposed displacements")
        points = holds.sources.nodes
        shift = -applied.regular(points.reshape(-1, 2)).reshape(points.shape)
        for k, value in enumerate(values):
            here, segment = holds.support == k, np.array(self._straight(k))
            at = points[here].reshape(-1, 2)
            shift[here] += values_at(value, segment, at, called(self.supports, k)).reshape(-1, *points.shape[1:])
        return 2 * self.material.shear_modulus * holds.imposed(shift)

    def _straight(self, k: int) -> np.ndarray:
        """(2, 2) ends of support ``k`` in the order given."""
        on = self.supports[k].on
        return self.support_segments[k] if isinstance(on, int) else np.array(on)

    # Solution --------------------------------------------------------------------------------------------------------

    def solve(
        self,
        load: BodyLoad,
        warm: Solution | None = None,
        equilibrium_tolerance: float = 1e-6,
        history: Solution | FaceMemory | None = None,
        meet_target: bool = True,
    ) -> Solution:
        """The body under ``load``.

        With a ``target_error`` in the settings, and unless ``meet_target`` is False, K is compared with that of a finer
        mesh: the result has `tip_errors` below the target and may belong to a finer ``body`` than this one.

        ``history``: the solution, of this or an earlier body, at the end of the previous load step, or its ``memory``.
        Faces with friction start with its slip and broken cement; without it they start as if never loaded. ``warm``: a
        solution whose face states are the first guess of the contact, by default ``history``. It does not affect the
        result, and frictionless faces need nothing else.

        Raises OutOfEquilibrium if force or moment do not vanish within the tolerance, relative to the size of the
        loads; `NotConverged` if the contact of crack faces does not converge; `TargetMissed` if no mesh reaches the
        target.
        """
        target = self.requested.target_error
        if target is not None and meet_target and len(self.cracks.tips):
            rough = self.solve(load, warm, equilibrium_tolerance, history, False)

            def again(body: CrackedBody) -> Solution:
                assert isinstance(body, Body)
                return body.solve(load, warm, np.inf, history, False)

            return refined_to_target(rough, target, again)
        try:
            return self._solved(load, warm, equilibrium_tolerance, history)
        except NotSolved as failure:
            self._factor_after_all(failure)
            return self._solved(load, warm, equilibrium_tolerance, history)

    def _factor_after_all(self, failure: NotSolved) -> None:
        """Switch to factors after the iterative solution, chosen by the number of unknowns, has failed: elements of
        very different lengths, or nearly separated parts, stop its convergence. Raises ``failure`` if the iterative
        solver was requested, or if there are too many unknowns to factor."""
        if self.settings.solver != "auto" or self.faces.n_unknowns + self.boundary.n_unknowns > FACTORABLE:
            raise failure
        _log.info("%s; solved by factorization instead", failure)
        before = copy(self)
        self.compressed, self._factored_after_all = False, True
        for name in ("face_equations", "opens"):
            vars(self).pop(name, None)
        self._assemble(before, self._outside.holds, False)

    def _solved(
        self,
        load: BodyLoad,
        warm: Solution | None,
        equilibrium_tolerance: float,
        history: Solution | FaceMemory | None,
    ) -> Solution:
        applied, units, rest, imposed = self.decompose(load, equilibrium_tolerance)
        # Faces with friction, and many that may close, have other equations, for which S⁻¹ is of no use.
        opening = self.crack_system.opened if self.opens else None
        g, r, reduced, opened = self._loads.add(units, rest, self.condensation, opening, self._outside.iterated)
        pressure = load.face_pressure(self.faces.nodes, self.faces.source, self.cracks.n_segments)
        answer = settle_faces(self, reduced, opened, pressure, warm, history)
        self.work.solutions += 1
        self.work.contact_solves += answer.solves
        on_edges = [unit.densities @ size for unit, size in units if unit.densities is not None]
        edge_density = sum(on_edges) if on_edges else None
        return Solution(self, applied, answer, LoadTractions(g, r, reduced), imposed, edge_density)

    def decompose(
        self, load: BodyLoad, equilibrium_tolerance: float = np.inf
    ) -> tuple[Applied, list[tuple[UnitLoad, np.ndarray]], np.ndarray, np.ndarray]:
        """The parts of ``load`` on this body: fields and line forces; unit loads with their sizes; the remaining
        traction (n,) on boundary and cracks; and the displacement that supports prescribe."""
        applied = apply(load, self)
        if self.outlined:
            check_equilibrium(applied, self, equilibrium_tolerance)
        n_g, uniform = self.boundary.n_unknowns, applied.particular.uniform
        rest = np.zeros(n_g + self.faces.n_unknowns)
        if uniform.any() and len(self.loops) == self.outlined:  # otherwise it is one of the unit loads
            rest[n_g:] = on_elements(self.faces, uniform)
        if load.intact is not None:
            rest[n_g:] += on_elements(self.faces, load.intact.stress(self.faces.nodes.reshape(-1, 2)))
        if not applied.plain:
            tol = 2 * OFF * self._extent
            rest[:n_g] += applied.on(self.boundary, True, self.nu, tol, self._outside.anchors)
            rest[n_g:] += applied.on(self.faces, False, self.nu, tol)
        imposed = np.zeros(0)
        if self.supports:
            imposed = self._imposed(applied)
            rest += np.concatenate([self._outside.known @ imposed, self._c_known @ imposed])
        return applied, self._loads.of(applied), rest, imposed

    def closed_traction(self, load: BodyLoad) -> np.ndarray:
        """(n_crack_unknowns,) Pa, tangential and normal: traction of ``load`` on crack faces without opening or
        slip."""
        _, units, rest, _ = self.decompose(load)
        total = rest + sum(unit.applied @ size for unit, size in units)
        n_g = self.boundary.n_unknowns
        reduction = self.condensation
        return total[n_g:] - reduction.then(reduction.first(total[:n_g])) if n_g else total

    def unit_responses(self, segments: np.ndarray, mix: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Tractions on the boundary (n_boundary_unknowns, k) and on closed faces (n_crack_unknowns, k) of loads ``mix`` (4 m, k) of
        unit forces at the ends of ``segments`` (m, 2, 2), N/m; rows as the columns in `UnitLoad`."""
        return self._loads.answers(segments, mix, self.condensation)

    def boundary_unknowns(self, load: np.ndarray, jumps: np.ndarray) -> np.ndarray:
        """(n_boundary_unknowns,) or (…, k): 2μ times displacement, or reactions where supported, under tractions ``load``
        (n_boundary_unknowns,) on the boundary and ``jumps`` (n_crack_unknowns,) at the cracks; or (…, k) each."""
        right = load + self.condensation.moved_by(jumps) if self.faces.n else load
        return -self._outside.solve(right, counted=False)

    def boundary_measures(self, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """``weights`` (k, n_boundary_unknowns) times `boundary_unknowns` as a linear function (k, n_boundary_unknowns) of the tractions
        on the boundary and (k, n_crack_unknowns) of the jumps."""
        of_load = -self._outside.carried(weights)
        of_jumps = self.condensation.moved_transposed(of_load.T).T if self.faces.n else np.empty((len(weights), 0))
        return of_load, of_jumps

    def reduced_transposed(self, on_faces: np.ndarray) -> np.ndarray:
        """(n_boundary_unknowns, k): the action of tractions on the boundary on what ``on_faces`` (n_crack_unknowns, k)
        measures of those on closed faces."""
        return self.condensation.transposed(on_faces)

    def tractions(self, unknowns: np.ndarray, jumps: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Tractions (n_boundary_unknowns,) on the boundary, seen from outside, and (n_crack_unknowns,) on the cracks due
        to the boundary ``unknowns`` and the ``jumps`` at the cracks."""
        own = self._outside.matrix @ unknowns
        if not self.faces.n:
            return own, np.zeros(0)
        # A_CC w follows from S, which is kept.
        of, moved = self.condensation, self.condensation.moved_by(jumps)
        crack = self.crack_system.matrix @ jumps + of.then(of.first(moved))
        return own + moved, crack + of.influence_on(np.arange(self.faces.n)) @ unknowns

    def release(self) -> None:
        """Give up large matrices that loads do not need, but growth and fields inside the body do: these compute them
        again. Bodies that grow from this one keep no room for further growth."""
        self.lean, self.in_number = self._outside.large, True
        self.condensation.release()

    def k_functionals(self, solution: Solution | None = None) -> TipFunctionals:
        """K_I and K_II of all tips as linear functions of the load, for the face states of ``solution`` (all open if
        None). The last ones are cached."""
        began = None if solution is None else solution.began
        key = (b"" if solution is None else solution.face_states.key), began
        if self._functionals is None or self._functionals[0][0] != key[0] or self._functionals[0][1] is not began:
            self._functionals = key, TipFunctionals(self, solution)
        return self._functionals[1]

    @cached_property
    def opens(self) -> bool:
        """Whether solutions begin with those for open faces, S⁻¹ times the load."""
        return not self.rough and not (self.crack_system.by_free_unknowns and self.closing[1].any())

    @cached_property
    def laws(self) -> FaceLaws:
        """The laws of the faces at each node."""
        return FaceLaws(self.face_laws, self.faces, self.cracks, 2 * self.material.shear_modulus)

    @cached_property
    def initial_memory(self) -> FaceMemory:
        """Memory of faces that have never been loaded."""
        return FaceMemory.none(self.faces)

    def condensed_contact(self, closed: np.ndarray | None = None) -> UniformContact | None:
        """The contact of faces under uniform stress, condensed (`uniform_contact`), first with the unknowns ``closed``
        (n_crack_unknowns,) bool; without them, only if it is known. None where it is not worth its memory or cannot be
        done: of few bodies, and of cracks that have just grown."""
        if not self.in_number or (self._grown and self.uniform_solutions < WORTH_CONDENSING):
            return None
        if self._condensed is None and closed is not None:
            try:
                self._condensed = (UniformContact(self, closed) if condenses(self) else None,)
            except np.linalg.LinAlgError:
                self._condensed = (None,)
        return None if self._condensed is None else self._condensed[0]

    @cached_property
    def face_equations(self) -> FaceEquations:
        """The equations of crack faces in any contact state."""
        return FaceEquations(self.crack_system, self.laws, self.work)

    @cached_property
    def tip_elements(self) -> tuple[np.ndarray, ...]:
        """See `tip_elements.tip_elements`."""
        return tip_elements(self.cracks, self.faces)

    @cached_property
    def closing(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """See `jumps.closing`."""
        return closing(self.faces, self.cracks, 2 * self.material.shear_modulus)

    def mean_stress_load(self, stress: np.ndarray) -> BodyLoad:
        """Uniform tractions on the outline under which the mean stress (3,) of the rock, Pa, is ``stress``: more than
        that of the outline where there are holes, which are free of it."""
        holes = sum(area for area, _ in self.hole_moments)
        return BodyLoad(remote_stress=np.asarray(stress) * (self.area / (self.area + holes)))

    @cached_property
    def mean_stress_traction(self) -> np.ndarray:
        """(n_crack_unknowns, 3): traction on closed crack faces per mean stress (xx, yy, xy), of `mean_stress_load`."""
        if len(self.loops) == 1 or self.supports:
            return np.column_stack([on_elements(self.faces, unit) for unit in np.eye(3)])
        return np.column_stack([self.closed_traction(self.mean_stress_load(unit)) for unit in np.eye(3)])

    @cached_property
    def strain_weights(self) -> np.ndarray:
        """(3, n_unknowns) mean strain of the cracks from nodal slip and opening (times 2μ): strain on which the mean
        stress does the work that it does at the cracks. Without holes it is that of the faces alone; holes give way
        to the cracks, and the strain is that of the outline."""
        if len(self.loops) == 1 or self.supports:
            weights = strain_weights(self.faces)
        else:
            c = self.faces
            weights = self.mean_stress_traction.T * np.broadcast_to(c.quadrature[:, None], (c.n, 2, c.per)).ravel()
        return weights / (self.area * 2 * self.material.shear_modulus)

    def compliance(self, sol: Solution | None = None) -> np.ndarray:
        """(3, 3) added compliance due to cracks, 1/Pa: mean crack strain (xx, yy, xy; engineering shear) per uniform
        boundary stress, with the face states of ``sol`` (all open if None); symmetrised. Raises ValueError in the
        infinite plane and with supports, where it is not defined."""
        if not self.outlined:
            raise ValueError("the mean strain of cracks is defined for a body with an outline only")
        if self.supports:
            raise ValueError("the compliance added by cracks is defined for a body without supports only")
        if not self.faces.n:
            return np.zeros((3, 3))
        if scales(self):
            closed = np.zeros(self.faces.n_unknowns, bool) if sol is None else sol.closed
            response = uniform_stress_response_of(self, closed).compliance()
            return 0.5 * (response + response.T)
        if sol is not None and self.rough and is_simple(self):
            jumps = self.face_equations.uniform_tangent(-self.mean_stress_traction, sol.face_states)
            response = self.strain_weights @ jumps
        else:
            response = self.strain_weights @ self.jumps_under(self.mean_stress_traction, sol)
        return 0.5 * (response + response.T)

    def jumps_under(self, traction: np.ndarray, sol: Solution | None = None) -> np.ndarray:
        """(n_unknowns, k) slip and opening, times 2μ, per load that causes the ``traction`` (n_unknowns, k) on closed
        faces, with the face states of ``sol`` (all open if None)."""
        right = -traction
        try:
            return self._jumps_of(right, sol)
        except NotSolved as failure:
            self._factor_after_all(failure)
            return self._jumps_of(right, sol)

    def _jumps_of(self, right: np.ndarray, sol: Solution | None) -> np.ndarray:
        """(n_unknowns, k) jumps under the face loads ``right``, with the face states of ``sol``."""
        if sol is not None and self.rough:
            return self.face_equations.tangent(right, sol.face_states)
        closed = np.zeros(self.faces.n_unknowns, bool) if sol is None else sol.closed
        return self.crack_system.constrained(right, closed, np.zeros_like(right))[0]


def _same_loops(old: list[np.ndarray], new: list[np.ndarray]) -> bool:
    return len(old) == len(new) and all(np.array_equal(a, b) for a, b in zip(old, new))
