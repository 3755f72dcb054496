"""Records that all solvers share: blocks, cracks, materials, joint laws, loads, settings, and the state of a run."""

from .blocks.block_arrays import AUTO_ORDER, HIGHEST_ORDER, Blocks
from .blocks.block_motion import Motion
from .blocks.corners import corner_lengths
from .contact_solver import ContactSolver
from .cracks.crack_arrays import Cracks
from .cracks.whole_network import whole_network
from .joints.bolt import BOLT, GROUND, Bolt, CrossesNoJoint, grouted_bolt
from .joints.joint_law import JointLaw, Joints, Roughness
from .loads.applied_loads import (
    EdgeTraction,
    Excavation,
    LinearProfile,
    Loads,
    PointLoad,
    ViscousBoundary,
    WaterTable,
)
from .loads.damping import rayleigh_coefficients
from .loads.history import History, Wave, baseline_corrected, read_record
from .loads.in_situ import InSituStress
from .loads.prescribed_motion import UNKNOWNS, BaseMotion, BlockMotion, PointMotion
from .material import Material
from .problem import (
    CHANGES,
    LARGEST_CORNER,
    REPEATS,
    SHORTEST_STEP,
    STOPS,
    WEIGHT,
    DdaSettings,
    DdmSettings,
    GrowthSettings,
    Problem,
    RunSettings,
    counted,
    duration_text,
)  # fmt: skip
from .state import CONTACT, FACE_POINT, OPEN, RESTS, SLIP, STICK, TIP, CrackFaces, Cycle, Event, Shortened, Skip, State
from .unbounded_rock import EndlessRock, Fluid

__all__ = [
    "AUTO_ORDER",
    "BOLT",
    "CHANGES",
    "CONTACT",
    "FACE_POINT",
    "GROUND",
    "HIGHEST_ORDER",
    "LARGEST_CORNER",
    "OPEN",
    "REPEATS",
    "RESTS",
    "SHORTEST_STEP",
    "SLIP",
    "STICK",
    "STOPS",
    "TIP",
    "UNKNOWNS",
    "WEIGHT",
    "BaseMotion",
    "BlockMotion",
    "Blocks",
    "Bolt",
    "ContactSolver",
    "CrackFaces",
    "Cracks",
    "CrossesNoJoint",
    "Cycle",
    "DdaSettings",
    "DdmSettings",
    "EdgeTraction",
    "EndlessRock",
    "Event",
    "Excavation",
    "Fluid",
    "GrowthSettings",
    "History",
    "InSituStress",
    "JointLaw",
    "Joints",
    "LinearProfile",
    "Loads",
    "Material",
    "Motion",
    "PointLoad",
    "PointMotion",
    "Problem",
    "Roughness",
    "RunSettings",
    "Shortened",
    "Skip",
    "State",
    "ViscousBoundary",
    "WaterTable",
    "Wave",
    "baseline_corrected",
    "corner_lengths",
    "counted",
    "duration_text",
    "grouted_bolt",
    "rayleigh_coefficients",
    "read_record",
    "whole_network",
]
