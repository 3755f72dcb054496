"""Plain arrays that the solvers share: blocks, cracks, materials, joint laws, loads, the state of a run."""

from .blocks import Blocks
from .bolt import BOLT, GROUND, Bolt, CrossesNoJoint, grouted_bolt
from .corners import corner_lengths
from .cracks import Cracks
from .damping import rayleigh_coefficients
from .endless import EndlessRock, Fluid
from .history import History, Wave, baseline_corrected, read_record
from .imposed_motion import UNKNOWNS, BaseMotion, BlockMotion, PointMotion
from .in_situ import InSituStress
from .joint import JointLaw, Roughness
from .loads import EdgeTraction, Excavation, LinearProfile, Loads, PointLoad, ViscousBoundary, WaterTable
from .material import Material
from .motion import Motion
from .problem import (
    CHANGES,
    LARGEST_CORNER,
    STOPS,
    WEIGHT,
    DdaSettings,
    DdmSettings,
    GrowthSettings,
    Problem,
    RunSettings,
    counted,
)  # fmt: skip
from .state import CONTACT, OPEN, SLIP, STICK, TIP, CrackFaces, Cycle, Event, Shortened, Skip, State
from .whole_network import whole_network

__all__ = [
    "BOLT",
    "CHANGES",
    "CONTACT",
    "GROUND",
    "LARGEST_CORNER",
    "OPEN",
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
    "grouted_bolt",
    "rayleigh_coefficients",
    "read_record",
    "whole_network",
]
