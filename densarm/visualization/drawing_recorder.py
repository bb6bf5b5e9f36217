"""DrawingRecorder: meshcat's drawing commands, kept instead of sent to a browser."""

import base64
import gzip
from typing import Any

import umsgpack


class DrawingRecorder:
    """Stand in for meshcat's window: ``meshcat.Visualizer(window=DrawingRecorder())``."""

    def __init__(self) -> None:
        self._commands: list[dict[str, Any]] = []
        self._seen: set[str] = set()

    def send(self, command: Any) -> None:
        """Keep a drawing command; a mesh that an earlier one carries is kept by its uuid alone."""
        data = command.lower()
        if data["type"] == "set_object":
            data["object"]["geometries"] = [
                self._once(mesh) for mesh in data["object"].get("geometries", [])
            ]
        self._commands.append(data)

    def packed(self) -> str:
        """Return the commands as base64 of gzip of one MessagePack list."""
        packed: bytes = umsgpack.packb(self._commands)
        return base64.b64encode(gzip.compress(packed, mtime=0)).decode("ascii")

    def _once(self, mesh: dict[str, Any]) -> dict[str, Any]:
        uuid = mesh["uuid"]
        if uuid in self._seen:
            return {"uuid": uuid}
        self._seen.add(uuid)
        return mesh
