"""Monte-Carlo: a scenario from random starts with random parameters; what came of every run."""

import json
import time
import zlib
from collections.abc import Mapping
from contextlib import ExitStack, closing
from dataclasses import dataclass, field, fields, replace
from difflib import get_close_matches
from functools import cache, partial
from hashlib import sha256
from pathlib import Path
from types import UnionType
from typing import TYPE_CHECKING, Any, get_args, get_type_hints
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

import densarm
from densarm.errors import DensarmError, FileContentError, InvalidValueError, UnknownNameError
from densarm.scenarios.run import run
from densarm.scenarios.scenario import TABLES, Scenario
from densarm.study.cluster import as_completed
from densarm.study.problems import ProblemResult, problem_result
from densarm.values.checks import finite_number, non_negative_integer, positive_integer
from densarm.values.files import atomic_file
from densarm.values.outcome import FAILED, RUN_ENDS, Outcome
from densarm.values.progress import OnProgress, shown_progress
from densarm.values.proportion import Proportion
from densarm.world.configurations import clear_configurations, drawn_between

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_CHUNK = 8  # runs: what a worker that dies takes with it
_FEWEST, _MOST = 16, 2000  # chunks: for progress in small studies, and what a scheduler can do
_SAVING = 0.02  # share of the time that saving may take
_DETAIL = 120  # characters that are kept

Rows = NDArray[np.void]
"""One record a run; the fields are those of `Study.dtype`, and what was not run has no outcome."""


@dataclass(frozen=True, eq=False)
class Study:
    """What is run: a scenario, from starts and with parameters that the index of a run determines.

    Raises:
        UnknownNameError: a key that cannot vary.
        InvalidValueError: a range that is none or has values that are not allowed, a seed that is
            not a whole number, or a scenario of steps.
    """

    scenario: Scenario
    """Arm, scene, goal and parameters; not its start."""
    seed: int = 0
    """Of starts, parameters and noise; the planner's is the scenario's own."""
    vary: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    """Lowest and highest value of each key that is drawn evenly, as ``simulation.time_limit``."""

    def __post_init__(self) -> None:
        self.scenario.require_one_goal()
        non_negative_integer("seed", self.seed)
        # Without the world that it may have made, which is large.
        object.__setattr__(self, "scenario", replace(self.scenario))
        object.__setattr__(self, "vary", dict(sorted(self.vary.items())))
        for key, ends in self.vary.items():
            if key not in _numbers():
                raise UnknownNameError("key to vary", key, _near(key))
            low, high = (finite_number(f"vary {key}", end) for end in ends)
            if low > high or (_numbers()[key] and not (low.is_integer() and high.is_integer())):
                kind = "two whole numbers" if _numbers()[key] else "two numbers"
                raise InvalidValueError(f"vary {key}", f"{low:g}:{high:g}", f"{kind}, LOW <= HIGH")
        for end in (0, 1):
            self._with({key: ends[end] for key, ends in self.vary.items()})

    def values(self, index: int) -> dict[str, float]:
        """Return the value of each key that varies in a run."""
        told: dict[str, float] = {}
        for key, (low, high) in self.vary.items():
            random = self._random(index, key)
            if _numbers()[key]:
                told[key] = float(random.integers(int(low), int(high) + 1))
            else:
                told[key] = random.uniform(low, high)
        return told

    def case(self, index: int) -> Scenario:
        """Return the scenario of a run.

        Raises:
            DensarmError: almost no start is clear.
        """
        varied = self._with(self.values(index))
        noise = int(self._random(index, "disturbances.seed").integers(2**32))
        varied = replace(varied, disturbances=replace(varied.disturbances, seed=noise))
        drawn = clear_configurations(varied.world, 1, [self.seed, index], varied.control.margin)
        return replace(varied, start=drawn[0])

    def _with(self, values: Mapping[str, float]) -> Scenario:
        tables: dict[str, dict[str, float]] = {}
        for key, value in values.items():
            table, _, name = key.partition(".")
            whole = _numbers()[key]
            tables.setdefault(table, {})[name] = int(value) if whole else float(value)
        changes: dict[str, Any] = {}
        for table, told in tables.items():
            own = self.scenario.law_gains if table == "gains" else getattr(self.scenario, table)
            try:
                changes[table] = replace(own, **told)
            except InvalidValueError as error:
                raise InvalidValueError(
                    f"{table}.{error.name}", error.value, error.allowed
                ) from None
        return replace(self.scenario, **changes)

    def _random(self, index: int, key: str) -> np.random.Generator:
        return np.random.default_rng([self.seed, index, zlib.crc32(key.encode())])

    @property
    def dtype(self) -> np.dtype[np.void]:
        """What is kept of a run: joint positions at its start, what varied, and `ProblemResult`."""
        numbers = [(name, np.float64) for name in _MEASURES]
        words = [("outcome", f"U{max(map(len, RUN_ENDS))}"), ("detail", f"U{_DETAIL}")]
        drawn = [
            ("start", np.float64, (self.scenario.arm.nv,)),
            ("varied", np.float64, (len(self.vary),)),
        ]
        return np.dtype([*drawn, *words, ("certified", np.bool_), *numbers])

    @property
    def parameters(self) -> dict[str, Any]:
        """What determines every number, as JSON data; scene, arm and all else by a checksum."""
        task = json.dumps(self.scenario.task.to_json(), sort_keys=True)
        return {
            "scenario": self.scenario.name,
            "seed": self.seed,
            "vary": {key: list(ends) for key, ends in self.vary.items()},
            "plant": self.scenario.plant,
            "disturbances": self.scenario.disturbances.given,
            "densarm": densarm.__version__,
            "checksum": sha256(task.encode()).hexdigest()[:12],
        }


