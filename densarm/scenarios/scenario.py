"""Scenario: robot, scene, start, goal and parameters of one run, from TOML or JSON."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from densarm.arms.arm import Arm, load_arm
from densarm.arms.catalogue import scenario_paths
from densarm.arms.description import own_frames
from densarm.arms.pose import Pose
from densarm.certificates.task import PLANTS, Input, SimulationParameters, Task
from densarm.control.controller import Gains
from densarm.control.disturbance_observer import ActuationParameters
from densarm.control.sensing import require_smooth_goal
from densarm.control.speed_law import SpeedParameters
from densarm.control.tracking import TRACKING_GAINS
from densarm.density.goal_distance import TorusDistance, joint_weights
from densarm.density.navigation_density import DensityParameters
from densarm.density.unsafe_sets import SensingParameters
from densarm.errors import DensarmError, FileContentError, InvalidValueError, UnknownNameError
from densarm.planning.goals import candidates, goal_list
from densarm.planning.guide import PlanningParameters
from densarm.planning.motion import TimingParameters
from densarm.scenarios.control import ControlForm, ControlParameters
from densarm.scenarios.goal_values import (
    goals_json,
    read_configuration,
    read_goal,
    read_one_goal,
)
from densarm.scenarios.steps import Step, check_steps, parse_steps
from densarm.scene.loading import parse_scene
from densarm.scene.scene import Scene
from densarm.simulation.disturbances import Disturbances
from densarm.values.arrays import Array
from densarm.values.checks import (
    non_negative_integer,
    one_of,
)
from densarm.values.documented import documented
from densarm.values.files import read_toml
from densarm.values.tables import parse_table
from densarm.world.swept_check import SweptCheck
from densarm.world.world import World


@documented
@dataclass(frozen=True, eq=False)
class Scenario:
    """Everything that determines a run.

    Raises:
        PlanningError: a goal that is no configuration and out of reach, or in collision.
        InvalidValueError: start or goal is not a configuration, the seed is not a whole number,
            weights are not one per joint, the density gives no feedback that settles at a goal, or
            a plant that velocities cannot drive, or disturbances of another arm.
        RobotDescriptionError: torque is to drive an arm with links without a mass.
    """

    name: str
    """What messages and files call it."""
    title: str
    """What pages and pictures say above it."""
    arm: Arm
    """The arm, held bodies among it."""
    scene: Scene
    """The obstacles."""
    start: Array
    """Configuration at the start (nq,); `Arm.configuration` makes one from joint positions."""
    goal: Array
    """Configuration to reach (nq,); it may be given as a `Goal`, and is the nearest of it then."""
    control: ControlParameters = field(default_factory=ControlParameters)
    """Guide, form of control and safety margin."""
    density: DensityParameters = field(default_factory=DensityParameters)
    """The density that feeds back."""
    sensing: SensingParameters = field(default_factory=SensingParameters)
    """From where on it senses obstacles and limits."""
    planning: PlanningParameters = field(default_factory=PlanningParameters)
    """How long and how finely a path is searched."""
    timing: TimingParameters = field(default_factory=TimingParameters)
    """Shares of the limits that a motion may use."""
    speed: SpeedParameters = field(default_factory=SpeedParameters)
    """Shares of the limits that regulation may use."""
    gains: Gains | None = None
    """K_p and K_v; None for those that the form of control has by default."""
    actuation: ActuationParameters = field(default_factory=ActuationParameters)
    """How late torque is, and how far the model is trusted."""
    simulation: SimulationParameters = field(default_factory=SimulationParameters)
    """Time step, time limit and what counts as held or stuck."""
    plant: str = PLANTS[0]
    """What is driven: "pinocchio", the arm's model, or "mujoco", the same in MuJoCo."""
    disturbances: Disturbances = field(default_factory=Disturbances)
    """How it differs from the model."""
    seed: int = 0
    """Seed of every random choice."""
    goals: Sequence[Array | Pose] = ()
    """What `goal` was chosen from, of which any will do: a plan chooses again."""
    steps: Sequence[Step] = ()
    """What is done, one after another, in place of a motion to the goal; see `run_steps`."""
    goal_follows: str = ""
    """Name of the obstacle that the goal keeps to as that moves, a single pose in regulation; empty
    for one at rest."""

    def __post_init__(self) -> None:
        non_negative_integer("seed", self.seed)
        start = self.arm.check_configuration("start configuration", self.start)
        object.__setattr__(self, "start", start)
        goals = goal_list(self.arm, self.goal, "goal configuration")
        if len(goals) > 1 or isinstance(goals[0], Pose):
            object.__setattr__(self, "goals", tuple(goals))
            check, solutions = SweptCheck(self.world, self.control.margin), self.planning.solutions
            margin = self.control.path_margin
            ranked = candidates(check, start, goals, self.seed, solutions, margin)
            object.__setattr__(self, "goal", ranked[0].q)
        else:
            object.__setattr__(self, "goal", goals[0])
        if self.steps:
            object.__setattr__(self, "steps", tuple(self.steps))
            check_steps(self.arm, self.scene, self.steps)
            if self.control.form != ControlForm.TRACKING or self.control.passive_speed is not None:
                allowed = "'tracking' without a passive speed, where there are steps"
                raise InvalidValueError("control.form", str(self.control.form), allowed)
        if self.goal_follows:
            self._require_goal_that_follows()
        self.disturbances.require_fit(self.arm)
        one_of("plant", self.plant, PLANTS)
        joint_weights("density.weights", self.arm, self.density.weights)
        form = self.control.form
        if form != ControlForm.VELOCITY:
            self.arm.require_masses(f"control.form = {str(form)!r}")
        elif self.plant != PLANTS[0] or self.disturbances.of_the_body:
            allowed = "another where plant or disturbances of its body are set, which take torque"
            raise InvalidValueError("control.form", str(form), allowed)
        may_blend = form in {ControlForm.REGULATION, ControlForm.PLAIN}
        require_smooth_goal(self.density, may_blend=may_blend, form=str(form))

    def __repr__(self) -> str:
        return f"Scenario({self.name!r}, {self.arm}, {self.scene})"

    def _require_goal_that_follows(self) -> None:
        name, form = self.goal_follows, self.control.form
        if name not in (obstacles := [item.name for item in self.scene]):
            raise UnknownNameError("obstacle of task.goal_follows", name, obstacles)
        if len(self.goals) != 1 or not isinstance(self.goals[0], Pose):
            raise InvalidValueError("task.goal_follows", name, "left out where the goal is no pose")
        if form != ControlForm.REGULATION:
            allowed = f"'regulation' where the goal follows {name!r}"
            raise InvalidValueError("control.form", str(form), allowed)

    @cached_property
    def world(self) -> World:
        """The arm among the obstacles, made when first asked for."""
        return World(self.arm, self.scene)

    @property
    def moving_goal(self) -> Pose | None:
        """The goal that keeps to an obstacle, where it is at time zero; None for one at rest."""
        goal = self.goals[0] if self.goal_follows else None
        return goal if isinstance(goal, Pose) else None

    def gains_of(self, form: ControlForm) -> Gains:
        """Return K_p and K_v, as given or as a form of control has them by default."""
        return self.gains or (TRACKING_GAINS if form == ControlForm.TRACKING else Gains())

    def require_one_goal(self) -> None:
        """Refuse steps, where one motion to a goal is meant.

        Raises:
            InvalidValueError: it has steps.
        """
        if self.steps:
            allowed = "left out, where one motion to a goal is meant (densarm run does steps)"
            raise InvalidValueError("steps", len(self.steps), allowed)

    @property
    def law_gains(self) -> Gains:
        """K_p and K_v of the scenario's form of control."""
        return self.gains_of(self.control.form)

    @property
    def law_options(self) -> dict[str, Any]:
        """What it asks of tracking and regulation alike, but for V."""
        return {
            "density": self.density,
            "sensing": self.sensing,
            "gains": self.law_gains,
            "actuation": self.actuation,
        }

    @property
    def plan_options(self) -> dict[str, Any]:
        """What it asks of `plan_motion` and `plan_path`, but for the goal."""
        control = self.control
        return {
            "guide": control.guide,
            "margin": control.margin,
            "seed": self.seed,
            "path_margin": control.path_margin,
            "alpha": control.planning_alpha,
            "kappa": control.kappa,
            "density": self.density,
            "sensing": self.sensing,
            "search": self.planning,
        }

    @property
    def goal_distance(self) -> TorusDistance:
        """V of the planning system and of regulation."""
        return TorusDistance(self.arm, self.density.weights, self.control.kappa)

    @property
    def task(self) -> Task:
        """What a run of the scenario is about, its other parameters among the settings."""
        return Task(
            **{key: getattr(self, key) for key in _SHARED},
            margin=self.control.margin,
            kappa=self.control.kappa,
            passive_speed=self.control.passive_speed,
            input=Input.VELOCITY if self.control.form == ControlForm.VELOCITY else Input.TORQUE,
            disturbances=self.disturbances.given,
            settings={
                "seed": self.seed,
                **({"goals": goals_json(self.arm, self.goals)} if self.goals else {}),
                **({"goal_follows": self.goal_follows} if self.goal_follows else {}),
                **{key: asdict(getattr(self, key)) for key in _SETTINGS},
                "gains": asdict(self.law_gains),
            },
        )

    @classmethod
    def of_task(cls, task: Task) -> "Scenario":
        """Return the scenario that a recorded task came from; what it does not say is by default.

        Raises:
            DensarmError: a setting that is not one, or a task without a goal.
        """
        if task.goal is None:
            raise InvalidValueError("goal", None, "given in a scenario")
        settings = task.settings
        own = {key: getattr(task, key) for key in ("margin", "kappa", "passive_speed")}
        control = {**settings.get("control", {}), **own}
        if task.input == Input.VELOCITY:
            control["form"] = ControlForm.VELOCITY
        tables = {**settings, "control": control}
        return cls(
            **{key: getattr(task, key) for key in _SHARED},
            seed=settings.get("seed", 0),
            goal_follows=settings.get("goal_follows", ""),
            goals=tuple(read_one_goal(task.arm, "goals", x) for x in settings.get("goals", ())),
            disturbances=parse_table("disturbances", Disturbances, task.disturbances),
            **{
                key: parse_table(key, TABLES[key], tables.get(key, {}))
                for key in (*_SETTINGS, "gains")
            },
        )


