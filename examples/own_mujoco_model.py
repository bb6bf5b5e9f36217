"""Drive a MuJoCo model of one's own: other masses, rotors, friction, and contacts that it finds.

python examples/own_mujoco_model.py
"""

import tempfile
from pathlib import Path

import densarm

MJCF = """<mujoco>
  <worldbody>
    <body><joint name="shoulder" axis="0 -1 0" armature="0.02" damping="0.02"/>
      <geom name="upper" type="capsule" fromto="0 0 0 0 0 -1" size="0.05" mass="1.01"/>
      <body pos="0 0 -1"><joint name="elbow" axis="0 -1 0" frictionloss="0.01"/>
        <geom name="lower" type="capsule" fromto="0 0 0 0 0 -1" size="0.06" mass="1.02"/>
      </body>
    </body>
  </worldbody>
</mujoco>"""


def main() -> None:
    scenario = densarm.load_scenario("swing_up")
    world, start = scenario.world, scenario.start
    motion = densarm.plan_motion(world, start, scenario.goal)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "two_link.xml"
        path.write_text(MJCF, encoding="utf-8")
        plant = densarm.MujocoPlant.from_mjcf(world, path)  # joints have the names of the arm's
    run = densarm.simulate(world, densarm.DensityTracking(world, motion), start, plant=plant)
    print(f"{run.outcome}, {run.tracking_error or 0.0:.3f} rad off at most")
    for check in run.certificate.checks:
        print(f"{check.name:<10}{check.holds}: {check.detail}")


if __name__ == "__main__":
    main()
