"""Steps: what a task is made of, in Python and TOML, and which of them follow from others."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from densarm.arms.arm import Arm
from densarm.arms.description import RobotDescription
from densarm.arms.joints import followed, without_mimics
from densarm.arms.line import Line
from densarm.arms.models import frame_index
from densarm.arms.pose import Pose
from densarm.arms.upright import TILT, checked_tilt
from densarm.errors import InvalidValueError, UnknownNameError
from densarm.planning.goals import Goal, goal_list
from densarm.planning.way_points import BLEND, checked_blend
from densarm.scenarios.goal_values import read_goal
from densarm.scene.obstacles import HalfSpace, Obstacle
from densarm.scene.scene import Scene
from densarm.values.checks import finite_number, non_negative, positive
from densarm.values.documented import documented
from densarm.values.tables import parse_table


@documented
@dataclass(frozen=True, eq=False)
class MoveTo:
    """Go to a goal, and of several to one from which the lines that follow can be gone.

    Raises:
        InvalidValueError: a blend or tilt that is not a number in its range.
    """

    goal: Goal
    """A configuration, a pose, or a list of these, of which any will do."""
    through: Goal | None = None
    """Way points: configurations and poses that it passes one after another without a stop."""
    blend: float = BLEND
    """How far off each joint may be where it passes one, at least 0.01 [rad or m]."""
    upright: str | None = None
    """Name of a frame, of which what points up at the start stays up on the way."""
    tilt: float = TILT
    """How far that may tilt, 0.01 to π/2 [rad]."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "blend", checked_blend(self.blend))
        object.__setattr__(self, "tilt", checked_tilt(self.tilt))

    def __str__(self) -> str:
        passing = "" if self.through is None else ", through way points"
        if isinstance(self.goal, Pose):
            where = ", ".join(f"{x:.4g}" for x in self.goal.position)
            return f"move {self.goal.frame!r} to ({where}) m{passing}"
        return f"move to a goal{passing}"


@documented
@dataclass(frozen=True)
class Grip:
    """Move joints of a gripper, which are locked otherwise, while the arm rests."""

    joints: Mapping[str, float]
    """Position of each [rad or m]; those that mimic one of them go with it."""

    def __str__(self) -> str:
        where = ", ".join(f"{name} {x:.4g}" for name, x in self.joints.items())
        return f"grip: {where}"


