"""Scenario: robot, scene, start, goal and parameters of one run, from TOML or JSON."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from enum import StrEnum
from pathlib import Path
from typing import Any

from densarm.arm import Arm, load_arm
from densarm.arrays import Array
from densarm.catalogue import read_toml, scenario_paths
from densarm.control.gains import Gains
from densarm.density import DensityParameters, Gauge
from densarm.density.goal_distance import KAPPA_MIN
from densarm.errors import (
    DensarmError,
    FileContentError,
    InvalidValueError,
    RobotDescriptionError,
    UnknownNameError,
)
from densarm.fields.speed_law import SpeedParameters
from densarm.fields.sub_goal_chain import SensingParameters
from densarm.guides.path import PathGuideParameters
from densarm.reference.timing_parameters import TimingParameters
from densarm.robot.robot_description import RobotDescription
from densarm.scene import Scene
from densarm.scene_files.scene_tables import parse_scene
from densarm.simulation.fixed_step_loop import SimulationParameters
from densarm.tables import parse_table
from densarm.validation import finite_vector, non_negative, non_negative_integer, one_of, positive


class GuideKind(StrEnum):
    """Where the sub-goals come from."""

    PATH = "path"
    """A collision-free path by OMPL."""
    DIRECT = "direct"
    """The goal alone, as in [ZNV]."""


class ControlForm(StrEnum):
    """Which density controller drives the arm."""

    TRACKING = "tracking"
    """Along the timed trajectory of the planning system, [ZNV] eq. 17."""
    REGULATION = "regulation"
    """To the goal by way of the sub-goals, [ZNV] eq. 17 with constant q_d."""
    PLAIN = "plain"
    """u = ∇ρ + d(q, q̇)."""


@dataclass(frozen=True)
class ControlParameters:
    """Which controller, and the guide it follows.

    Raises:
        InvalidValueError: a value out of its range.
    """

    form: ControlForm = ControlForm.TRACKING
    """The controller."""
    guide: GuideKind = GuideKind.PATH
    """The guide, unless the caller names another."""
    margin: float = 0.0
    """Safety margin m: a pair is unsafe at this distance and below [m]."""
    path_margin: float = 0.02
    """Distance that paths keep beyond m, less in narrow spaces and near start and goal [m]."""
    kappa: float = 1.0
    """κ of the goal distance, between product and sum; the plain form has the sum."""
    planning_alpha: float = 10.0
    """α of the planning system where its curve is tracked, so that its direction alone counts.
    The larger, the closer to obstacles ρ leads, and the fewer its spurious maxima: [ZNV] Remark 3
    takes 1 to 10."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "form", ControlForm(one_of("form", self.form, list(ControlForm))))
        object.__setattr__(self, "guide", GuideKind(one_of("guide", self.guide, list(GuideKind))))
        non_negative("margin", self.margin)
        non_negative("path_margin", self.path_margin)
        positive("planning_alpha", self.planning_alpha)
        if not self.kappa >= KAPPA_MIN:
            raise InvalidValueError("kappa", self.kappa, f"a number >= {KAPPA_MIN}, or infinity")


@dataclass(frozen=True, eq=False)
class Scenario:
    """Everything that determines a run.

    Raises:
        InvalidValueError: start or goal is not a configuration, the seed is not a whole number,
            or the density gives no feedback that settles at a goal.
    """

    name: str
    title: str
    arm: Arm
    scene: Scene
    start: Array
    """Configuration at the start (nq,); `Arm.configuration` makes one from joint positions."""
    goal: Array
    """Configuration to reach (nq,)."""
    control: ControlParameters = field(default_factory=ControlParameters)
    density: DensityParameters = field(default_factory=DensityParameters)
    sensing: SensingParameters = field(default_factory=SensingParameters)
    planning: PathGuideParameters = field(default_factory=PathGuideParameters)
    timing: TimingParameters = field(default_factory=TimingParameters)
    speed: SpeedParameters = field(default_factory=SpeedParameters)
    gains: Gains = field(default_factory=Gains)
    simulation: SimulationParameters = field(default_factory=SimulationParameters)
    seed: int = 0
    """Seed of every random choice."""

    def __post_init__(self) -> None:
        for key in ("start", "goal"):
            q = self.arm.check_configuration(f"{key} configuration", getattr(self, key))
            object.__setattr__(self, key, q)
        non_negative_integer("seed", self.seed)
        _check_feedback(self.control.form, self.density)

    def to_json(self) -> dict[str, Any]:
        """Return JSON data that suffices to rebuild the scenario; `from_json` is its inverse."""
        return {
            "format": FORMAT,
            "name": self.name,
            "title": self.title,
            "robot": self.arm.description.to_json(),
            "mesh_sha256": self.arm.mesh_hashes(),
            "obstacles": self.scene.to_json(),
            "start": self.arm.angles(self.start).tolist(),
            "goal": self.arm.angles(self.goal).tolist(),
            "seed": self.seed,
            **{key: asdict(getattr(self, key)) for key in TABLES},
        }

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Scenario:
        """Rebuild a scenario from the data of `to_json`.

        Raises:
            DensarmError: the data is not a scenario, or a mesh file has changed since.
        """
        if not isinstance(data, Mapping) or data.get("format") != FORMAT:
            raise DensarmError(f"scenario: not of format {FORMAT}")
        try:
            arm = Arm(RobotDescription.from_json(data["robot"]))
            scenario = cls(
                name=str(data["name"]),
                title=str(data["title"]),
                arm=arm,
                scene=Scene.from_json(data["obstacles"]),
                start=arm.configuration(data["start"]),
                goal=arm.configuration(data["goal"]),
                seed=data["seed"],
                **{key: parse_table(key, kind, data[key]) for key, kind in TABLES.items()},
            )
            recorded = data["mesh_sha256"]
        except KeyError as error:
            raise DensarmError(f"scenario: the key {error} is missing") from None
        if scenario.arm.mesh_hashes() != recorded:
            raise RobotDescriptionError(
                f"robot {scenario.arm.name!r}: its mesh files have changed since the recording"
            )
        return scenario


