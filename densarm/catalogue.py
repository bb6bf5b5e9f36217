"""The catalogue of named robots and scenarios: the folder ``robots/``."""

import tomllib
from pathlib import Path
from typing import Any

from densarm.errors import FileContentError, UnknownNameError
from densarm.robot.robot_description import DATA_WHEEL, RobotDescription, read_text, resolve_path


def robots_folder() -> Path:
    """Return the folder of robots: inside the installed package, or beside a checkout's."""
    package = Path(__file__).resolve().parent
    inside = package / "robots"
    return inside if inside.is_dir() else package.parent / "robots"


def robot_names() -> list[str]:
    """Return the names that `load_arm` knows."""
    return sorted(path.parent.name for path in robots_folder().glob("*/arm.toml"))


def scenario_paths() -> dict[str, Path]:
    """Return the scenarios that `load_scenario` knows: name to TOML file."""
    return {path.stem: path for path in sorted(robots_folder().glob("*/scenarios/*.toml"))}


def robot_description(robot: str | Path) -> RobotDescription:
    """Return the description of a robot.

    Args:
        robot: one of `robot_names`, or the path of a URDF.

    Raises:
        UnknownNameError: no such robot.
        FileContentError: the file cannot be read.
    """
    path = Path(robot)
    if str(robot) in robot_names():
        return _named_robot(str(robot))
    if path.suffix != ".urdf" and not path.is_file():
        raise UnknownNameError("robot", robot, [*robot_names(), "the path of a .urdf file"])
    folder = path.resolve().parent
    nearby = tuple(str(above) for above in (folder, *folder.parents))
    return RobotDescription(name=path.stem, urdf=read_text(path), package_dirs=nearby)


def _named_robot(name: str) -> RobotDescription:
    folder = robots_folder() / name
    entry = read_toml(folder / "arm.toml")
    urdf = entry["urdf"]
    srdf = entry.get("srdf")
    acceleration = entry.get("acceleration")
    return RobotDescription(
        name=name,
        urdf=read_text(resolve_path(urdf, folder)),
        srdf=None if srdf is None else read_text(resolve_path(srdf, folder)),
        package_dirs=(DATA_WHEEL,) if DATA_WHEEL in urdf else (str(folder),),
        locked_joints=entry.get("locked_joints", {}),
        acceleration=None if acceleration is None else tuple(acceleration),
        end_effector=entry.get("end_effector"),
        collision_from_visual=entry.get("collision_from_visual", "missing"),
        postures={key: tuple(value) for key, value in entry.get("postures", {}).items()},
    )


def read_toml(path: Path) -> dict[str, Any]:
    """Return the content of a TOML file.

    Raises:
        FileContentError: it cannot be read, or is not TOML, with the line.
    """
    try:
        return tomllib.loads(read_text(path))
    except ValueError as error:  # also for a date that no calendar has
        raise FileContentError(path, f"not TOML: {error}") from None
    except RecursionError:
        raise FileContentError(path, "not TOML: nested too deeply") from None