@documented
@dataclass(frozen=True)
class Attach:
    """Take an obstacle: a part of the arm from here on, where it is, with its mass.

    Raises:
        InvalidValueError: a mass that is not a finite number >= 0.
    """

    body: str
    """Name of the obstacle."""
    link: str
    """Link, or other frame, that holds it."""
    mass: float = 0.0
    """Its mass [kg]; 0 leaves it out of the dynamics."""
    support: str | None = None
    """Obstacle that it stands on, which it may touch in the line that follows, but not enter."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "mass", non_negative("mass", self.mass))

    def __str__(self) -> str:
        return f"attach {self.body!r} to {self.link!r}"


@documented
@dataclass(frozen=True)
class Detach:
    """Put a held body down: an obstacle from here on, where it is. Nothing falls."""

    body: str
    """Its name."""
    support: str | None = None
    """Obstacle that it is put on, which it may touch in the line before, but not enter."""

    def __str__(self) -> str:
        return f"detach {self.body!r}"


@documented
@dataclass(frozen=True)
class Wait:
    """Rest.

    Raises:
        InvalidValueError: a time that is not positive.
    """

    seconds: float
    """For how long [s]."""

    def __post_init__(self) -> None:
        positive("wait", self.seconds)

    def __str__(self) -> str:
        return f"wait {self.seconds:g} s"


Step = MoveTo | Line | Grip | Attach | Detach | Wait
"""What can be done."""


def require_step(name: str, step: object) -> Step:
    """Return a step; errors call it by a name.

    Raises:
        InvalidValueError: it is none.
    """
    if not isinstance(step, Step):
        raise InvalidValueError(name, step, "a MoveTo, Line, Grip, Attach, Detach or Wait")
    return step


def parse_steps(arm: Arm, tables: Any) -> tuple[Step, ...]:
    """Return the steps of tables of TOML, each of one key: what is done, with its value.

    A move has those of its way points besides.

    Raises:
        DensarmError: a step that is none, with its number and key.
    """
    if not isinstance(tables, list) or not tables:
        raise InvalidValueError("steps", tables, "tables [[steps]]")
    found = []
    for k, table in enumerate(tables):
        try:
            found.append(_parsed(arm, f"steps[{k}]", table))
        except InvalidValueError as error:
            inside = error.name.startswith("steps[")
            name = error.name if inside else f"steps[{k}].{error.name}"
            raise InvalidValueError(name, error.value, error.allowed) from None
    return tuple(found)


def _parsed(arm: Arm, name: str, table: Any) -> Step:
    if isinstance(table, Mapping) and "move_to" in table:
        return _move(arm, name, parse_table(name, _MoveTable, table))
    if not isinstance(table, Mapping) or len(table) != 1:
        raise InvalidValueError(name, table, f"a table of one key of {', '.join(_KEYS)}")
    ((key, value),) = table.items()
    if key not in _KEYS:
        raise UnknownNameError(f"key of {name}", key, _KEYS)
    name = f"{name}.{key}"
    if key == "line":
        to = value.get("to") if isinstance(value, Mapping) else None
        if not isinstance(to, Mapping):
            return Line(**asdict(parse_table(name, _LineTable, value)))
        given = asdict(parse_table(name, _LineTable, {**value, "to": None}))
        pose = Pose.of_table(f"{name}.to", {"frame": given["frame"], **to})
        return Line(**{**given, "to": pose})
    if key == "wait":
        return Wait(finite_number(name, value))
    if key == "detach" and isinstance(value, str):
        value = {"body": value}
    if key == "grip":
        return parse_table(name, Grip, {"joints": value})
    return parse_table(name, Attach, value) if key == "attach" else parse_table(name, Detach, value)


def _move(arm: Arm, name: str, table: "_MoveTable") -> MoveTo:
    goal, through = read_goal(arm, f"{name}.move_to", table.move_to), None
    if table.through is not None:
        through = read_goal(arm, f"{name}.through", table.through)
    return MoveTo(goal, through, table.blend, table.upright, table.tilt)


_KEYS = ("move_to", "line", "grip", "attach", "detach", "wait")


@dataclass(frozen=True)
class _MoveTable:
    move_to: Any
    through: Any = None
    blend: float = BLEND
    upright: str | None = None
    tilt: float = TILT


@dataclass(frozen=True)
class _LineTable:
    frame: str = ""
    to: tuple[float, ...] | None = None
    by: tuple[float, ...] | None = None
    along: tuple[float, ...] | None = None


def check_steps(arm: Arm, scene: Scene, steps: Sequence[Step]) -> None:
    """Refuse steps that cannot follow one another, whatever the motions between are.

    Raises:
        UnknownNameError: a body, frame or joint that there is not.
        InvalidValueError: a body taken that is held, or put down that is not, an obstacle that
            moves or has no end, nothing after the last change, or a goal that is none.
    """
    bodies = {item.name: item for item in scene}
    held = {item.body.name: item.body for item in arm.description.attachments}
    if moving := [item.name for item in scene if item.motion is not None]:
        raise InvalidValueError("steps", moving, "without obstacles that move")
    for k, step in enumerate(steps):
        name = f"steps[{k}]"
        require_step(name, step)
        if isinstance(step, Attach | Detach):
            _exchange(name, step, bodies, held)
        if isinstance(step, Line | Attach):
            frame = step.frame if isinstance(step, Line) else step.link
            frame_index(arm.model, frame, f"frame of {name}")
        if isinstance(step, Grip):
            gripper_positions(arm.description, step)
        if isinstance(step, MoveTo):
            _check_move(arm, name, step)
    if isinstance(steps[-1], Attach | Detach):
        allowed = "one that takes time, a retreat or a wait, so that what it leaves is recorded"
        raise InvalidValueError("last of steps", str(steps[-1]), allowed)


def _check_move(arm: Arm, name: str, step: MoveTo) -> None:
    ways = [] if step.through is None else goal_list(arm, step.through, f"{name}.through")
    poses = [x for x in (*goal_list(arm, step.goal, name), *ways) if isinstance(x, Pose)]
    for frame in [*(pose.frame for pose in poses), step.upright]:
        if frame is not None:
            frame_index(arm.model, frame, f"frame of {name}")


def _exchange(
    name: str, step: Attach | Detach, bodies: dict[str, Obstacle], held: dict[str, Obstacle]
) -> None:
    """Take a body from those that stand to those that are held, or back."""
    takes, body = isinstance(step, Attach), step.body
    key = f"{name}.{'attach' if takes else 'detach'}"
    source, other = (bodies, held) if takes else (held, bodies)
    if body in other:
        allowed = "a body that is not held yet" if takes else f"one of the held: {_listed(held)}"
        raise InvalidValueError(key, body, allowed)
    if body not in source:
        raise UnknownNameError(f"body of {key}", body, source)
    if isinstance(source[body], HalfSpace):
        raise InvalidValueError(key, body, "a body that has an end")
    other[body] = source.pop(body)
    if step.support is not None and step.support not in bodies:
        raise UnknownNameError(f"support of {key}", step.support, bodies)


def _listed(names: Iterable[str]) -> str:
    return ", ".join(names) or "none"


def gripper_positions(description: RobotDescription, grip: Grip) -> dict[str, float]:
    """Return the positions that a grip leads joints to, those that mimic others too [rad or m].

    Raises:
        UnknownNameError: a joint that is not locked.
    """
    locked = without_mimics(description).locked_joints
    for name in grip.joints:
        if name not in locked:
            raise UnknownNameError("joint of a gripper", name, locked)
    return {j: x for j, x in followed(description, grip.joints).items() if j in locked}


def touching(steps: Sequence[Step], k: int) -> dict[str, str]:
    """Return what held bodies may touch in a line: what they stand on before or after it."""
    before, after = steps[k - 1] if k else None, steps[k + 1] if k + 1 < len(steps) else None
    changes: list[Attach | Detach] = [before] if isinstance(before, Attach) else []
    changes += [after] if isinstance(after, Detach) else []
    return {step.body: step.support for step in changes if step.support is not None}
