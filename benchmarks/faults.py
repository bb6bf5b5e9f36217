"""Inject faults into running controllers: does the supervisor keep limits and distance?

python benchmarks/faults.py --faults 1000 --json faults.json

Each fault begins at a random sample of a recorded run of the scenario. The arm goes on under
`Supervisor`, from shortly before the fault until it rests. A contact counts against the supervisor
if `StoppingCheck` proves the stopping trajectory from the fault's sample clear. An arm whose masses
are not the model's (`--model-error 0.1`) falls in the end where no state tells where it is; with
`--brakes` mechanical ones hold it from when the supervisor asks for them.
"""

import argparse
import json
import time
from dataclasses import dataclass, replace
from itertools import cycle, islice, product
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

import densarm
from densarm import Arm, Controller
from densarm.density.sub_goals import SubGoals
from densarm.scenarios.control import ControlForm
from densarm.scenarios.run import by_density
from densarm.values.arrays import Array
from densarm.world.active_pairs import ExactDistances
from densarm.world.stopping import StoppingCheck, StoppingTrajectory
from densarm.world.swept_check import SweptCheck

SCENARIOS = ("panda_table", "ur5_bin", "swing_up")
LEAD = 200  # samples of the run before the fault
LONGEST = 2000  # samples simulated after it begins
AT_REST = 300  # samples at rest after which a case ends
SLOW = 2e-3  # [rad/s], which counts as rest
GAP = (5, 51)  # samples by which calls or states are late
GARBAGE = (np.nan, np.inf, -np.inf, 1e300, -1e9)


State = tuple[Array, Array]


class Fault:
    """What the controller gets instead of the state, from the sample at which it begins."""

    name = "none"

    def __init__(self, rng: np.random.Generator, arm: Arm, length: float) -> None:
        self.rng, self.arm, self.length = rng, arm, length

    def state(self, k: int, states: list[State]) -> State:
        """The state that is seen k samples after the fault began, of all states so far."""
        return self.wrong(k, states) if k < self.length else states[-1]

    def wrong(self, _: int, states: list[State]) -> State:
        return states[-1]

    def is_called(self, _: int) -> bool:
        return True

    def fails(self, _: int) -> bool:
        return False


class NotFinite(Fault):
    name = "not finite"

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self.row, self.joint = int(self.rng.integers(2)), int(self.rng.integers(self.arm.nv))
        self.garbage = GARBAGE[self.rng.integers(len(GARBAGE))]

    def wrong(self, _: int, states: list[State]) -> State:
        q, v = (x.copy() for x in states[-1])
        (q, v)[self.row][self.joint] = self.garbage
        return q, v


class LateCall(Fault):
    name = "late call"

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self.gap = int(self.rng.integers(*GAP))

    def is_called(self, k: int) -> bool:
        return k >= self.gap


class DelayedState(Fault):
    name = "delayed state"

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self.gap = int(self.rng.integers(*GAP))

    def wrong(self, _: int, states: list[State]) -> State:
        return states[-1 - self.gap]


class Jump(Fault):
    name = "jump"

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        rng, nv = self.rng, self.arm.nv
        self.dq = rng.normal(size=nv) * 10.0 ** rng.uniform(-3.0, 0.0) * (rng.random() < 0.7)
        self.dv = rng.normal(size=nv) * 10.0 ** rng.uniform(-1.0, 1.0) * (rng.random() < 0.5)

    def wrong(self, _: int, states: list[State]) -> State:
        q, v = states[-1]
        return self.arm.integrate(q, self.dq), v + self.dv


class Frozen(Fault):
    name = "frozen"

    def wrong(self, k: int, states: list[State]) -> State:
        return states[-1 - k]


class LostGuide(Fault):
    name = "lost guide"

    def fails(self, k: int) -> bool:
        return k < self.length


KINDS: tuple[type[Fault], ...] = (NotFinite, LateCall, DelayedState, Jump, Frozen, LostGuide)


class FailingController:
    """A controller that loses its way."""

    def __init__(self, controller: Controller, rng: np.random.Generator) -> None:
        self.controller, self.fails = controller, False
        self.way = int(rng.integers(4))

    def torque(self, t: float, q: ArrayLike, v: ArrayLike) -> Array:
        tau = self.controller.torque(t, q, v)
        if not self.fails:
            return tau
        if self.way == 0:
            raise densarm.DensarmError("no way")
        return {1: np.nan * tau, 2: 1e6 * np.ones_like(tau), 3: tau[:-1]}[self.way]


