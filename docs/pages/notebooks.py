"""Pages of the tutorials: notebooks that are run while the site is made, with what they show."""

import base64
import re
import tempfile
from pathlib import Path

import nbformat
from jupyter_client.manager import KernelManager
from nbclient import NotebookClient
from nbformat import NotebookNode

_TIME_LIMIT = 120  # of a cell [s]
_SHOWN: dict[str, str] = {}
"""HTML that cells show, by the marks that stand for it while Markdown is read."""


def page(path: Path) -> tuple[str, dict[str, bytes]]:
    """Run a notebook; return its page in Markdown, and pictures by name.

    Raises:
        CellExecutionError: a cell fails.
    """
    notebook = nbformat.read(path, as_version=4)
    with tempfile.TemporaryDirectory() as folder:  # what cells write is not kept
        file = str(Path(folder) / "kernel.json")
        kernel = KernelManager(transport="ipc", connection_file=file)  # opens no port
        resources = {"metadata": {"path": folder}}
        try:
            NotebookClient(notebook, kernel, timeout=_TIME_LIMIT, resources=resources).execute()
        finally:
            kernel.shutdown_kernel(now=True)
    parts: list[str] = []
    pictures: dict[str, bytes] = {}
    for cell in notebook.cells:
        if cell.cell_type == "markdown":
            parts.append(cell.source)
            continue
        parts.append(f"```python\n{cell.source}\n```")
        for output in cell.outputs:
            parts.append(_shown(output, f"{path.stem}_{len(parts)}", pictures))
    parts.append(f'<a href="{path.name}">This page as a notebook</a>')
    return "\n\n".join(parts) + "\n", pictures


def with_shown(html: str) -> str:
    """Return a page with what the cells show in place of the marks."""
    return re.sub(r"<div data-shown=\"(\w+)\"></div>", lambda mark: _SHOWN[mark[1]], html)


def _shown(output: NotebookNode, name: str, pictures: dict[str, bytes]) -> str:
    data = output.get("data", {})
    if "text/html" in data:
        _SHOWN[name] = f'<div class="shown">{data["text/html"]}</div>'
        return f'<div data-shown="{name}"></div>'
    if "image/png" in data:
        pictures[f"{name}.png"] = base64.b64decode(data["image/png"])
        return f"![what the cell shows]({name}.png)"
    text = output.get("text", data.get("text/plain", ""))
    return f"```{{ .text .shown }}\n{text.rstrip()}\n```"
