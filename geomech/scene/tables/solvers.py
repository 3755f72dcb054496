"""Settings of the block and crack solvers, of growth and of the run: [dda], [ddm], [growth], [run]."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, Strict, field_validator, model_validator

from ...model import LARGEST_CORNER, SHORTEST_STEP, rayleigh_coefficients
from ...model.problem import Repeat, Stop
from .entries import NotNegative, Pair, Positive, Table


class DdaTable(Table):
    """[dda]: settings of the block solver."""

    time_step_s: Annotated[float, Field(ge=SHORTEST_STEP, allow_inf_nan=False)] = Field(
        1.0, description="longest time step, s"
    )
    automatic_time_step: bool = Field(
        False,
        description="steps grow and shrink below `time_step_s` by displacement and open–close iterations, and in motion by the "
        "energy that the time scheme takes: vibrations that matter are followed in shorter steps",
    )
    dynamic_factor: Annotated[float, Field(ge=0, le=1)] = Field(
        0.0, description="fraction of the velocity carried from step to step: 0 static, 1 dynamic"
    )
    damping: NotNegative = Field(
        0.4,
        description="damping of dynamic steps, as a fraction of the critical one of a block's lowest vibration "
        "(below 0.3 a block that should stick may creep; waves that cross many blocks need less)",
    )
    newmark: Pair | None = Field(
        None,
        description="β and γ of the time scheme: [0.5, 1] is Shi's, [0.25, 0.5] the trapezoidal rule without dissipation "
        "(unset: the latter if the ground moves, edges absorb waves or zones have a given order above 1, which Shi's damps, "
        "otherwise Shi's); "
        "2β ≥ γ ≥ 0.5 and β ≤ γ − 0.25; γ > 0.5 damps and is of first order, `spectral_radius` damps and is of second",
    )
    spectral_radius: Annotated[float, Field(ge=0, le=1)] | None = Field(
        None,
        description="instead of `newmark`: spectral radius at high frequencies of a second-order scheme with "
        "dissipation, 1 (no damping) to 0 (damped in one step)",
    )
    equilibrium: Literal["", "start", "loads"] = Field(
        "",
        description='when static equilibrium is computed, independent of the time step: "" never, "start" before the run begins (in '
        'motion with its cracks open and at rest), "loads" at every load of a static run too; a run ends if there is none, or only one after blocks have moved by '
        "more than a two-thousandth of their size in addition to elastic displacements",
    )
    unbalanced_tolerance: Positive = Field(
        1e-6, description="equilibrium: largest unbalanced force on a block, over the mean force on blocks"
    )
    rayleigh_fractions: Annotated[tuple[NotNegative, NotNegative], Strict(False)] | None = Field(
        None,
        description="Rayleigh damping of dynamic steps: fractions of the critical one at `rayleigh_frequencies_hz`, "
        "in addition to `damping`",
    )
    rayleigh_frequencies_hz: Annotated[tuple[Positive, Positive], Strict(False)] | None = Field(
        None, description="the two frequencies of `rayleigh_fractions`, Hz"
    )
    max_displacement_ratio: Annotated[float, Field(gt=0, le=1)] = Field(
        0.01,
        description="largest displacement in a step, in units of half the diagonal of the domain: the resolution of "
        "motion (the relative motion of neighbouring blocks is limited to a tenth of their size in any "
        "case)",
    )
    normal_penalty_pa: Positive | None = Field(
        None,
        description="stiffness of normal contact springs, Pa (unset: from the stiffness of both blocks and the shape of the face)",
    )
    shear_penalty_pa: Positive | None = Field(
        None, description="stiffness of shear contact springs, Pa (unset: from the normal one)"
    )
    springs: Literal["stiff", "resolved"] = Field(
        "stiff",
        description='"resolved": in motion, unset contact springs are no stiffer than the time step resolves '
        "(100 m/dt², at least E'/2; bonds stay stiff): slopes that move at 5 ms take half the time, and blocks sink by "
        "fractions of a millimetre where they come to rest",
    )
    contact: Literal["penalty", "augmented"] = Field(
        "penalty",
        description='"penalty": springs at the faces of blocks; "augmented": augmented Lagrangian, without '
        "penetration or elastic slip, however soft the springs",
    )
    penetration_tolerance: Annotated[float, Field(gt=0, lt=1)] = Field(
        1e-8,
        description=(
            'tolerance of "augmented" contacts (penetration, elastic slip), in units of the smallest block\'s '
            "size, √area"
        ),
    )
    order_target: Annotated[float, Field(gt=0, le=1)] = Field(
        0.01,
        description='blocks of zones with order = "auto" are raised while the next orders would contain more than this part '
        "of the energy of all such blocks: elastic and kinetic energy, that around their cracks, and friction loss",
    )
    corner_rounding: Annotated[float, Field(ge=0, le=LARGEST_CORNER)] = Field(
        0.01,
        description="length over which two corners that meet are rounded, in units of the smaller block's size, "
        "√area (at most a quarter of the shortest edge there): corners that overlap by less slide over "
        "each other, by more they lock",
    )
    max_open_close_iterations: Annotated[int, Field(ge=1)] = Field(
        60, description="open–close iterations before the time step is cut"
    )
    max_step_cuts: Annotated[int, Field(ge=0)] = Field(12, description="number of cuts of a step before the run fails")

    @field_validator("newmark")
    @classmethod
    def _stable(cls, value):
        beta, gamma = value
        if not 2 * beta >= gamma >= 0.5:
            raise ValueError(
                f"Newmark's β = {beta:g}, γ = {gamma:g} is not unconditionally stable: choose 2β ≥ γ ≥ 0.5"
            )
        if beta > max(gamma - 0.25, 0.5 * gamma) * (1 + 1e-12):
            raise ValueError(
                f"Newmark's β = {beta:g}, γ = {gamma:g} lets blocks that bounce gain energy: choose β ≤ γ − 0.25"
            )
        return value

    @model_validator(mode="after")
    def _damped(self):
        if (self.rayleigh_fractions is None) != (self.rayleigh_frequencies_hz is None):
            raise ValueError("Rayleigh damping takes `rayleigh_fractions` and `rayleigh_frequencies_hz` together")
        if self.rayleigh_fractions is not None:
            rayleigh_coefficients(self.rayleigh_fractions, self.rayleigh_frequencies_hz)
        return self


class DdmTable(Table):
    """[ddm]: settings of the crack solver."""

    target_error: Annotated[float, Field(gt=0, lt=1)] | None = Field(
        None,
        description="target for the relative error of K; order, elements and grading follow from it, every solution "
        "is compared with that of a finer mesh, and a run ends if no mesh meets it",
    )
    order: Annotated[int, Field(ge=0, le=12)] = Field(4, description="polynomial order of the elements")
    nodes: Literal["chebyshev", "gauss", "equal"] = Field("chebyshev", description="collocation points per element")
    elements_per_crack: Annotated[int, Field(ge=1)] = Field(4, description="elements per straight crack")
    elements_per_side: Annotated[int, Field(ge=1)] = Field(6, description="elements per side of a block")
    grading_ratio: Annotated[float, Field(gt=0, lt=1)] = Field(
        0.3, description="ratio of neighbouring elements at kinks, junctions and mouths"
    )
    grading_layers: Annotated[int, Field(ge=0)] = Field(
        2,
        description="layers of that grading; kinks get more, depending on their angle: 2 leave an error of 5e-4 in K, each further layer halves it",
    )
    solver: Literal["auto", "dense", "compressed"] = Field(
        "auto", description="solver of the equations of cracks and sides: factored, or iterative for large numbers"
    )


class GrowthTable(Table):
    """[growth]: how cracks grow."""

    enabled: bool = Field(True, description="false: cracks open and slide without growing")
    criterion: Literal["mts", "g", "s", "f"] = Field(
        "mts",
        description='growth criterion: "mts" maximum tangential stress, "g" maximum energy release rate, "s" minimum '
        'strain-energy density, "f" tension and shear, each against its own toughness',
    )
    increment_m: Positive | None = Field(
        None,
        description="longest advance of a tip in a cycle, m (unset: a tenth of the median crack length, of the shorter one "
        "of two)",
    )
    min_increment_m: Positive | None = Field(None, description="shortest advance, m (unset: a tenth of the longest)")
    join_distance: NotNegative = Field(
        0.5, description="distance below which a tip joins a crack or a surface, in units of the increment"
    )
    join_length_m: Positive | None = Field(
        None,
        description="the same in metres, such as the grain size: loads at which cracks coalesce and cut through then "
        "do not depend on the increment (unset: join_distance)",
    )
    approach_steps: NotNegative = Field(
        0.0,
        description="within this many increments of another crack, all tips of a block use shorter increments, this "
        "many for the remaining distance; with 16, coalescence loads hardly depend on the increment (0: "
        "off)",
    )
    max_passes: Annotated[int, Field(ge=1)] = Field(
        200,
        description="growth passes per load step; in statics the load then waits for tips that still run, for up to "
        "200 passes in all",
    )
    correct: bool = Field(True, description="predictor-corrector growth steps: paths of second order")
    initiation: Literal["", "surface", "everywhere"] = Field(
        "",
        description='where cracks initiate when intact rock reaches its strength: "" nowhere, "surface" on outlines, '
        'holes and crack faces, "everywhere" inside blocks too',
    )
    initiation_distance_m: NotNegative = Field(
        0.0, description="stress is averaged over this distance into the rock, m (0: at the point)"
    )
    initiation_spacing_m: NotNegative = Field(
        0.0, description="least distance between initiating cracks, m (0: five increments)"
    )
    trial_kink_m: NotNegative = Field(
        0.0,
        description='length of the trial kinks of criterion "f" in all directions, with contact and friction of '
        "their faces, m (0: infinitesimal kinks without contact; an increment or less captures shear "
        "cracks under compression)",
    )
    speed_limit: Annotated[float, Field(gt=0, le=1)] = Field(
        0.4,
        description="in dynamic runs, limit of the tip velocity relative to the rock's Rayleigh wave speed, c_R = (0.87 + 1.12 ν)/(1 + ν)"
        " √(μ/ρ) (Viktorov 1967)",
    )


class RunTable(Table):
    """[run]: duration of a run, and its stop events."""

    end_time_s: Positive = Field(description="end time of the run, s")
    stop_at: Annotated[tuple[Stop, ...], Strict(False)] = Field(
        ("coalescence", "split"),
        description="the run ends at the first event of these kinds; a mechanism occurs when blocks of a static run "
        'slide or rotate without limit, and always ends stepping "events". Of the contacts of two '
        "blocks, or the faces of a crack, the first to open is an opening, the last a parting; the first "
        "to slip is a slip, the last a sliding; a contact that closes is a closure, one that sticks "
        'again a stick, a lost bond a debonding: these need stepping "events", or run.events',
    )
    stepping: Literal["fixed", "events"] = Field(
        "fixed",
        description='static load steps: "fixed", of `dda.time_step_s`; "events": they end exactly at the load at '
        "which a tip reaches its toughness, and are otherwise as long as the allowed motion of blocks "
        "permits",
    )
    events: Annotated[tuple[Literal["tips", "contacts", "faces"], ...], Strict(False)] | None = Field(
        None,
        description='where steps of stepping "events" end, also listed in events.csv: tips that reach their toughness (always), crack '
        "faces and contacts of blocks that open, close, slip, stick or lose their bond; loads are exact, with more than a hundred "
        "contacts to 1e-3, and changes in rapid succession are combined (unset: tips and faces, and contacts of up to 30 blocks). "
        "Fixed and dynamic steps list contacts and faces, too, at the end of their step (unset: they do not)",
    )
    longest_step_s: Positive | None = Field(
        None,
        description='longest step of stepping "events", s (unset: limited by the motion of blocks only); loads at '
        "events do not depend on it, the friction work on crack faces is accurate to a step",
    )
    control: Literal["load", "toughness"] = Field(
        "load",
        description='"load": loads and imposed motion follow their histories; "toughness": every increment of growth '
        "is made at the load at which the most heavily loaded tip has K_eq = K_Ic, even if that is lower than "
        "before (time, as the argument of the loads, decreases with them)",
    )
    boundary_stress: Literal["auto", "contacts", "bases", "springs", "kelvin-springs"] = Field(
        "auto",
        description='how contact forces load cracked blocks of order 1: "auto", linear over each face, but on fixed, guided and rigid '
        "blocks as on a straight rigid base without tension, other than between two of these as platens of a specimen at least as tall "
        'as wide; "bases", the same between platens, too; "contacts", linear over each face (for comparison, as the following); '
        '"springs", as point forces at the springs; "kelvin-springs", as Kelvin\'s point forces of the infinite '
        "plane (for comparison: most of a force is then lost)",
    )
    skip: bool = Field(
        True,
        description="reuse everything that has not changed since the last pass (false: recompute it, for comparison; "
        "the results are the same, but for K of moving blocks with friction far from their toughness)",
    )
    repeat: Annotated[tuple[Repeat, ...], Strict(False)] = Field(
        (),
        description='repeat the finished run with one change at a time, and state by how much the results differ: "noise" of '
        '1e-12 of the model on all coordinates; "steps" half as large; growth "increment" half as long; twice as many '
        '"elements". Each costs another run or more',
    )