class Course:
    """A scenario's run, in which faults are injected."""

    def __init__(self, name: str, form: str, model_error: float, *, has_brakes: bool) -> None:
        self.has_brakes = has_brakes
        scenario = densarm.load_scenario(name)
        scenario = replace(scenario, control=replace(scenario.control, form=ControlForm(form)))
        self.scenario, self.world = scenario, scenario.world
        self.tracking = by_density(scenario, replans=False) if form == "tracking" else None
        self.run = densarm.run(scenario)
        if self.run.outcome != "reached":
            raise SystemExit(f"{name}: {self.run.outcome}")
        if self.tracking is None:
            self.follow()
        self.model = scenario.arm.model.copy()
        for inertia in self.model.inertias:
            inertia.mass *= 1.0 + model_error
        self.data = self.model.createData()
        check = StoppingCheck(self.world, StoppingTrajectory(scenario.arm))
        self.could_stop = check.check(self.run.q, self.run.v).holds

    def follow(self) -> None:
        """Find the sub-goal at each sample of the run."""
        scenario, control = self.scenario, self.scenario.control
        self.path = densarm.plan_path(
            self.world,
            scenario.start,
            scenario.goal,
            control.guide,
            margin=control.margin,
            seed=scenario.seed,
            path_margin=control.path_margin,
            search=scenario.planning,
        ).path
        check = SweptCheck(self.world, control.margin)
        self.sub_goals, self.followed = SubGoals(check, self.path, scenario.sensing), []
        for q in self.run.q:
            self.sub_goals.advance(q, ExactDistances(self.world.distances(q)))
            self.followed.append(self.sub_goals.current)

    def controller(self, k: int) -> Controller:
        """What acts at sample k of the run."""
        if self.tracking is not None:
            return self.tracking.controller
        scenario, plain = self.scenario, self.scenario.control.form == "plain"
        first = max(self.followed[k] - 2, 0)  # one sub-goal before, from which it moves on
        kappa = scenario.control.kappa
        return densarm.DensityRegulation(
            self.world,
            scenario.goal,
            path=densarm.GuidePath(self.sub_goals.q[first:], self.path.is_clear),
            plain=plain,
            margin=scenario.control.margin,
            gains=scenario.law_gains,
            period=scenario.simulation.control_period,
            goal_distance=None if plain else densarm.TorusDistance(scenario.arm, kappa=kappa),
            density=scenario.density,
            sensing=scenario.sensing,
            speed=scenario.speed,
        )

    def inject(self, kind: type[Fault], seed: int) -> "Case":
        """Return what came of one fault."""
        rng = np.random.default_rng(seed)
        arm, dt = self.scenario.arm, self.scenario.simulation.dt
        at = int(rng.integers(LEAD + GAP[1], len(self.run.time) - 1))
        for_good = bool(rng.random() < 0.25)
        fault = kind(rng, arm, np.inf if for_good else 10.0 ** rng.uniform(0.0, 2.5))
        inner = FailingController(self.controller(at - LEAD), rng)
        supervised = densarm.Supervisor(arm, inner, dt)
        states = [(self.run.q[k], self.run.v[k]) for k in range(at - LEAD - GAP[1], at - LEAD + 1)]
        case = Case(fault.name, bool(self.could_stop[at]), for_good)
        rest, tau = 0, np.zeros(arm.nv)
        for k in range(-LEAD, LONGEST):
            inner.fails = k >= 0 and fault.fails(k)
            if k < 0 or fault.is_called(k):
                tau = supervised.torque((at + k) * dt, *self.seen(fault, k, states))
                case.see(k * dt, tau, arm.limits.effort, supervised.status.fault)
            if self.has_brakes and supervised.needs_brakes:
                tau, states[-1] = np.zeros(arm.nv), (states[-1][0], np.zeros(arm.nv))
                states.append(states[-1])
            else:
                states.append(self.step(*states[-1], tau))
            rest = rest + 1 if np.abs(states[-1][1]).max() < SLOW else 0
            if not case.is_clear(self.world, states[-1][0]) or (k > 0 and rest > AT_REST):
                break
        case.rests = rest > 0
        return case

    def seen(self, fault: Fault, k: int, states: list[State]) -> State:
        return fault.state(k, states) if k >= 0 else states[-1]

    def step(self, q: Array, v: Array, tau: Array) -> State:
        """As the plant of the run, its masses off by the model's error."""
        dt = self.scenario.simulation.dt
        v = v + dt * pin.aba(self.model, self.data, q, v, tau)
        return pin.integrate(self.model, q, dt * v), v


