"""The catalogue of named robots and scenarios: the folder ``robots/``."""

from pathlib import Path

from densarm.arms.description import DATA_WHEEL, RobotDescription, own_frames, resolve_path
from densarm.arms.mjcf import mjcf_description
from densarm.errors import UnknownNameError
from densarm.scene.mjcf import xml_root
from densarm.values.files import read_text, read_toml


def robots_folder() -> Path:
    """Return the folder of robots: inside the installed package, or beside a checkout's."""
    package = Path(__file__).resolve().parents[1]
    inside = package / "robots"
    return inside if inside.is_dir() else package.parent / "robots"


def robot_names() -> list[str]:
    """Return the names that `load_arm` knows."""
    return sorted(path.parent.name for path in robots_folder().glob("*/arm.toml"))


def scenario_paths() -> dict[str, Path]:
    """Return the scenarios that `load_scenario` knows: name to TOML file."""
    return {path.stem: path for path in sorted(robots_folder().glob("*/scenarios/*.toml"))}


def robot_description(robot: str | Path) -> RobotDescription:
    """Return the description of one of `robot_names`, or of the URDF or MJCF at a path."""
    path = Path(robot)
    if str(robot) not in robot_names():
        if path.suffix != ".urdf" and not path.is_file():
            known = [*robot_names(), "the path of a .urdf or MJCF file"]
            raise UnknownNameError("robot", robot, known)
        text = read_text(path)
        if xml_root(text) == "mujoco":
            return mjcf_description(path)
        nearby = [str(above) for above in path.resolve().parents]
        return RobotDescription(name=path.stem, urdf=text, package_dirs=nearby)
    folder = robots_folder() / path
    entry = read_toml(folder / "arm.toml")
    urdf, srdf = entry.pop("urdf"), entry.pop("srdf", None)
    entry["frames"] = own_frames(entry.pop("frames", {}))
    text = read_text(resolve_path(urdf, folder))
    return RobotDescription(
        name=str(robot),
        urdf=text,
        srdf=None if srdf is None else read_text(resolve_path(srdf, folder)),
        package_dirs=(DATA_WHEEL,) if DATA_WHEEL in f"{urdf} {text}" else (str(folder),),
        **entry,
    )
