"""Collision-free motion of robot arms by navigation density functions.

Every name is imported when it is first used, so that ``import densarm`` is quick.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from densarm.arm import Arm, JointLimits, load_arm
    from densarm.attachment import Attachment
    from densarm.certificates.certificate import Certificate, Check
    from densarm.clearance import Clearance, ClearanceSample
    from densarm.closed_loop import make_controller, make_velocity_controller, simulate
    from densarm.control.controller import Controller
    from densarm.control.density_feedback import DensityFeedback
    from densarm.control.density_tracking import DensityTracking
    from densarm.control.field_regulation import FieldRegulation
    from densarm.control.field_velocity import FieldVelocity
    from densarm.control.gains import Gains
    from densarm.control.guard_status import GuardStatus, GuardWord
    from densarm.control.guard_tolerances import GuardTolerances
    from densarm.control.guarded_controller import GuardedController
    from densarm.control.velocity_controller import VelocityController
    from densarm.density.gauge import Gauge
    from densarm.density.goal_distance import EuclideanDistance, ProductDistance, TorusDistance
    from densarm.density.navigation_density import (
        DensityParameters,
        DensitySample,
        NavigationDensity,
    )
    from densarm.density.near_clearance_set import NearClearanceSet
    from densarm.density.near_pairs import NearPairs
    from densarm.density.unsafe_set import ClearanceSet, ImplicitSet, JointLimitSet
    from densarm.errors import (
        DensarmError,
        FileContentError,
        InvalidValueError,
        RobotDescriptionError,
        SceneChangedError,
        UnknownNameError,
    )
    from densarm.fields.speed_law import SpeedParameters
    from densarm.fields.sub_goal_chain import SensingParameters
    from densarm.guides.direct import DirectGuide
    from densarm.guides.guide import Guide, GuidePath, NoPath
    from densarm.guides.path import PathGuide, PathGuideParameters
    from densarm.mesh import Mesh
    from densarm.motion_plan import MotionPlan, plan_motion
    from densarm.obstacles import Box, Capsule, Cylinder, HalfSpace, Sphere
    from densarm.outcome import Outcome
    from densarm.proof.swept_bound import SweptBound
    from densarm.proof.swept_check import SweptCheck
    from densarm.reference.reference import Reference
    from densarm.reference.timing_parameters import TimingParameters
    from densarm.rigid_body import Freedom, free_body
    from densarm.robot.robot_description import RobotDescription
    from densarm.scenario import (
        ControlForm,
        ControlParameters,
        GuideKind,
        Scenario,
        load_scenario,
    )
    from densarm.scene import Scene
    from densarm.scene_files import MotionProblem, load_problems, load_scene
    from densarm.simulation.fixed_step_loop import FixedStepLoop, SimulationParameters
    from densarm.simulation.plant import Integrator, PinocchioPlant
    from densarm.simulation.single_integrator import SingleIntegrator
    from densarm.trajectory import Trajectory
    from densarm.visualization.picture_file import save_animation, save_picture
    from densarm.visualization.plots import save_plot
    from densarm.visualization.view import save_html, view

    __version__: str

__all__ = [
    "Arm",
    "Attachment",
    "Box",
    "Capsule",
    "Certificate",
    "Check",
    "Clearance",
    "ClearanceSample",
    "ClearanceSet",
    "ControlForm",
    "ControlParameters",
    "Controller",
    "Cylinder",
    "DensarmError",
    "DensityFeedback",
    "DensityParameters",
    "DensitySample",
    "DensityTracking",
    "DirectGuide",
    "EuclideanDistance",
    "FieldRegulation",
    "FieldVelocity",
    "FileContentError",
    "FixedStepLoop",
    "Freedom",
    "Gains",
    "Gauge",
    "GuardStatus",
    "GuardTolerances",
    "GuardWord",
    "GuardedController",
    "Guide",
    "GuideKind",
    "GuidePath",
    "HalfSpace",
    "ImplicitSet",
    "Integrator",
    "InvalidValueError",
    "JointLimitSet",
    "JointLimits",
    "Mesh",
    "MotionPlan",
    "MotionProblem",
    "NavigationDensity",
    "NearClearanceSet",
    "NearPairs",
    "NoPath",
    "Outcome",
    "PathGuide",
    "PathGuideParameters",
    "PinocchioPlant",
    "ProductDistance",
    "Reference",
    "RobotDescription",
    "RobotDescriptionError",
    "Scenario",
    "Scene",
    "SceneChangedError",
    "SensingParameters",
    "SimulationParameters",
    "SingleIntegrator",
    "SpeedParameters",
    "Sphere",
    "SweptBound",
    "SweptCheck",
    "TimingParameters",
    "TorusDistance",
    "Trajectory",
    "UnknownNameError",
    "VelocityController",
    "__version__",
    "free_body",
    "load_arm",
    "load_problems",
    "load_scenario",
    "load_scene",
    "make_controller",
    "make_velocity_controller",
    "plan_motion",
    "save_animation",
    "save_html",
    "save_picture",
    "save_plot",
    "simulate",
    "view",
]

_NAMES = {
    "arm": ("Arm", "JointLimits", "load_arm"),
    "attachment": ("Attachment",),
    "certificates.certificate": ("Certificate", "Check"),
    "clearance": ("Clearance", "ClearanceSample"),
    "control.controller": ("Controller",),
    "control.density_feedback": ("DensityFeedback",),
    "control.density_tracking": ("DensityTracking",),
    "control.field_regulation": ("FieldRegulation",),
    "control.field_velocity": ("FieldVelocity",),
    "control.gains": ("Gains",),
    "control.guard_status": ("GuardStatus", "GuardWord"),
    "control.guard_tolerances": ("GuardTolerances",),
    "control.guarded_controller": ("GuardedController",),
    "control.velocity_controller": ("VelocityController",),
    "density.gauge": ("Gauge",),
    "density.goal_distance": ("EuclideanDistance", "ProductDistance", "TorusDistance"),
    "density.navigation_density": ("DensityParameters", "DensitySample", "NavigationDensity"),
    "density.unsafe_set": ("ClearanceSet", "ImplicitSet", "JointLimitSet"),
    "density.near_clearance_set": ("NearClearanceSet",),
    "density.near_pairs": ("NearPairs",),
    "errors": (
        "DensarmError",
        "FileContentError",
        "InvalidValueError",
        "RobotDescriptionError",
        "SceneChangedError",
        "UnknownNameError",
    ),
    "fields.speed_law": ("SpeedParameters",),
    "fields.sub_goal_chain": ("SensingParameters",),
    "rigid_body": ("Freedom", "free_body"),
    "guides.direct": ("DirectGuide",),
    "guides.guide": ("Guide", "GuidePath", "NoPath"),
    "guides.path": ("PathGuide", "PathGuideParameters"),
    "mesh": ("Mesh",),
    "motion_plan": ("MotionPlan", "plan_motion"),
    "obstacles": ("Box", "Capsule", "Cylinder", "HalfSpace", "Sphere"),
    "outcome": ("Outcome",),
    "reference.reference": ("Reference",),
    "reference.timing_parameters": ("TimingParameters",),
    "robot.robot_description": ("RobotDescription",),
    "scenario": ("ControlForm", "ControlParameters", "GuideKind", "Scenario", "load_scenario"),
    "scene": ("Scene",),
    "scene_files": ("MotionProblem", "load_problems", "load_scene"),
    "closed_loop": ("make_controller", "make_velocity_controller", "simulate"),
    "simulation.fixed_step_loop": ("FixedStepLoop", "SimulationParameters"),
    "simulation.plant": ("Integrator", "PinocchioPlant"),
    "simulation.single_integrator": ("SingleIntegrator",),
    "proof.swept_bound": ("SweptBound",),
    "proof.swept_check": ("SweptCheck",),
    "trajectory": ("Trajectory",),
    "visualization.picture_file": ("save_animation", "save_picture"),
    "visualization.plots": ("save_plot",),
    "visualization.view": ("save_html", "view"),
}
_MODULE_OF = {name: module for module, names in _NAMES.items() for name in names}


def __getattr__(name: str) -> Any:
    if name == "__version__":
        value: Any = _version()
    elif name in _MODULE_OF:
        value = getattr(import_module(f"densarm.{_MODULE_OF[name]}"), name)
    else:
        raise AttributeError(f"module 'densarm' has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


def _version() -> str:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("densarm")
    except PackageNotFoundError:
        return "0+checkout"
