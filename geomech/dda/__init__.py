"""Discontinuous deformation analysis: blocks that move, deform and slide along joints.

`BlockSystem.step` moves a `State` by one time step, and `run` repeats steps until an end time. The package can be used
alone::

    rock, joint = Material("rock", 10e9, 0.25, density=2600.0), JointLaw("joint", friction_angle=0.6)
    loads = Loads(gravity=History.constant([0.0, -9.81]))
    for state in dda.run(blocks, [rock], [joint], loads, DdaSettings(time_step=1e-3, dynamic_factor=1.0), end_time=1.0):
        ...
"""

from ..model.former_names import renamed_exports
from .contact_detection.inherited_contacts import InheritedContacts
from .counters import Work
from .energy_balance import EnergyBudget, StepEnergy
from .kinematics.displacement_matrix import displacement_matrix
from .kinematics.newmark import TimeScheme
from .kinematics.simplex_integration import block_moments, mass_matrix
from .kinematics.strain_limits import ElasticRange
from .loads.force_records import EDGE_FORCE, POINT_FORCE
from .loads.load_vectors import AppliedForces
from .results import CrackResponse, NotConverged, StepResult, contact_resultants
from .statics.counted_resistance import warn_of_toes, warn_of_toes_at_rest
from .statics.in_situ_stress import InSituState, NoInSituEquilibrium, in_situ_state
from .statics.mobilised_strength import MobilisedJoint, mobilised_joints
from .statics.partial_factors import PartialFactors, design_problem
from .statics.pseudo_time_equilibrium import RELAXATION_STEP, Equilibrium, RelaxationLimits, equilibrium
from .statics.safety_answer import FactorOfSafety
from .statics.strength_reduction import FactorSearch, NothingToReduce, factor_of_safety
from .step_control.adaptive_time_step import StepLength
from .stepping import run
from .system import BlockSystem

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
    "FactorSearch",
    "InSituState",
    "InheritedContacts",
    "MobilisedJoint",
    "NoInSituEquilibrium",
    "NotConverged",
    "NothingToReduce",
    "PartialFactors",
    "RelaxationLimits",
    "StepEnergy",
    "StepLength",
    "StepResult",
    "TimeScheme",
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
    "warn_of_toes",
    "warn_of_toes_at_rest",
]

__getattr__ = renamed_exports(__name__, {"ToldContacts": "InheritedContacts"}, globals())
