"""The complete problem for the solvers and its settings: `geomech.scene.build` makes it, `geomech.coupling` runs it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal, get_args

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
    """Settings of the block solver (names and values after Shi 1988 where he has them).

    time_step            s; of every step, or the longest one with ``automatic_time_step``
    automatic_time_step  True: steps shrink and grow with the open–close iterations they take and, in motion, with the
                         energy that the time scheme takes
                         (`dda.step_control.adaptive_time_step`)
    normal_penalty, shear_penalty   contact spring stiffness, N/m per metre of thickness (Pa); None: from the stiffness
                         of the blocks (`dda.joint_laws.penalty_springs`)
    springs              "stiff", or "resolved": in motion, penalty springs are no stiffer than the time step resolves,
                         100 m/dt² (m the mass of the lighter block), and at least E'/2. This begins once the blocks
                         bear the initial loads: faces then keep their forces and penetrate no further, and micrometre
                         openings cost no iterations. Bonds and joints with a stiffness of their own keep theirs
    contact              "penalty", or "augmented": multipliers are added to the springs until closed contacts
                         penetrate, and sticking ones slip, by less than ``penetration_tolerance`` times √area of the
                         smallest block, whatever the penalty
    order_target         blocks whose order is found as the run goes (`AUTO_ORDER`) are raised while higher orders would take
                         up more than this part of the energy of all such blocks (`dda.higher_order.order_choice`)
    corner_rounding      length over which two corners that meet are rounded, in units of √area of the smaller block, at
                         most a quarter of the shortest edge there. Corners that overlap by less slide over each other,
                         others hold (the UDEC manual advises a hundredth of an edge)
    dynamic_factor       factor on the velocity carried from step to step: 0 static, 1 fully dynamic
    contact_solver       what the open–close iteration is tuned by (`ContactSolver`); no scene sets it
    newmark              (β, γ) of Newmark's scheme with 2β ≥ γ ≥ ½ and β ≤ γ − ¼: (½, 1) is Shi's, (¼, ½) the
                         trapezoidal rule, which does not dissipate. γ > ½ dissipates and is of first order (of second
                         for free flight and rotation if γ = 2β)
    spectral_radius      ϱ in [0, 1]: the second-order α-scheme of Wood, Bossak & Zienkiewicz instead of Newmark's. It
                         damps what the step does not resolve by ϱ per step; near 1, bouncing blocks may gain energy
    damping              fraction of critical damping of each block's lowest vibration and of its contacts, in dynamic
                         steps. Below about 0.3 a block that should stick may flutter and creep; waves across many
                         blocks need less
    rayleigh_mass, rayleigh_stiffness   1/s and s: damping α M + β K besides (`rayleigh_coefficients`)
    max_displacement_ratio   largest displacement in a step over half the diagonal of the domain. Contacts have limits
                         of their own: two near blocks of areas A, A′ move relative to each other by at most a tenth of
                         (A A′)^¼ and rotate by at most 0.15 rad per step (`dda.step_control.relative_motion`), and a
                         step in which a vertex passes into or through a block is repeated
                         (`dda.step_control.continuous_collision`)
    equilibrium          "" never; "start": static equilibrium before the run; "loads": also at every load of a static
                         run (`dda.statics.pseudo_time_equilibrium`)
    unbalanced_tolerance out-of-balance force over the mean force at that equilibrium

    Raises ValueError that names a setting outside its range (`_DDA_NUMBERS`) or words.
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
    order_target: float = 0.01
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
                f"Newmark's β = {beta:g}, γ = {gamma:g} is not unconditionally stable, as stiff contact springs "
                "require: choose 2β ≥ γ ≥ ½ (trapezoidal rule 0.25, 0.5; Shi's scheme 0.5, 1)"
            )
        if beta > max(gamma - 0.25, 0.5 * gamma) * (1 + 1e-12):
            raise ValueError(
                f"Newmark's β = {beta:g}, γ = {gamma:g} lets blocks that bounce gain energy: choose β ≤ γ − ¼ "
                "(trapezoidal rule 0.25, 0.5; Shi's scheme 0.5, 1)"
            )


#: Largest corner rounding, in units of the block's size √area.
LARGEST_CORNER = 0.25
#: Shortest time step that can be asked for, s: a hundred thousandth of the time that a wave takes to cross a grain of sand.
#: Squares of steps and their fractions stay far above the smallest number of double precision.
SHORTEST_STEP = 1e-12
#: Admissible numbers of `DdaSettings`.
_DDA_NUMBERS = {
    "time_step": Number(least=SHORTEST_STEP, unit="s"),
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
    "order_target": Number(most=1.0, closed=False),
    "corner_rounding": Number(most=LARGEST_CORNER),
    "max_open_close_iterations": Number(least=1, whole=True),
    "max_step_cuts": Number(whole=True),
}