FORMAT = 1
"""Version of the JSON form."""

TABLES: Mapping[str, type[Any]] = {
    "control": ControlParameters,
    "density": DensityParameters,
    "sensing": SensingParameters,
    "planning": PathGuideParameters,
    "timing": TimingParameters,
    "speed": SpeedParameters,
    "gains": Gains,
    "simulation": SimulationParameters,
}
"""The optional tables of a scenario file and what they hold."""

_KEYS = {"title", "robot", "scene", "obstacles", "task", "seed", *TABLES}


def load_scenario(scenario: str | Path) -> Scenario:
    """Load a scenario by name or from a TOML file.

    Args:
        scenario: a known name (``densarm list``), or the path of a TOML file.

    Raises:
        UnknownNameError: no such scenario, robot, key or posture.
        InvalidValueError: a value that is not allowed, with its key.
        FileContentError: the file cannot be read, or is not TOML.
    """
    known = scenario_paths()
    path = known.get(str(scenario), Path(scenario))
    if str(scenario) not in known and path.suffix != ".toml" and not path.is_file():
        raise UnknownNameError("scenario", scenario, [*known, "the path of a .toml file"])
    data = read_toml(path)
    try:
        return _parse(path, data)
    except FileContentError:
        raise
    except DensarmError as error:
        raise FileContentError(path, str(error)) from None


def _parse(path: Path, data: dict[str, Any]) -> Scenario:
    for key in data:
        if key not in _KEYS:
            raise UnknownNameError("key", key, _KEYS)
    arm = _parse_robot(path.parent, parse_table("robot", _RobotTable, data.get("robot", {})))
    task = parse_table("task", _TaskTable, data.get("task", {}))
    scene = parse_scene(path.parent, data.get("scene", ""), data.get("obstacles", []))
    arm = arm.holding(*scene.attachments)
    return Scenario(
        name=path.stem,
        title=str(data.get("title", path.stem)),
        arm=arm,
        scene=Scene(scene),
        start=_configuration(arm, "task.start", task.start),
        goal=_configuration(arm, "task.goal", task.goal),
        seed=data.get("seed", 0),
        **{key: parse_table(key, kind, data.get(key, {})) for key, kind in TABLES.items()},
    )


def _check_feedback(form: ControlForm, density: DensityParameters) -> None:
    """Refuse a density whose gradient is singular or flat where the controller needs it.

    Tracking lives at e = 0, where a blend would leave nothing of the obstacles.
    """
    if density.gauge == Gauge.RECIPROCAL and density.alpha == 1.0:
        return
    reason = (
        f"in gauge {str(density.gauge)!r} with alpha = {density.alpha:g}, whose gradient is "
        "singular or flat at the goal (or use gauge 'reciprocal', alpha = 1)"
    )
    if form == ControlForm.TRACKING:
        raise InvalidValueError("control.form", str(form), f"'regulation' or 'plain' {reason}")
    if density.blend_radius == 0.0:
        raise InvalidValueError("density.blend_radius", 0.0, f"above 0 {reason}")


@dataclass(frozen=True)
class _RobotTable:
    name: str = ""
    urdf: str = ""
    srdf: str = ""
    package_dirs: tuple[str, ...] = ()
    joints: tuple[str, ...] | None = None
    locked_joints: dict[str, float] = field(default_factory=dict)
    cut_joints: tuple[str, ...] = ()
    base_placement: tuple[float, float, float, float, float, float, float] | None = None
    acceleration: tuple[float, ...] | None = None
    shapes: str = "hull"
    collision_from_visual: str | None = None


@dataclass(frozen=True)
class _TaskTable:
    start: str | tuple[float, ...] = ()
    goal: str | tuple[float, ...] = ()


def _parse_robot(folder: Path, table: _RobotTable) -> Arm:
    if bool(table.name) == bool(table.urdf):
        raise InvalidValueError(
            "robot", {"name": table.name, "urdf": table.urdf}, "a table with either name or urdf"
        )
    arm = load_arm(
        table.name or folder / table.urdf,
        srdf=folder / table.srdf if table.srdf else None,
        package_dirs=[folder / item for item in table.package_dirs],
        joints=table.joints,
        locked_joints=table.locked_joints,
        cut_joints=table.cut_joints,
        shapes=table.shapes,
        collision_from_visual=table.collision_from_visual,
    )
    changes: dict[str, Any] = {}
    if table.base_placement is not None:
        changes["base_placement"] = table.base_placement
    if table.acceleration is not None:
        changes["acceleration"] = table.acceleration
    return Arm(replace(arm.description, **changes)) if changes else arm


def _configuration(arm: Arm, key: str, value: str | tuple[float, ...]) -> Array:
    if isinstance(value, str):
        if value not in arm.postures:
            raise UnknownNameError(f"posture for {key}", value, arm.postures)
        return arm.postures[value]
    name = f"{key} (one number per joint, or a posture)"
    return arm.configuration(finite_vector(name, value, arm.nv))
