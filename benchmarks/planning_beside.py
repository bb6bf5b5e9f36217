"""How late the steps of a control loop are while a process beside it plans again and again.

    python benchmarks/planning_beside.py [--seconds 20]

A Panda goes to and fro above a table in real time, on its own model. Every half second a new plan
is asked for, from where the arm is, and followed when it comes; or only at the ends of its way.
"""

import argparse
import time

import numpy as np

import densarm
from densarm.control.planning_process import PlanningProcess
from densarm.simulation.plants import PinocchioPlant

_PERIOD = 0.001  # [s]
_EVERY = 0.5  # [s]


def run(seconds: float, often: bool) -> None:
    """Run the loop, and print how late its steps end, and how many plans came."""
    scenario = densarm.load_scenario("panda_table")
    world, arm = scenario.world, scenario.arm
    motion = densarm.plan_motion(world, scenario.start, scenario.goal)
    tracking, plant = densarm.DensityTracking(world, motion), PinocchioPlant(arm, _PERIOD)
    q, v, tau = scenario.start, np.zeros(arm.nv), arm.nonlinear_effects(scenario.start, [0.0] * 7)
    late, work, took, largest, asked_at = [], [], [], 0.0, 0.0
    ends = [scenario.start, scenario.goal]
    with PlanningProcess(world, tracking, scenario.goal) as planner:
        asked, began = False, time.perf_counter()
        for k in range(round(seconds / _PERIOD)):
            t, due = k * _PERIOD, began + k * _PERIOD
            while (now := time.perf_counter()) < due:
                pass
            worked = time.thread_time()
            if asked and planner.answer(t, q) is not None:
                asked = False
                took.append(now - asked_at)
            arrived = not asked and not tracking.is_moving
            if arrived:
                ends.reverse()
                planner.goal = ends[1]
            if arrived or (often and not asked and now - asked_at > _EVERY):
                planner.ask(t, q)
                asked, asked_at = True, now
            before, tau = tau, tracking.torque(t, q, v)
            work.append(time.thread_time() - worked)
            largest = max(largest, float(np.abs(tau - before).max()))
            q, v = plant.step(q, v, tau)
            late.append(time.perf_counter() - due - _PERIOD)
    lateness = 1e3 * np.maximum(late, 0.0)
    told = ", ".join(f"{value:.2f}" for value in np.quantile(lateness, [0.5, 0.99, 0.999, 1.0]))
    print(f"{len(took)} plans, in {1e3 * np.median(took):.0f} ms (median)")
    print(f"  late by {told} ms (median, 99 %, 99.9 %, most)")
    print(f"  later than 1 ms: {np.count_nonzero(lateness > 1.0)} of {len(late)}")
    print(
        f"  processor time of a step: {1e6 * np.median(work):.0f} us, {1e3 * max(work):.2f} ms most"
    )
    print(f"  torque changes by {largest:.2f} N m a step at most", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=20.0, help="of the loop")
    chosen = parser.parse_args()
    for often in (False, True, False, True):
        run(chosen.seconds, often)