#: Highest polynomial order of an element. K of a straight crack of four elements has an error of 1e-12 there. Beyond,
#: round-off of monomials on [−1, 1] grows by 2.4 per order, faster than the error falls (16: 1e-11, 20: 1e-10).
HIGHEST_ORDER = 12
NODE_FAMILIES, SOLVERS = ("chebyshev", "gauss", "equal"), ("auto", "dense", "compressed")


@dataclass(frozen=True)
class DdmSettings:
    """Settings of the crack solver: mesh and solution of one elastic body.

    order            p of the elements, 0 to 12
    nodes            collocation nodes: "chebyshev", "gauss" or "equal"
    elements_per_crack, elements_per_side   elements of a straight crack, and of a side of the boundary
    grading_ratio    ratio of neighbouring elements at kinks, junctions, corners and mouths
    grading_layers   layers of that grading. Kinks get more, by their angle: 2 layers leave an error of 5e-4 in K, each
                     further layer halves it
    solver           "dense" (factored), "compressed" (iterative), or "auto" by the number of unknowns
    target_error     relative error of K that is wanted: order, elements and grading follow from it, and solutions are
                     compared with finer meshes until they meet it; None: the settings above
    grading_error    error of K for which each corner, kink, junction and mouth gets its layers, in place of
                     ``grading_layers`` everywhere; None: ``grading_layers``

    Raises ValueError that names the setting.
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
    """Settings of crack growth.

    increment, min_increment   longest and shortest advance of a tip in a cycle, m
    criterion          a name of `ddm.fracture.criteria.CRITERIA`
    initiation         where cracks may start in intact rock: "" nowhere, "surface" on outlines, holes and crack faces,
                       "everywhere" inside the rock too
    initiation_distance   m, distance into the rock over which the stress is averaged (0: stress at the point)
    initiation_spacing    m, least distance between new cracks (0: five increments)
    speed_limit        largest tip speed over the Rayleigh speed in dynamic runs: 0.4, because cracks in rock and glass
                       stay below half of it (Ravi-Chandar & Knauss 1984)
    approach_steps     a tip nearer to another crack than this many increments shortens the steps of its block to
                       distance/``approach_steps`` (0: no shortening)
    trial_kink         m, length of the kinks that criterion "f" tries in all directions with contact of their faces
                       (0: infinitesimal kinks without contact)
    """

    criterion: str = "mts"
    increment: float = 1e-3
    min_increment: float = 1e-4
    join_distance: float = 0.5  # in units of the increment: a tip nearer than that to a crack or surface joins it
    join_length: float | None = None  # the same in m: coalescence loads then converge as the increment shrinks
    max_passes: int = 200  # growth passes per load step; a static load then waits for tips that still grow
    correct: bool = True  # predictor–corrector paths, of second order in the increment
    initiation: str = ""
    initiation_distance: float = 0.0
    initiation_spacing: float = 0.0
    trial_kink: float = 0.0
    speed_limit: float = 0.4
    approach_steps: float = 0.0

    def __post_init__(self) -> None:
        if not 0 < self.increment < math.inf:
            raise ValueError(f"increment must be a positive length, got {self.increment!r} m")
        if not 0 < self.min_increment <= self.increment:
            raise ValueError(
                f"min_increment must be a length of at most the increment of {self.increment:g} m, got {self.min_increment!r} m"
            )
        for name in ("join_distance", "initiation_distance", "initiation_spacing", "approach_steps"):
            if not 0 <= getattr(self, name) < math.inf:
                raise ValueError(f"{name} must not be negative, got {getattr(self, name)!r}")
        if self.join_length is not None and not 0 < self.join_length < math.inf:
            raise ValueError(f"join_length must be a length, got {self.join_length!r} m")


#: Kinds of events of contacts and crack faces: one opens, the last one opens, one closes, one slips, the last sticking
#: one slips, one sticks again, one loses its bond.
Change = Literal["opening", "parting", "closure", "slip", "sliding", "stick", "debonding"]
CHANGES: tuple[str, ...] = get_args(Change)
#: Kinds of events that `RunSettings.stop_at` may name.
Stop = Literal["initiation", "birth", "coalescence", "self", "daylighting", "split", "mechanism", Change]
STOPS: tuple[str, ...] = get_args(Stop)
#: What `RunSettings.repeat` may name, and its words in messages.
Repeat = Literal["noise", "steps", "increment", "elements"]
REPEATS: dict[Repeat, str] = {
    "noise": "coordinates changed by round-off",
    "steps": "steps half as large",
    "increment": "growth increments half as long",
    "elements": "twice as many boundary elements",
}


@dataclass(frozen=True)
class RunSettings:
    """Load stepping, and when a run ends: at ``end_time`` s or at the first event of a kind in ``stop_at``.

    Steps to "events" also end a run at a mechanism, beyond which no load has an equilibrium.

    stepping         "fixed": steps of `DdaSettings.time_step`. "events": static steps that end where a tip reaches its
                     toughness or, as ``events`` says, a contact or crack face changes its state; otherwise as long as
                     the displacement limit or ``longest_step`` s allow
    control          "load": loads and prescribed motion follow time. "toughness" (with "events"): they are scaled so
                     that the most heavily loaded tip has K_eq = K_Ic
    events           kinds of state changes that steps end at, or report when steps are fixed; None: all with "events",
                     none with "fixed"
    boundary_stress  how contact forces load a cracked block of order 1: "contacts" as pressures linear over faces; "bases"
                     likewise, but on fixed, guided and rigid blocks as on a rigid base; "auto" as "bases", but linear on a
                     specimen between two platens; "springs" as point forces; "kelvin-springs" as point forces of the
                     infinite plane
    skip             False: every body and solution is recomputed in every pass, for comparison; results are the same
    repeat           kinds of `REPEATS`: the finished run is repeated with each of these changes, and states by how much
                     its results differ
    """

    end_time: float = 1.0
    stop_at: tuple[str, ...] = ("coalescence", "split")
    boundary_stress: str = "auto"
    stepping: str = "fixed"
    events: tuple[str, ...] | None = None
    longest_step: float | None = None
    control: str = "load"
    skip: bool = True
    repeat: tuple[Repeat, ...] = ()

    def __post_init__(self) -> None:
        unknown = [kind for kind in self.repeat if kind not in REPEATS]
        if unknown:
            raise ValueError(f"repeat is any of {', '.join(map(repr, REPEATS))}, not {unknown[0]!r}")


#: The ``load_edge`` of a problem whose leading load is the weight.
WEIGHT = "gravity"


@dataclass(frozen=True, eq=False)
class Problem:
    """Everything that a run needs.

    joint_of   pair of edge names → index in ``joints``; `joint_index` resolves it
    face_laws  laws of crack faces; the cracks' ``law`` counts in them
    load_edge  name of the edges whose normal traction, or the force that moves their block, is the leading load; or
               `WEIGHT`
    in_situ    stress of the blocks, at rest, before the run
    gauge      two points (reference coordinates, m) and the blocks that carry them, for the axial strain
    endless    not None: the only block, which is fixed, is a window on unbounded rock
    velocity   (n_blocks, 2) m/s at the start; None: at rest
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
        """Kinds of events that end the run: those of ``run.stop_at``, a split of unbounded rock, and a mechanism when
        steps end at events."""
        split = ("split",) if self.endless is not None else ()
        return (*self.run.stop_at, *split, *(("mechanism",) if self.run.stepping == "events" else ()))

    @property
    def inventory(self) -> str:
        """Numbers of blocks and cracks for messages: "3 blocks, 1 crack"."""
        return f"{counted(self.blocks.n_blocks, 'block')}, {counted(self.cracks.n_cracks, 'crack')}"

    def joint_index(self, edge_name: str, other_name: str) -> int:
        """Index of the joint law between two named edges: that of the pair, else of either name, else 0."""
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
                name = self.blocks.names[block]
                raise ValueError(f"{name!r} contains a crack, but its material {material.name!r} is rigid")


def counted(number: int, noun: str) -> str:
    """ "1 block", "2 blocks": for messages."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def duration_text(seconds: float) -> str:
    """A duration as people say it, for messages: 0.071 s, 5.8 s, 45 s, 2.5 min, 12 min, 2 h 5 min."""
    if seconds < 9.95:
        return f"{float(format(seconds, '.2g')):g} s"
    if seconds < 99.5:
        return f"{seconds:.0f} s"
    if seconds < 585.0:
        return f"{round(seconds / 30.0) / 2.0:g} min"
    minutes = round(seconds / 60.0)
    return f"{minutes} min" if minutes < 100 else f"{minutes // 60} h {minutes % 60} min"
