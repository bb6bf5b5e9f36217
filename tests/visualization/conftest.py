"""Recorded motions to show, and pages in headless Chromium, driven over the DevTools protocol."""

import base64
import itertools
import json
import subprocess
import time
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from websockets.sync.client import ClientConnection, connect

from densarm.arms.arm import Arm, load_arm
from densarm.certificates.task import Task
from densarm.scene.obstacles import Box, Capsule, Cylinder, Sphere
from densarm.scene.scene import Scene
from densarm.simulation.run import Run
from densarm.values.outcome import Outcome
from densarm.world.world import World

SCENE = Scene(
    [
        Sphere(name="ball", radius=0.3, position=(1.5, 0.0, -0.5)),
        Box(name="box", size=(0.5, 0.5, 0.5), position=(-1.5, 0.0, -0.5)),
        Capsule(name="capsule", radius=0.2, length=0.5, position=(-1.5, 0.0, 1.0)),
        Cylinder(name="cylinder", radius=0.2, length=0.5, position=(1.5, 0.0, 1.0)),
    ]
)
DURATION = 4.0  # [s]
PATIENCE = 60.0  # [s] for a page that draws without a graphics card on a busy machine

FLAGS = (
    "--headless",
    "--no-sandbox",
    # A driver by a name that it does not know would be tried twice, and lose a page's context.
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-first-run",
    "--window-size=640,480",
    "--remote-debugging-port=0",
)


def record(arm: Arm, angles: NDArray[np.float64], duration: float, scene: Scene) -> Run:
    """A record of joint positions (N, nv) at equal steps of time, to the last of them."""
    time = np.linspace(0.0, duration, len(angles))
    q = arm.configurations(angles)
    task = Task(arm, scene, q[0], q[-1], name="swing", title="Swing <b> & co")
    world = World(arm, scene)
    rest = np.zeros((len(q), arm.nv))
    smallest = [world.distances(each).min(initial=np.inf) for each in q]
    return Run(task, time, q, rest, rest, np.array(smallest), Outcome.TIMED_OUT, "late")


@pytest.fixture(scope="session", name="record")
def record_fixture() -> Callable[..., Run]:
    return record


@pytest.fixture(scope="session")
def two_link() -> Arm:
    return load_arm("two_link")


@pytest.fixture(scope="session")
def swing(two_link: Arm) -> Run:
    """The two-link arm swings among obstacles of every kind."""
    angle = np.linspace(0.0, 0.8 * np.pi, 401)
    return record(two_link, np.column_stack([angle, -0.5 * angle]), DURATION, SCENE)


@pytest.fixture(scope="session")
def resting(two_link: Arm) -> Run:
    """One sample of an arm that has nothing around it."""
    return record(two_link, np.array([[0.3, 0.3]]), 0.0, Scene())


@pytest.fixture(scope="session")
def aimless(swing: Run) -> Run:
    """The swing, of a controller that has no goal."""
    return replace(swing, task=replace(swing.task, goal=None))


class Page:
    """One page, with what it said and asked for since it was opened."""

    def __init__(self, connection: ClientConnection) -> None:
        self._connection = connection
        self._number = itertools.count(1)
        self.events: list[dict[str, Any]] = []
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")

    def call(self, method: str, **params: Any) -> dict[str, Any]:
        number = next(self._number)
        self._connection.send(json.dumps({"id": number, "method": method, "params": params}))
        while True:
            message: dict[str, Any] = json.loads(self._connection.recv(timeout=PATIENCE))
            if message.get("id") == number:
                assert "error" not in message, message
                result: dict[str, Any] = message["result"]
                return result
            self.events.append(message)

    def open(self, url: str) -> None:
        self.call("Page.bringToFront")  # a page in the background draws no frames
        self.call("Page.navigate", url=url)
        self.wait_until("document.readyState === 'complete' && location.href !== 'about:blank'")

    def evaluate(self, expression: str) -> Any:
        """Value of a JavaScript expression, awaited if it is a promise."""
        answer = self.call(
            "Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True
        )
        assert "exceptionDetails" not in answer, answer
        return answer["result"].get("value")

    def wait_until(self, expression: str) -> None:
        until = time.monotonic() + PATIENCE
        while not self.evaluate(expression):
            assert time.monotonic() < until, f"never true: {expression}; {self.complaints()}"
            time.sleep(0.05)

    def picture(self) -> NDArray[np.int16]:
        """Pixels (height, width, 3), once what has changed is drawn."""
        self.evaluate(
            "new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))"
        )
        data = self.call("Page.captureScreenshot", format="png")["data"]
        image = Image.open(BytesIO(base64.b64decode(data))).convert("RGB")
        return np.asarray(image).astype(np.int16)

    def complaints(self) -> list[dict[str, Any]]:
        """Errors and warnings of the page; not the driver's remark that taking pictures is slow."""
        said = [event["params"] for event in self._events("Runtime.exceptionThrown")]
        spoken = [event["params"] for event in self._events("Runtime.consoleAPICalled")]
        logged = [event["params"]["entry"] for event in self._events("Log.entryAdded")]
        said += [entry for entry in spoken if entry["type"] in {"error", "warning", "assert"}]
        return said + [entry for entry in logged if "ReadPixels" not in entry["text"]]

    def requests(self) -> list[str]:
        sent = self._events("Network.requestWillBeSent")
        return [event["params"]["request"]["url"] for event in sent]

    def _events(self, method: str) -> list[dict[str, Any]]:
        self.evaluate("0")  # collects what has arrived meanwhile
        return [event for event in self.events if event["method"] == method]


@pytest.fixture(scope="module")  # pages go on drawing beside other tests
def open_page(
    chromium: str, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Callable[[str], Page]]:
    """Open a URL in a page of its own."""
    profile = tmp_path_factory.mktemp("chromium")
    with running_browser(chromium, profile) as address, ExitStack() as stack:

        def open_url(url: str) -> Page:
            # Pings would draw random numbers in a thread, which hypothesis forbids in other tests.
            socket = connect(new_page_address(address), max_size=None, ping_interval=None)
            page = Page(stack.enter_context(socket))
            page.open(url)
            return page

        yield open_url


@contextmanager
def running_browser(chromium: str, profile: Path) -> Iterator[str]:
    command = [chromium, *FLAGS, f"--user-data-dir={profile}", "about:blank"]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        yield f"127.0.0.1:{debugging_port(profile, process)}"
    finally:
        process.terminate()
        process.wait()


def debugging_port(profile: Path, process: subprocess.Popen[bytes]) -> str:
    until = time.monotonic() + PATIENCE
    file = profile / "DevToolsActivePort"
    while not (file.exists() and file.read_text().count("\n")):
        assert process.poll() is None, f"Chromium ended with status {process.returncode}"
        assert time.monotonic() < until, "Chromium did not start"
        time.sleep(0.05)
    return file.read_text().split()[0]


def new_page_address(address: str) -> str:
    request = urllib.request.Request(f"http://{address}/json/new?about:blank", method="PUT")
    with urllib.request.urlopen(request) as answer:
        return str(json.load(answer)["webSocketDebuggerUrl"])
