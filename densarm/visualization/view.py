"""A recorded run on the screen: as a page served by this machine, or as one HTML file."""

import webbrowser
from collections.abc import Callable
from pathlib import Path

from densarm.atomic_file import atomic_file
from densarm.trajectory import Trajectory
from densarm.visualization.html_page import html_page
from densarm.visualization.page_server import PageServer


def view(
    run: Trajectory, on_url: Callable[[str], object] = print, *, open_browser: bool = True
) -> None:
    """Show a run in the browser, with play, pause and a time line, until Ctrl-C.

    Args:
        run: what to show.
        on_url: told the page's address.
        open_browser: open the page where there is a browser; otherwise the user does.

    Raises:
        KeyboardInterrupt: on Ctrl-C.
    """
    with PageServer(html_page(run)) as server:
        on_url(server.url)
        if open_browser:
            webbrowser.open(server.url)
        server.serve_forever()


def save_html(run: Trajectory, path: str | Path) -> None:
    """Write one HTML file that plays a run from disk, without a network.

    Args:
        run: what to show.
        path: the file; its folder must exist.

    Raises:
        FileContentError: the file cannot be written.
    """
    page = html_page(run)
    with atomic_file(Path(path)) as file:
        file.write(page.encode())