TABLES: Mapping[str, type[Any]] = {
    "control": ControlParameters,
    "density": DensityParameters,
    "sensing": SensingParameters,
    "planning": PlanningParameters,
    "timing": TimingParameters,
    "speed": SpeedParameters,
    "gains": Gains,
    "actuation": ActuationParameters,
    "simulation": SimulationParameters,
    "disturbances": Disturbances,
}
"""The optional tables of a scenario file and what they hold."""

# What a task does not hold itself, beside the gains.
_SETTINGS = ("control", "planning", "timing", "speed", "actuation")
_OF_TASK = ("density", "sensing", "simulation", "plant")
_SHARED = ("name", "title", "arm", "scene", "start", "goal", *_OF_TASK)
_KEYS = {"title", "robot", "scene", "obstacles", "task", "steps", "plant", "seed", *TABLES}


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
    start = read_configuration(arm, "task.start", task.start)
    steps = parse_steps(arm, data["steps"]) if "steps" in data else ()
    if steps and "goal" in data["task"]:
        raise InvalidValueError("task.goal", task.goal, "left out where there are [[steps]]")
    return Scenario(
        name=path.stem,
        title=str(data.get("title", path.stem)),
        arm=arm,
        scene=Scene(scene),
        start=start,
        goal=start if steps else read_goal(arm, "task.goal", task.goal),
        goal_follows=task.goal_follows,
        steps=steps,
        plant=data.get("plant", PLANTS[0]),
        seed=data.get("seed", 0),
        **{
            key: parse_table(key, kind, data.get(key, {}))
            for key, kind in TABLES.items()
            if key != "gains" or key in data
        },
    )


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
    torque_rate: tuple[float, ...] | float | None = None
    jerk: tuple[float, ...] | float | None = None
    armature: tuple[float, ...] | float | None = None
    frames: dict[str, Any] = field(default_factory=dict)
    shapes: str | None = None
    collision_from_visual: str | None = None
    inertia: str | None = None
    density: float | None = None


@dataclass(frozen=True)
class _TaskTable:
    start: str | tuple[float, ...] = ()
    goal: Any = field(default_factory=list)
    goal_follows: str = ""


def _parse_robot(folder: Path, table: _RobotTable) -> Arm:
    given = dict(vars(table))
    name, urdf, srdf, folders = (given.pop(key) for key in ("name", "urdf", "srdf", "package_dirs"))
    if bool(name) == bool(urdf):
        allowed = "a table with either name or urdf"
        raise InvalidValueError("robot", {"name": name, "urdf": urdf}, allowed)
    placement, frames = given.pop("base_placement"), own_frames(given.pop("frames"))
    arm = load_arm(
        name or folder / urdf,
        srdf=folder / srdf if srdf else None,
        package_dirs=[folder / item for item in folders],
        frames=frames,
        **given,
    )
    return arm if placement is None else Arm(replace(arm.description, base_placement=placement))


def with_goal(scenario: Scenario, key: str, value: Any) -> Scenario:
    """Return a scenario with a goal as files have it; errors call it by the key."""
    scenario.require_one_goal()
    return replace(scenario, goal=read_goal(scenario.arm, key, value), goals=())
