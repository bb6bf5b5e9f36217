"""franka-sim at an address of this machine, every limit enforced; run in an environment of its own.

python -m venv ENV && ENV/bin/pip install franka-sim && ENV/bin/pip install --no-deps franky-sim
ENV/bin/python benchmarks/franka_sim_server.py [--address 127.0.0.1] [--waits]

The FR3 is the MJCF that franky-sim brings, so that nothing is asked of a network. Its physics
advance by a millisecond for each state that is sent, at 1 kHz by the wall clock: franka-sim's own
run beside its protocol, so that none or several of their steps are between two states, as no
robot's are. What is answered late acts late, and counts as lost. With --waits a state waits for the
answer to the last one: for machines that are not quiet.
"""

import argparse
import gc
import importlib.util
import os
import sys
import tempfile
import threading
import time
from pathlib import Path

_LONGEST_WAIT = 0.5  # [s] for an answer; then it counts as lost


def fr3_model(folder: Path) -> Path:
    """Return franky-sim's fr3.xml, whose meshes lie where it looks for them."""
    found = importlib.util.find_spec("franky_sim")
    if found is None or found.origin is None:
        raise SystemExit("franky-sim is not installed: pip install --no-deps franky-sim")
    assets = Path(found.origin).parent / "assets"
    (folder / "assets").symlink_to(assets / "meshes")
    (folder / "fr3.xml").write_text((assets / "fr3.xml").read_text())
    return folder / "fr3.xml"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--address", default="127.0.0.1")
    parser.add_argument("--waits", action="store_true")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        os.environ["FR3_MJCF"] = str(fr3_model(Path(folder)))
        # Robots do not pause to collect garbage, and their threads do not wait 5 ms for each other.
        gc.disable()
        sys.setswitchinterval(1e-4)
        serve(options.address, waits=options.waits)


def serve(address: str, *, waits: bool) -> None:
    import mujoco
    from franka_sim.control_modes import ControlMode
    from franka_sim.franka_sim_server import FrankaSimServer
    from franka_sim.mujoco_franka_sim import MujocoFrankaSim

    class InStep(MujocoFrankaSim):
        """Physics that advance by one step for each state that is sent."""

        publisher, answers, answered = 0, 0, 0

        def run_simulation(self) -> None:
            self._read_and_publish_state()
            while self.running:
                time.sleep(0.1)

        def update_torques(self, torques: list[float]) -> None:
            super().update_torques(torques)
            self.answers += 1

        def get_robot_state(self) -> object:
            if threading.get_ident() == self.publisher:
                began = time.perf_counter()
                while (
                    waits
                    and self.control_mode == ControlMode.TORQUE
                    and self.answers == self.answered
                    and time.perf_counter() - began < _LONGEST_WAIT
                ):
                    time.sleep(2e-5)
                self.answered = self.answers
                self._apply_control()
                mujoco.mj_step(self.model, self.data)
                self._read_and_publish_state()
            return super().get_robot_state()

    class Server(FrankaSimServer):
        def start_robot_state_transmission(self, *arguments: object) -> None:
            self.physics_sim.publisher = threading.get_ident()
            super().start_robot_state_transmission(*arguments)

    server = Server(
        host=address,
        physics_sim=InStep(),
        enable_gripper=False,
        enforce_comm_constraints=True,
        enforce_motion_limits=True,
    )
    try:
        server.start()
    finally:
        server.stop()


if __name__ == "__main__":
    main()