_MEASURES = (
    "duration_s",
    "min_clearance_m",
    "goal_error_rad",
    "path_length_rad",
    "peak_torque_ratio",
)


def run_study(
    study: Study,
    starts: int,
    jobs: int = 1,
    scheduler: str | None = None,
    save: Path | None = None,
    on_progress: OnProgress | None = None,
) -> Rows:
    """Run a study, or what is not in its file yet.

    Args:
        study: what is run.
        starts: how many runs; the first stay the same when there are more.
        jobs: processes on this machine; 1 for this one.
        scheduler: address of a Dask scheduler whose workers run it, in place of processes here.
        save: the file, written as results come, so that an interrupted study goes on where it was;
            None to keep nothing.
        on_progress: told what is being done; None for a line below the cell of a notebook.

    Returns:
        A record of each run (starts,), the same bit for bit whoever ran it. A run that raises an
        error counts as failed and stops no other.

    Raises:
        InvalidValueError: a number of starts or processes below one, or a scheduler that is none.
        FileContentError: the file is of other parameters, or no study.
        DensarmError: almost no start is clear, Dask is not installed, or see `as_completed`.
    """
    rows = np.zeros(positive_integer("starts", starts), study.dtype)
    if save is not None and save.exists():
        kept = _load(save, study, starts)
        rows[: len(kept)] = kept
    study.case(0)  # what is wrong with all of them is told at once
    missing = np.flatnonzero(rows["outcome"] == "")
    size = min(max(_CHUNK, len(missing) // _MOST), -(-len(missing) // _FEWEST)) or 1
    chunks = [missing[k : k + size] for k in range(0, len(missing), size)]
    workers, began, saved, spent = [""], time.perf_counter(), time.perf_counter(), 0.0

    def note(count: int) -> None:
        left = (time.perf_counter() - began) / count * (len(missing) - count) if count else 0.0
        more = f", some {left:.0f} s more" if count else ""
        tell(f"{starts - len(missing) + count} of {starts} runs{more}{workers[0]}")

    def who(phrase: str) -> None:
        workers[0] = f"; {phrase}"
        note(0)

    count = 0
    try:
        with ExitStack() as stack:
            tell = stack.enter_context(shown_progress(on_progress))
            note(count)
            work = as_completed(partial(_run, study), chunks, jobs, scheduler, who)
            for indices, found in stack.enter_context(closing(work)):
                rows[indices] = found
                count += len(indices)
                note(count)
                if save is not None and time.perf_counter() - saved >= spent / _SAVING:
                    begin = time.perf_counter()
                    _save(save, study, rows)
                    saved = time.perf_counter()
                    spent = saved - begin
    finally:
        if save is not None and count:
            _save(save, study, rows)
    return rows


def _run(study: Study, indices: NDArray[np.intp]) -> tuple[NDArray[np.intp], Rows]:
    rows = np.zeros(len(indices), study.dtype)
    for row, index in zip(rows, map(int, indices), strict=True):
        try:
            case = study.case(index)
            row["start"] = case.arm.angles(case.start)
            found = problem_result(case.name, index, partial(run, case, on_progress=_quiet))
        except DensarmError as error:
            found = ProblemResult(study.scenario.name, index, FAILED, str(error))
        row["varied"] = list(study.values(index).values())
        row["outcome"], row["detail"] = found.outcome, found.detail[:_DETAIL]
        row["certified"] = found.certified
        for name in _MEASURES:
            value = getattr(found, name)
            row[name] = np.nan if value is None else value
    return indices, rows


def _quiet(_: str) -> None:
    """Tell nobody of a single run."""


def _save(path: Path, study: Study, rows: Rows) -> None:
    arrays: dict[str, Any] = {name: rows[name] for name in study.dtype.names or ()}
    arrays["parameters"] = np.array(json.dumps(study.parameters))
    with atomic_file(path) as file:
        np.savez_compressed(file, **arrays)


def _load(path: Path, study: Study, starts: int) -> Rows:
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as data:
            theirs = dict(json.loads(str(data["parameters"])))
            if theirs == study.parameters:
                rows = np.zeros(len(data["outcome"]), study.dtype)
                for name in study.dtype.names or ():
                    rows[name] = data[name]
    except OSError as error:
        raise FileContentError(path, error.strerror or "cannot be read") from None
    except (ValueError, TypeError, LookupError, EOFError, BadZipFile, zlib.error):
        raise FileContentError(path, "not a study: remove it, or give another file") from None
    if other := [
        f"{key} {json.dumps(theirs.get(key))} and not {json.dumps(value)}"
        for key, value in study.parameters.items()
        if theirs.get(key) != value
    ]:
        message = f"a study of {', '.join(other)}: give the file's parameters, or another file"
        raise FileContentError(path, message)
    if len(rows) > starts:
        reason = f"a study of {len(rows)} starts: ask for as many, not {starts}, or more"
        raise FileContentError(path, reason)
    return rows


@cache
def _numbers() -> dict[str, bool]:
    """Return the keys of a scenario that are numbers, and whether they are whole ones."""
    found = {}
    for table, kind in TABLES.items():
        hints = get_type_hints(kind)
        for item in fields(kind):
            hint = hints[item.name]
            kinds = set(get_args(hint) if isinstance(hint, UnionType) else [hint])
            if kinds & {float, int}:
                found[f"{table}.{item.name}"] = float not in kinds
    del found["disturbances.seed"]  # drawn for every run
    return found


def _near(key: str) -> list[str]:
    """Return the keys of the same table, or else those of a like name, or else all tables."""
    table, _, name = key.rpartition(".")
    known = {one: one.rpartition(".")[2] for one in _numbers()}
    like = get_close_matches(name, set(known.values()))
    of_table = [one for one in known if one.startswith(f"{table}.")]
    of_name = [one for one, leaf in known.items() if leaf in like]
    return of_table or of_name or [f"{table}.KEY" for table in TABLES]


def share(rows: Rows, outcome: str, certified: bool = False) -> Proportion:
    """Return the share of the runs that ended so, or of those that are certified besides."""
    counted = rows["outcome"] == outcome
    return Proportion(int((counted & rows["certified"] if certified else counted).sum()), len(rows))


def study_figure(study: Study, rows: Rows) -> "Figure":
    """Plot outcomes over the starts of two joints, their shares with intervals, and clearances.

    The basin map has the first two joints; the unsafe set is drawn if there are no others.
    """
    # Matplotlib takes a second to import.
    from densarm.visualization.figure_style import new_figure

    has_map = study.scenario.arm.nv > 1
    figure = new_figure(15.0 if has_map else 10.0, 4.8)
    figure.suptitle(f"{study.scenario.title}: {len(rows)} starts, seed {study.seed}")
    *maps, shares, clearances = figure.subplots(1, 3 if has_map else 2)
    for axes in maps:
        _plot_map(axes, study, rows)
    _plot_shares(shares, rows)
    _plot_clearances(clearances, study, rows)
    return figure


def _plot_map(axes: "Axes", study: Study, rows: Rows) -> None:
    from densarm.visualization.figure_style import END_COLOUR, mark_goal, plane_grid
    from densarm.visualization.plots import draw_unsafe_set, joint_unit

    scenario, at = study.scenario, rows["start"][:, :2]
    arm = scenario.arm
    if arm.nv == 2:
        grid = plane_grid(np.column_stack(drawn_between(arm)).ravel().tolist(), _RESOLUTION)
        draw_unsafe_set(axes, scenario.world, *grid, scenario.control.margin)
    for outcome in RUN_ENDS:
        for proved, face in ((True, END_COLOUR[outcome]), (False, "none")):
            chosen = (rows["outcome"] == outcome) & (rows["certified"] == proved)
            if chosen.any():
                label = f"{outcome}, {'' if proved else 'not '}certified"
                x, y = at[chosen].T
                edge = END_COLOUR[outcome]
                axes.scatter(x, y, s=14.0, edgecolors=edge, facecolors=face, label=label)
    mark_goal(axes, arm.angles(scenario.goal)[:2])
    for j, name in enumerate(arm.joint_names[:2]):
        (axes.set_ylabel if j else axes.set_xlabel)(f"{name} [{joint_unit(arm, j)}]")
    others = ", unsafe set grey" if arm.nv == 2 else f", two joints of {arm.nv}"
    axes.set_title(f"starts by outcome{others}")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.12), ncols=2, frameon=False)


