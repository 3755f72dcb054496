"""Discontinuous deformation analysis: blocks that move, deform and slide along joints.

`BlockSystem.step` moves a `State` by one time step; `run` does it until an end time. Stands alone::

    rock, joint = Material("rock", 10e9, 0.25, density=2600.0), JointLaw("joint", friction_angle=0.6)
    loads = Loads(gravity=History.constant([0.0, -9.81]))
    for state in dda.run(blocks, [rock], [joint], loads, DdaSettings(time_step=1e-3, dynamic_factor=1.0), end_time=1.0):
        ...
"""

from .basis import displacement_matrix
from .design_strength import PartialFactors, design_problem
from .elastic_range import ElasticRange
from .energy import EnergyBudget, StepEnergy
from .equilibrium import RELAXATION_STEP, Equilibrium, equilibrium
from .force_rows import EDGE_FORCE, POINT_FORCE
from .in_situ import InSituState, NoInSituEquilibrium, in_situ_state
from .loads import AppliedForces
from .mobilised import MobilisedJoint, mobilised_joints
from .moments import block_moments, mass_matrix
from .running import run
from .step import CrackResponse, NotConverged, StepResult, contact_resultants
from .step_length import StepLength
from .safety_answer import FactorOfSafety
from .strength_reduction import NothingToReduce, factor_of_safety
from .system import BlockSystem
from .time_integration import TimeScheme
from .told_contacts import ToldContacts
from .work import Work

__all__ = [
    "EDGE_FORCE",
    "POINT_FORCE",
    "RELAXATION_STEP",
    "AppliedForces",
    "BlockSystem",
    "CrackResponse",
    "ElasticRange",
    "EnergyBudget",
    "Equilibrium",
    "FactorOfSafety",
    "InSituState",
    "MobilisedJoint",
    "NoInSituEquilibrium",
    "NotConverged",
    "NothingToReduce",
    "PartialFactors",
    "StepEnergy",
    "StepLength",
    "StepResult",
    "TimeScheme",
    "ToldContacts",
    "Work",
    "block_moments",
    "contact_resultants",
    "design_problem",
    "displacement_matrix",
    "equilibrium",
    "factor_of_safety",
    "in_situ_state",
    "mass_matrix",
    "mobilised_joints",
    "run",
]
