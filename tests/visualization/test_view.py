import threading
from collections.abc import Callable
from typing import Any
from urllib.request import urlopen

import numpy as np
import pytest

from densarm.trajectory import Trajectory
from densarm.visualization import view as module
from densarm.visualization.html_page import html_page
from densarm.visualization.page_server import PageServer


def test_served_page_plays(open_page: Callable[[str], Any], swing: Trajectory) -> None:
    with PageServer(html_page(swing)) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        try:
            page = open_page(server.url)
            page.wait_until("playing && time > 0")
            before = page.picture()
            page.wait_until("time > 0.3")
            moved = np.abs(page.picture() - before).max(axis=2) > 8
            assert (
                moved[: page.evaluate("document.querySelector('#timeline').offsetTop")].sum() > 100
            )
            assert page.complaints() == []
            assert {url for url in page.requests() if "http" in url} == {server.url}
        finally:
            server.shutdown()
            thread.join()


def test_page_is_for_this_machine_alone_and_ends_with_ctrl_c(
    resting: Trajectory, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    urls: list[str] = []
    monkeypatch.setattr(module.webbrowser, "open", lambda url: urls.append(url) or True)

    def serve(server: PageServer) -> None:
        thread = threading.Thread(target=server.handle_request)
        thread.start()
        with urlopen(server.url, timeout=30) as answer:
            assert answer.read().decode() == server.page.decode()
        thread.join()
        raise KeyboardInterrupt

    monkeypatch.setattr(PageServer, "serve_forever", serve)
    with pytest.raises(KeyboardInterrupt):
        module.view(resting, on_url=urls.append)
    assert urls[0] == urls[1]
    assert urls[0].startswith("http://127.0.0.1:")
    with pytest.raises(OSError, match="refused"):
        urlopen(urls[0], timeout=30)
    assert capfd.readouterr() == ("", "")
