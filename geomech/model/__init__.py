"""Plain arrays that the solvers share: blocks, cracks, materials, joint laws, loads, the state of a run."""

from .blocks import Blocks
from .cracks import Cracks
from .damping import rayleigh_coefficients
from .history import History, Wave, baseline_corrected, read_record
from .joint import JointLaw, Roughness
from .loads import EdgeTraction, LinearProfile, Loads, PointLoad, ViscousBoundary, WaterTable
from .material import Material
from .motion import Motion
from .problem import DdaSettings, DdmSettings, GrowthSettings, Problem, RunSettings, counted
from .state import CONTACT, OPEN, SLIP, STICK, TIP, CrackFaces, Cycle, Event, State

__all__ = [
    "CONTACT",
    "OPEN",
    "SLIP",
    "STICK",
    "TIP",
    "Blocks",
    "CrackFaces",
    "Cracks",
    "Cycle",
    "DdaSettings",
    "DdmSettings",
    "EdgeTraction",
    "Event",
    "GrowthSettings",
    "History",
    "JointLaw",
    "LinearProfile",
    "Loads",
    "Material",
    "Motion",
    "PointLoad",
    "Problem",
    "Roughness",
    "RunSettings",
    "State",
    "ViscousBoundary",
    "WaterTable",
    "Wave",
    "baseline_corrected",
    "counted",
    "rayleigh_coefficients",
    "read_record",
]