_RESOLUTION = 100  # samples of each joint where the unsafe set is drawn


def _plot_shares(axes: "Axes", rows: Rows) -> None:
    from densarm.visualization.figure_style import END_COLOUR

    bars = [(share(rows, end), end, END_COLOUR[end]) for end in RUN_ENDS]
    bars = [bar for bar in bars if bar[0].count]
    reached = str(Outcome.REACHED)
    bars.insert(0, (share(rows, reached, True), "reached\nand certified", END_COLOUR[reached]))
    for k, (part, _, colour) in enumerate(bars):
        low, high = part.interval
        reach = [[100.0 * (part.rate - low)], [100.0 * (high - part.rate)]]
        axes.barh(k, 100.0 * part.rate, xerr=reach, color=colour, height=0.6, capsize=4.0)
        axes.text(101.0, k, str(part.count), va="center")
    axes.set_yticks(range(len(bars)), [name for _, name, _ in bars])
    axes.set_xlim(0.0, 100.0)
    axes.invert_yaxis()
    axes.set_xlabel("share of the runs [%], with Wilson's intervals at 95 %")
    axes.set_title("outcomes, and how many")


def _plot_clearances(axes: "Axes", study: Study, rows: Rows) -> None:
    from densarm.visualization.figure_style import END_COLOUR, VERMILION

    known = rows[np.isfinite(rows["min_clearance_m"])]
    ends = [end for end in RUN_ENDS if (known["outcome"] == end).any()]
    values = [1e3 * known["min_clearance_m"][known["outcome"] == end] for end in ends]
    if values:
        colours = [END_COLOUR[end] for end in ends]
        axes.hist(values, bins=30, stacked=True, color=colours, label=ends)
        axes.legend()
    axes.axvline(1e3 * study.scenario.control.margin, color=VERMILION, linewidth=0.9)
    axes.set_xlabel("smallest clearance of a run [mm]; line: margin")
    axes.set_ylabel("runs")
    axes.set_title("clearance")