@dataclass
class Case:
    """One fault and what came of it."""

    kind: str
    could_stop: bool
    for_good: bool
    outside: int = 0
    smallest: float = np.inf
    found: str = "none"
    noticed: float = np.nan
    rests: bool = False
    checked: np.ndarray | None = None

    def see(self, t: float, tau: Array, limit: Array, found: str) -> None:
        self.outside += not (np.isfinite(tau).all() and (np.abs(tau) <= limit).all())
        if self.found == "none" and found != "none":
            self.found, self.noticed = str(found), t

    def is_clear(self, world: densarm.World, q: Array) -> bool:
        if self.checked is None or np.abs(q - self.checked).max() > 1e-5:
            self.checked = q
            self.smallest = min(self.smallest, float(world.distances(q).min()))
        return self.smallest > 0.0

    @property
    def harm(self) -> bool:
        return self.could_stop and self.smallest <= 0.0


def row(name: str, cases: list[Case]) -> dict[str, Any]:
    seen = [case.noticed for case in cases if case.found != "none"]
    return {
        "what": name,
        "faults": len(cases),
        "outside": sum(case.outside > 0 for case in cases),
        "could_stop": sum(case.could_stop for case in cases),
        "contacts": sum(case.smallest <= 0.0 for case in cases),
        "harm": sum(case.harm for case in cases),
        "harm_for_good": sum(case.harm and case.for_good for case in cases),
        "noticed": len(seen),
        "noticed_ms": 1e3 * float(np.median(seen)) if seen else None,
        "moving": sum(not case.rests for case in cases),
        "nearest_mm": 1e3 * min(case.smallest for case in cases),
    }


def table(rows: list[dict[str, Any]]) -> None:
    print("".join(f"{key:>{30 if key == 'what' else 14}}" for key in rows[0]))
    for r in rows:
        texts = [f"{x:.3g}" if isinstance(x, float) else str(x) for x in r.values()]
        print(f"{texts[0]:>30}" + "".join(f"{text:>14}" for text in texts[1:]))


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--faults", type=int, default=1000, metavar="N")
    parser.add_argument("--scenarios", nargs="+", default=SCENARIOS, help="names or TOML files")
    parser.add_argument("--form", default="tracking", choices=list(ControlForm))
    parser.add_argument("--seed", type=int, default=0, help="of the first fault")
    parser.add_argument("--model-error", type=float, default=0.0, help="share of the masses")
    parser.add_argument("--brakes", action="store_true", help="mechanical ones close when asked")
    parser.add_argument("--json", metavar="FILE")
    return parser.parse_args()


def main() -> None:
    args = arguments()
    courses = {
        Path(name).stem: Course(name, args.form, args.model_error, has_brakes=args.brakes)
        for name in args.scenarios
    }
    cases: dict[str, list[Case]] = {}
    began = time.perf_counter()
    pairs = islice(cycle(product(courses, KINDS)), args.faults)
    for seed, (name, kind) in enumerate(pairs, start=args.seed):
        case = courses[name].inject(kind, seed)
        if case.harm or case.outside:
            print(f"harm: {name}, {kind.__name__}, seed {seed}: {case}")
        cases.setdefault(f"{name}, {kind.name}", []).append(case)
    rows = [row(name, found) for name, found in cases.items()]
    rows.append(row("all", [case for found in cases.values() for case in found]))
    print(f"{args.faults} faults in {time.perf_counter() - began:.0f} s")
    table(rows)
    if args.json:
        Path(args.json).write_text(json.dumps({"rows": rows}, indent=2), encoding="utf-8")


if __name__ == "__main__":
    main()
