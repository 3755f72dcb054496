"""A scene made ready for the solvers: what `geomech.scene.build` fills and `geomech.coupling` runs."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from .blocks.block_arrays import Blocks
from .contact_solver import ContactSolver
from .cracks.crack_arrays import Cracks
from .joints.joint_law import JointLaw
from .loads.applied_loads import Loads
from .loads.in_situ import InSituStress
from .material import Material
from .numbers import Number, refuse_numbers
from .unbounded_rock import EndlessRock


@dataclass(frozen=True)
class DdaSettings:
    """How blocks are moved (names and values of Shi 1988 where he has them).

    ``time_step`` s is that of every step, or with ``automatic_time_step`` the longest, by which steps then grow and
    shrink as they prove easy or hard (`dda.StepLength`). ``normal_penalty`` and ``shear_penalty`` are contact spring
    stiffnesses, N/m per metre of thickness (Pa); None picks them from the blocks' stiffness. With ``springs`` "resolved"
    those that are picked are in motion no stiffer than ``time_step`` resolves, 100 m/dt² (m of the lighter block) and at
    least E'/2, once the blocks bear what was put on them at the start: faces keep their forces then and sink in no further,
    and what opens and closes by micrometres takes no iterations (bonds and joints with a stiffness of their own stay as
    they are). ``contact`` "augmented"
    adds multipliers to these springs until closed contacts gape and sticking ones give by less than
    ``penetration_tolerance`` times √area of the smallest block, whatever the penalty. ``corner_rounding`` is the length
    over which two corners that meet are rounded, in sizes (√area) of the smaller block, at most a quarter of the
    shortest edge there: corners that overlap by less slide over each other, by more they hold (Itasca's UDEC advises
    a hundredth of an edge). ``dynamic_factor`` multiplies the
    velocity carried from step to step: 0 is static, 1 fully dynamic. ``newmark`` is (β, γ) of the time scheme: (½, 1)
    is Shi's, (¼, ½) the trapezoidal rule, which has no dissipation; in between it has some; 2β ≥ γ ≥ ½, β ≤ γ − ¼. With γ > ½ it
    is of first order (of second for what only falls and turns, if γ = 2β). ``spectral_radius`` ϱ of 0 to 1 puts the
    α-scheme of Wood, Bossak & Zienkiewicz in its place, of second order, which damps by ϱ a step what the step does not
    resolve; near 1 blocks that bounce may gain energy. ``damping`` is the fraction of critical damping of a block's own lowest vibration, and of its contacts'
    (dynamic steps only): below about 0.3 a block that should stick may flutter on its friction and creep, waves that
    cross many blocks want less; ``rayleigh_mass`` 1/s and ``rayleigh_stiffness``
    s damp blocks by α M + β K besides (`rayleigh_coefficients` finds them). ``max_displacement_ratio`` bounds the
    largest displacement in a step, in units of half the diagonal of the domain, however it lies: how finely a motion is
    to be followed. What contacts need is looked after besides: two blocks near each other move against each other by a
    tenth of √(√A √A′) in a step, and turn by 0.15, A and A′ their areas, and a step in which anything goes into or through
    a block is made again (`dda.step_control.relative_motion`, `dda.step_control.continuous_collision`). ``equilibrium`` says when a run seeks
    static equilibrium (`dda.statics.pseudo_time_equilibrium`): "" never, "start" before it begins, "loads" at every load of a static run
    too; ``unbalanced_tolerance`` is its unbalanced force over the mean force. ``contact_solver`` holds what the open–close
    iteration is tuned by; no scene sets it. Raises ValueError naming the setting
    that is none of its numbers (`_DDA_NUMBERS`) or words.
    """

    time_step: float = 1.0
    automatic_time_step: bool = False
    dynamic_factor: float = 0.0
    newmark: tuple[float, float] = (0.5, 1.0)
    spectral_radius: float | None = None
    equilibrium: str = ""
    unbalanced_tolerance: float = 1e-6
    damping: float = 0.4
    rayleigh_mass: float = 0.0
    rayleigh_stiffness: float = 0.0
    max_displacement_ratio: float = 0.01
    normal_penalty: float | None = None
    shear_penalty: float | None = None
    contact: str = "penalty"
    springs: str = "stiff"
    corner_rounding: float = 0.01
    penetration_tolerance: float = 1e-8
    max_open_close_iterations: int = 60
    max_step_cuts: int = 12
    contact_solver: ContactSolver = field(default_factory=ContactSolver)

    def __post_init__(self) -> None:
        refuse_numbers(self, _DDA_NUMBERS)
        words = ("contact", ("penalty", "augmented")), ("springs", ("stiff", "resolved"))
        for name, known in (*words, ("equilibrium", ("", "start", "loads"))):
            if getattr(self, name) not in known:
                raise ValueError(f"{name} is {' or '.join(map(repr, known))}, not {getattr(self, name)!r}")
        if len(self.newmark) != 2 or not all(Number().holds(value) for value in self.newmark):
            raise ValueError(f"newmark must be two finite numbers, β and γ, got {self.newmark!r}")
        beta, gamma = self.newmark
        if not (2 * beta >= gamma >= 0.5):
            raise ValueError(
                f"Newmark's β = {beta:g}, γ = {gamma:g} is not stable at every time step, and contact springs are far "
                "stiffer than steps resolve: it takes 2β ≥ γ ≥ ½ (trapezoidal rule 0.25, 0.5; Shi's scheme 0.5, 1)"
            )
        if beta > max(gamma - 0.25, 0.5 * gamma) * (1 + 1e-12):
            raise ValueError(
                f"Newmark's β = {beta:g}, γ = {gamma:g} keeps more in its accelerations than it damps, and blocks that "
                "bounce gain energy: it takes β ≤ γ − ¼ (trapezoidal rule 0.25, 0.5; Shi's scheme 0.5, 1)"
            )


#: Corners rounded over more than this part of a block's size are no corners any more.
LARGEST_CORNER = 0.25
#: What the numbers of `DdaSettings` may be.
_DDA_NUMBERS = {
    "time_step": Number(closed=False, unit="s"),
    "dynamic_factor": Number(most=1.0),
    "spectral_radius": Number(most=1.0, optional=True),
    "unbalanced_tolerance": Number(closed=False),
    "damping": Number(),
    "rayleigh_mass": Number(unit="1/s"),
    "rayleigh_stiffness": Number(unit="s"),
    "max_displacement_ratio": Number(closed=False),
    "normal_penalty": Number(closed=False, unit="Pa", optional=True),
    "shear_penalty": Number(closed=False, unit="Pa", optional=True),
    "penetration_tolerance": Number(most=1.0, closed=False),
    "corner_rounding": Number(most=LARGEST_CORNER),
    "max_open_close_iterations": Number(least=1, whole=True),
    "max_step_cuts": Number(whole=True),
}


#: Highest polynomial order of an element. K of a straight crack of four elements is right to 1e-12 there; from then on
#: the round-off of monomials on [−1, 1] grows 2.4 times an order, more than the order gains (16: 1e-11, 20: 1e-10).
HIGHEST_ORDER = 12
NODE_FAMILIES, SOLVERS = ("chebyshev", "gauss", "equal"), ("auto", "dense", "compressed")


@dataclass(frozen=True)
class DdmSettings:
    """How cracked blocks are meshed: ``order`` p of the elements, 0 to 12 (beyond, round-off grows faster than the
    error falls), family of collocation ``nodes`` ("chebyshev", "gauss" or "equal"), elements of a straight crack, of a
    boundary side; and how they are solved: ``solver`` "dense" (factored), "compressed" (iterated) or "auto", by the
    number of unknowns. Raises ValueError naming the setting that cannot be.

    Kinks get more than the ``grading_layers``, by their angle: 2 leave an error of 5e-4 in K, every one more halves it.

    With ``target_error``, the relative error of K that is asked for, order, elements and grading follow from it
    instead, and solutions are compared with those of finer meshes until they meet it. With ``grading_error`` each corner, kink, junction and mouth gets the layers that this error of K needs
    there, in place of ``grading_layers`` everywhere.
    """

    order: int = 4
    nodes: str = "chebyshev"
    elements_per_crack: int = 4
    elements_per_side: int = 6
    grading_ratio: float = 0.3
    grading_layers: int = 2
    solver: str = "auto"
    target_error: float | None = None
    grading_error: float | None = None

    def __post_init__(self) -> None:
        for name, least in (("order", 0), ("elements_per_crack", 1), ("elements_per_side", 1), ("grading_layers", 0)):
            value = getattr(self, name)
            if not isinstance(value, (int, np.integer)) or value < least:
                raise ValueError(f"{name} must be a whole number of at least {least}, got {value!r}")
        if self.order > HIGHEST_ORDER:
            raise ValueError(
                f"order must be at most {HIGHEST_ORDER}, got {self.order!r} (beyond, round-off grows faster than the error "
                "falls: take more elements, or grade them)"
            )
        for name, known in (("nodes", NODE_FAMILIES), ("solver", SOLVERS)):
            value = getattr(self, name)
            if value not in known:
                raise ValueError(f"{name} must be one of {', '.join(map(repr, known))}, got {value!r}")
        if not 0 < self.grading_ratio < 1:
            raise ValueError(f"grading_ratio must lie between 0 and 1, got {self.grading_ratio!r}")
        for name in ("target_error", "grading_error"):
            value = getattr(self, name)
            if value is not None and not 0 < value < 1:
                raise ValueError(f"{name} must lie between 0 and 1, got {value!r}")


@dataclass(frozen=True)
class GrowthSettings:
    """When and how far tips go. ``increment`` m, longest advance in a cycle; ``min_increment`` m, shortest.

    ``initiation`` says where cracks may be born besides: "" nowhere, "surface" on outlines, holes and crack faces,
    "everywhere" inside the rock too. ``initiation_distance`` m averages the stress there over a distance into the rock
    (0: the stress at the point), ``initiation_spacing`` m is the least distance between births (0: five increments).
    ``speed_limit`` is the part of the Rayleigh speed above which no tip runs in a dynamic run: 0.4, for cracks in rock
    and glass stay below half of it (Ravi-Chandar & Knauss 1984).
    Where a tip is nearer to another crack than ``approach_steps`` increments, all tips of the block take shorter ones,
    so many to what is left (0: they do not).
    ``trial_kink`` m: the criterion "f" tries kinks of this length in all directions, faces in contact (0: kinks of no
    length, on which nothing presses).
    """

    criterion: str = "mts"
    increment: float = 1e-3
    min_increment: float = 1e-4
    join_distance: float = 0.5  # in units of the increment: nearer than that to a crack or surface, a tip joins it …
    join_length: float | None = None  # … or m; loads at which cracks join and cut through then have a limit
    max_passes: int = 200  # growth passes of a load step; a static load then waits for tips that still run
    correct: bool = True  # predict a step, look how it would go on, and bend it (second order in the increment)
    initiation: str = ""
    initiation_distance: float = 0.0
    initiation_spacing: float = 0.0
    trial_kink: float = 0.0
    speed_limit: float = 0.4
    approach_steps: float = 0.0

    def __post_init__(self) -> None:
        if not 0 < self.increment < math.inf:
            raise ValueError(f"increment must be a length, got {self.increment!r} m")
        if not 0 < self.min_increment <= self.increment:
            raise ValueError(
                f"min_increment must be a length of at most the increment of {self.increment:g} m, got {self.min_increment!r} m"
            )
        for name in ("join_distance", "initiation_distance", "initiation_spacing", "approach_steps"):
            if not 0 <= getattr(self, name) < math.inf:
                raise ValueError(f"{name} must not be negative, got {getattr(self, name)!r}")
        if self.join_length is not None and not 0 < self.join_length < math.inf:
            raise ValueError(f"join_length must be a length, got {self.join_length!r} m")


#: Kinds of events that contacts and crack faces make: one opens, none touches any more, one closes, one slips, none
#: sticks any more, one sticks again, one loses its bond.
CHANGES = ("opening", "parting", "closure", "slip", "sliding", "stick", "debonding")
#: Kinds of events that may end a run, of which `RunSettings.stop_at` names some.
STOPS = ("initiation", "birth", "coalescence", "self", "daylighting", "split", "mechanism", *CHANGES)


@dataclass(frozen=True)
class RunSettings:
    """Load stepping. The scene ends at ``end_time`` s or at the first event whose kind is in ``stop_at``; steps to
    "events" also at a mechanism, after which no load has an equilibrium that they could look for.

    ``stepping`` "fixed": steps of `DdaSettings.time_step`; "events": static steps that end where a tip has just reached
    its toughness or, as ``events`` says, a contact or a crack face changes its state, otherwise as long as blocks may
    move in one, or ``longest_step`` s. ``control`` "load": loads and imposed motion rise with time; "toughness" (with
    "events"): they are those at which the most driven tip has K_eq = K_Ic, more or less than before. What ``events``
    names is told of by other steps as well, when they end; None: all of it by steps to events, nothing by others.
    ``boundary_stress`` says how contact forces load cracked blocks: "contacts" spread over faces, "bases" so, and on
    fixed and guided blocks as on a rigid base, "springs" at points, "kelvin-springs" at points of the infinite plane.
    Without ``skip`` every body is made anew and every answer worked out anew in every pass, though nothing about it has
    changed: the same results, for comparison.
    """

    end_time: float = 1.0
    stop_at: tuple[str, ...] = ("coalescence", "split")
    boundary_stress: str = "contacts"
    stepping: str = "fixed"
    events: tuple[str, ...] | None = None
    longest_step: float | None = None
    control: str = "load"
    skip: bool = True


#: The ``load_edge`` of a problem whose weight leads.
WEIGHT = "gravity"


@dataclass(frozen=True, eq=False)
class Problem:
    """Everything a run needs. ``joint_of`` maps a pair of edge names to the law of contacts between such edges, the
    cracks' ``law`` counts in ``face_laws``.

    ``load_edge`` names the edges whose traction is the scene's leading load (normal component, positive in
    compression), or what it takes to move their block, or is `WEIGHT`; ``in_situ`` is the stress that the blocks have,
    at rest, before the run; ``gauge`` is a pair of points (reference coordinates) and the blocks that carry them, whose
    approach over their distance is the axial strain. ``endless``: the only block, which is fixed, is a piece of rock
    without an end. ``velocity`` (n_blocks, 2), m/s, is that of the blocks as the first step begins, None: at rest.
    """

    title: str
    blocks: Blocks
    cracks: Cracks
    materials: tuple[Material, ...]
    joints: tuple[JointLaw, ...]
    joint_of: dict[tuple[str, str], int] = field(default_factory=dict)
    face_laws: tuple[JointLaw, ...] = (JointLaw("frictionless"),)
    loads: Loads = field(default_factory=Loads)
    in_situ: InSituStress | None = None
    dda: DdaSettings = field(default_factory=DdaSettings)
    ddm: DdmSettings = field(default_factory=DdmSettings)
    growth: GrowthSettings = field(default_factory=GrowthSettings)
    run: RunSettings = field(default_factory=RunSettings)
    load_edge: str = ""
    gauge: tuple[tuple[int, tuple[float, float]], tuple[int, tuple[float, float]]] | None = None
    monitors: dict[str, tuple[int, tuple[float, float]]] = field(default_factory=dict)
    origin: tuple[float, float] = (0.0, 0.0)  # world coordinates of (0, 0), m
    endless: EndlessRock | None = None
    velocity: np.ndarray | None = None

    @property
    def ends_at(self) -> tuple[str, ...]:
        """The kinds of events that end the run: those of ``run.stop_at``, a split of rock without an end, which nothing
        holds, and a mechanism where steps lead to events."""
        split = ("split",) if self.endless is not None else ()
        return (*self.run.stop_at, *split, *(("mechanism",) if self.run.stepping == "events" else ()))

    @property
    def inventory(self) -> str:
        """What there is, for messages: "3 blocks, 1 crack"."""
        return f"{counted(self.blocks.n_blocks, 'block')}, {counted(self.cracks.n_cracks, 'crack')}"

    def joint_index(self, edge_name: str, other_name: str) -> int:
        """The joint law between two edges by their names: the pair's, else either name's alone, else the first law."""
        a, b = sorted((edge_name, other_name))
        for key in ((a, b), ("", b), ("", a)):
            if key in self.joint_of:
                return self.joint_of[key]
        return 0

    def __post_init__(self) -> None:
        if self.cracks.n_segments and not np.isin(self.cracks.block, np.arange(self.blocks.n_blocks)).all():
            raise ValueError("a crack lies in a block that does not exist")
        for block in np.unique(self.cracks.block):
            material = self.materials[self.blocks.material[block]]
            if material.rigid:
                name = self.blocks.names[block] if self.blocks.names else f"block {block}"
                raise ValueError(f"{name!r} holds a crack, but its material {material.name!r} is rigid")


def counted(number: int, noun: str) -> str:
    """ "1 block", "2 blocks": for messages."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"
