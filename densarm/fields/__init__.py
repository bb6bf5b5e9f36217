"""Planning systems: fields q̇ = k(q), their speed, and the sub-goals that lead them."""

from densarm.fields.density_field import DensityField
from densarm.fields.guided_density import GuidedDensity
from densarm.fields.planning_system import PlannedCurve, PlanningSystem
from densarm.fields.speed_law import SpeedLaw, SpeedParameters
from densarm.fields.sub_goal_chain import SensingParameters, SubGoalChain

__all__ = [
    "DensityField",
    "GuidedDensity",
    "PlannedCurve",
    "PlanningSystem",
    "SensingParameters",
    "SpeedLaw",
    "SpeedParameters",
    "SubGoalChain",
]
