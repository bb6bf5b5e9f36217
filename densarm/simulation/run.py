"""Run: the record of a run, its summary, its file, and its certificate."""

import json
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any
from zipfile import BadZipFile, ZipFile, is_zipfile

import numpy as np

from densarm.certificates.certificate import Certificate, certify
from densarm.certificates.phases import Phase, certify_phases, claims_of, positions_of, values_of
from densarm.certificates.task import Input, Task
from densarm.errors import DensarmError, FileContentError, InvalidValueError
from densarm.simulation.disturbances import Disturbances
from densarm.values.arrays import Array
from densarm.values.documented import documented
from densarm.values.files import atomic_file
from densarm.values.outcome import Outcome
from densarm.values.tables import parse_table
from densarm.world.world import World, base_overlaps

_MAX_BYTES = 4_000_000_000  # unpacked; the longest run of a seven-joint arm has half of it
_UNIT_TOLERANCE = 1e-6
_FAULTS = (ValueError, OverflowError, KeyError, TypeError, AttributeError, EOFError)
_DAMAGE = (BadZipFile, zlib.error, NotImplementedError)  # what reading a damaged archive raises
_ARRAYS = ("time", "q", "v", "tau", "clearance")
_OPTIONAL = ("reference", "tube")


@documented
@dataclass(frozen=True, eq=False)
class Run:
    """Every state of a run, first and last included, and how it ended."""

    task: Task
    """What it was about."""
    time: Array
    """k dt (N,) [s]."""
    q: Array
    """Configurations (N, nq)."""
    v: Array
    """Velocities (N, nv) [rad/s or m/s]."""
    tau: Array
    """Torque commanded from each sample to the next (N, nv) [N·m or N], without what delays it; the
    last row repeats. Zero where the plant is told velocities."""
    clearance: Array
    """Smallest signed distance over all pairs (N,) [m]; infinite without pairs."""
    outcome: Outcome
    """How it ended."""
    detail: str = ""
    """What stood in the way, in a phrase; empty when reached."""
    plan_time: float = 0.0
    """Wall-clock time that the guide took [s]; zero for the direct guide."""
    led_by: str = ""
    """What found the way, in a phrase; empty for a guide or controller of one's own."""
    stuck: str = ""
    """Where the density alone gets stuck, and what blocks it, in a phrase; empty where it leads."""
    preparation_time: float = 0.0
    """Wall-clock time from the scenario to the first torque [s], planning included, and compiling
    where kernels are not on disk yet; zero where nothing moved."""
    tracking_error: float | None = None
    """Largest joint error against the controller's reference [rad or m]; None without one."""
    replanned_at: tuple[float, ...] = ()
    """Times at which the arm had lost its plan, and there was a new one from where it was [s]."""
    remark: str = ""
    """Which critical points of ρ it left, and how, in a phrase; empty where it met none."""
    reference: Array | None = None
    """Joint positions that the controller wanted (N, nv) [rad or m]; continuous joints count turns;
    None where it had no reference all the time."""
    tube: Array | None = None
    """Bounds ε on the error against it under which the plan is clear (nv,) [rad or m]; None without
    any."""
    phases: tuple["Run", ...] = ()
    """The runs of its steps, one after another, each in a world of its own, if it has steps. The
    arrays are theirs, of all joints that any of them moves; those that one does not rest in it."""

    @classmethod
    def of_phases(cls, task: Task, phases: Sequence["Run"], **result: Any) -> "Run":
        """Return the run of several, each of which begins where the last ended.

        Args:
            task: the arm with all joints that any of them moves, and the scene at first.
            phases: the runs, at least one.
            result: outcome, detail and remark.
        """
        names, parts = task.arm.joint_names, [slice(0, -1)] * (len(phases) - 1) + [slice(None)]

        def rows(values: Callable[["Run"], Array]) -> Array:
            # Of an end and the start of the next phase, which are one sample, the start is kept.
            kept = [values(run)[part] for run, part in zip(phases, parts, strict=True)]
            return np.concatenate(kept)

        clearance = rows(lambda run: run.clearance)
        errors = [run.tracking_error for run in phases if run.tracking_error is not None]
        return cls(
            task=task,
            time=task.simulation.dt * np.arange(len(clearance), dtype=np.float64),
            q=task.arm.configurations(rows(lambda run: positions_of(run.task.arm, run.q, names))),
            v=rows(lambda run: values_of(run.task.arm, run.v, names)),
            tau=rows(lambda run: values_of(run.task.arm, run.tau, names)),
            clearance=clearance,
            plan_time=sum(run.plan_time for run in phases),
            preparation_time=sum(run.preparation_time for run in phases),
            led_by="; ".join(dict.fromkeys(run.led_by for run in phases if run.led_by)),
            tracking_error=max(errors, default=None),
            phases=tuple(phases),
            **result,
        )

    def located(self, rows: Iterable[int]) -> Iterator[tuple["Run", int]]:
        """Yield the phase that has each sample, and its number there; without phases the run."""
        starts = np.cumsum([0, *(len(run.time) - 1 for run in self.phases[:-1])])
        for row in rows:
            k = int(np.searchsorted(starts, row, side="right")) - 1
            yield (self.phases[k], row - int(starts[k])) if self.phases else (self, row)

    def __repr__(self) -> str:
        after = f"{self.outcome} after {self.time[-1]:.3f} s"
        return f"Run({self.task.title!r}, {after}, {self._closest})"

    def __str__(self) -> str:
        after = f"{self.outcome.description} {self.detail}".rstrip()
        figures = f"{self.time[-1]:.3f} s, {self._closest}, goal error {self.goal_error:.2g}"
        return f"{self.task.title}\n{after}\n{figures}\n{self.certificate}"

    def _repr_html_(self) -> str:
        from densarm.visualization.notebook import run_in_notebook

        return run_in_notebook(self)

    @property
    def _closest(self) -> str:
        return f"clearance {1e3 * float(self.clearance.min()):.4g} mm"

    @classmethod
    def at_rest(cls, task: Task, world: World, outcome: Outcome, detail: str) -> "Run":
        """Return the run of an arm that did not move.

        Args:
            task: what was not done.
            world: its arm and scene.
            outcome: why not.
            detail: the same in a phrase.
        """
        rest = np.zeros((1, task.arm.nv))
        smallest = world.distances(task.start).min(initial=np.inf)
        return cls(
            task=task,
            time=np.zeros(1),
            q=task.start[np.newaxis],
            v=rest,
            tau=rest.copy(),
            clearance=np.array([smallest]),
            outcome=outcome,
            detail=detail,
        )

    @cached_property
    def certificate(self) -> Certificate:
        """What is proved about the run, computed anew from the record when first asked for."""
        if self.phases:
            runs = self.phases
            return certify_phases([Phase(run.task, run.certificate, run.q, run.v) for run in runs])
        arrays = self.time, self.q, self.v, self.tau, self.reference, self.tube
        return certify(self.task, *arrays)

    @cached_property
    def base_overlaps(self) -> tuple[str, ...]:
        """As `World.base_overlaps`: what the certificate, being about motion, is not about."""
        return base_overlaps(self.task.arm, self.task.scene)

    @property
    def certified(self) -> bool:
        """Whether the certificate holds in every part."""
        return self.certificate.certified

    @property
    def goal_error(self) -> float:
        """Largest joint error at the end [rad or m]; NaN without a goal."""
        return self.task.goal_error(self.q[-1])

    @property
    def peak_torque_ratio(self) -> float:
        """Largest torque in units of its limit; joints without a limit do not count."""
        return float((np.abs(self.tau) / self.task.arm.limits.effort).max())

    def summary(self) -> dict[str, Any]:
        """Return the run's figures as JSON data; None for what is unknown or infinite."""
        smallest, error = float(self.clearance.min()), self.goal_error
        by_torque = self.task.input == Input.TORQUE
        phases = [
            {"title": x.task.title, "outcome": str(x.outcome), "duration_s": float(x.time[-1])}
            for x in self.phases
        ]
        return {
            "outcome": str(self.outcome),
            "duration_s": float(self.time[-1]),
            "min_clearance_m": smallest if np.isfinite(smallest) else None,
            "goal_error_rad": error if np.isfinite(error) else None,
            "peak_torque_ratio": self.peak_torque_ratio if by_torque else None,
            "led_by": self.led_by,
            "plan_time_s": self.plan_time,
            "preparation_time_s": self.preparation_time,
            "certified": self.certified,
            "tube_rad": None if self.tube is None else self.tube.tolist(),
            "plant": self.task.plant,
            "disturbances": dict(self.task.disturbances),
            **({"phases": phases} if phases else {}),
        }

    def save(self, path: str | Path) -> None:
        """Write the run to a .npz file, whole or not at all.

        Args:
            path: the file; its folder must exist.

        Raises:
            FileContentError: the file cannot be written.
        """
        with atomic_file(Path(path)) as file:
            np.savez_compressed(file, **self._packed())

    def _packed(self, prefix: str = "") -> dict[str, Any]:
        """Return arrays by their names in a file, phases and all."""
        result = {
            "outcome": str(self.outcome),
            "detail": self.detail,
            "plan_time_s": self.plan_time,
            "led_by": self.led_by,
            "stuck": self.stuck,
            "preparation_time_s": self.preparation_time,
            "tracking_error_rad": self.tracking_error,
            "replanned_at_s": list(self.replanned_at),
            "remark": self.remark,
            "phases": len(self.phases),
        }
        names = [*_ARRAYS, *(key for key in _OPTIONAL if getattr(self, key) is not None)]
        packed = {f"{prefix}{name}": getattr(self, name) for name in names}
        for k, run in enumerate(self.phases):
            packed |= run._packed(f"{prefix}phase{k}.")
        packed[f"{prefix}scenario"] = np.array(json.dumps(self.task.to_json()))
        return {**packed, f"{prefix}result": np.array(json.dumps(result))}

    @classmethod
    def load(cls, path: str | Path) -> "Run":
        """Read a run that `save` wrote.

        Raises:
            FileContentError: no such file, or it is not a run, or its arm cannot be rebuilt, e.g.
                since a mesh has changed.
        """
        try:
            _check_archive(path)
            with Path(path).open("rb") as file, np.load(file, allow_pickle=False) as data:
                return cls._unpacked(data)
        except OSError as error:
            raise FileContentError(path, error.strerror or "cannot be read") from None
        except FileContentError:
            raise
        except DensarmError as error:
            raise FileContentError(path, f"not a run: {error}") from None
        except (MemoryError, RecursionError):
            raise FileContentError(path, "not a run: too large, or nested too deeply") from None
        except (*_FAULTS, *_DAMAGE) as error:
            raise FileContentError(path, f"not a run: {' '.join(str(error).split())}") from None

    @classmethod
    def _unpacked(cls, data: Mapping[str, Any], prefix: str = "") -> "Run":
        """Return the run of what `_packed` returned, or version 0.1 wrote."""
        arrays = {name: data[f"{prefix}{name}"] for name in _ARRAYS}
        arrays |= {name: data[at] for name in _OPTIONAL if (at := f"{prefix}{name}") in data}
        task = Task.from_json(json.loads(str(data[f"{prefix}scenario"])))
        result = json.loads(str(data[f"{prefix}result"]))
        ended: dict[str, Any] = {
            "outcome": Outcome(result["outcome"]),
            "detail": str(result["detail"]),
            "remark": str(result.get("remark", "")),
        }
        if count := int(result.get("phases", 0)):
            # What the arrays of the whole say is not asked, since they are those of the phases.
            phases = [cls._unpacked(data, f"{prefix}phase{k}.") for k in range(count)]
            return cls.of_phases(task, phases, **ended)
        if task.begins_in_motion and not prefix:
            allowed = "left out, but in a phase of a run, which begins as fast as the last ended"
            raise InvalidValueError("start_velocity", task.start_velocity, allowed)
        deviation = result["tracking_error_rad"]
        return cls(
            task=task,
            **arrays,
            **ended,
            plan_time=float(result["plan_time_s"]),
            led_by=str(result.get("led_by", "")),
            stuck=str(result.get("stuck", "")),
            preparation_time=float(result["preparation_time_s"]),
            tracking_error=None if deviation is None else float(deviation),
            replanned_at=tuple(float(time) for time in result.get("replanned_at_s", ())),
        )._checked()

    def _checked(self) -> "Run":
        n, arm = len(self.time), self.task.arm
        parse_table("disturbances", Disturbances, self.task.disturbances)
        claims_of(self.task)
        shapes = {"time": (n,), "q": (n, arm.nq), "v": (n, arm.nv), "tau": (n, arm.nv)}
        shapes |= {"clearance": (n,), "reference": (n, arm.nv), "tube": (arm.nv,)}
        for name, shape in shapes.items():
            array = getattr(self, name)
            if array is None and name in _OPTIONAL:
                continue
            if array.dtype != np.float64:
                raise DensarmError(f"{name} holds {array.dtype}, not float64")
            if array.shape != shape or n == 0:
                raise DensarmError(f"{name} has shape {array.shape}, expected {shape}")
            if np.isnan(array).any() or (name != "clearance" and np.isinf(array).any()):
                raise DensarmError(f"{name} has entries that are not finite")
        if np.abs(arm.configurations(arm.angles(self.q)) - self.q).max() > _UNIT_TOLERANCE:
            raise DensarmError("q has a (cos, sin) pair that is not of length one")
        return self


def _check_archive(path: str | Path) -> None:
    """Refuse a file that is no .npz, or one that is small packed and huge unpacked."""
    if not Path(path).is_file():
        return  # opening it says why
    if not is_zipfile(path):
        raise FileContentError(path, "not a run: not a .npz file")
    with ZipFile(path) as archive:
        size = sum(member.file_size for member in archive.infolist())
    if size > _MAX_BYTES:
        raise FileContentError(path, f"not a run: larger than {_MAX_BYTES / 1e9:g} GB")
