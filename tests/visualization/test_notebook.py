import re
import sys
from types import SimpleNamespace

import pytest

import densarm
from densarm.simulation.run import Run
from densarm.visualization import html_page
from densarm.visualization.notebook import run_in_notebook


def test_run_shows_picture_outcome_clearance_and_certificate(swing: Run) -> None:
    shown = run_in_notebook(swing)
    assert shown == swing._repr_html_()
    assert '<img src="data:image/png;base64,iVBOR' in shown
    assert f"{1e3 * swing.clearance.min():.3g} mm" in shown
    assert "timed out" in shown
    for check in swing.certificate.checks:
        assert f"<td>{check.name}</td>" in shown


def test_title_is_escaped(swing: Run) -> None:
    assert "<b> &" in swing.task.title
    assert "<b> &" not in run_in_notebook(swing)


def test_view_shows_the_page_below_the_cell(monkeypatch: pytest.MonkeyPatch, swing: Run) -> None:
    shown: list[str] = []
    display = SimpleNamespace(HTML=lambda text: text, display=shown.append)
    kernel = SimpleNamespace(get_ipython=lambda: SimpleNamespace(kernel=object()), display=display)
    monkeypatch.setitem(sys.modules, "IPython", kernel)
    monkeypatch.setattr(html_page, "html_page", lambda _: '<p class="a">playing</p>')
    densarm.view(swing)
    (frame,) = shown
    (page,) = re.findall(r'<iframe srcdoc="([^"]*)"', frame)
    assert page == "&lt;p class=&quot;a&quot;&gt;playing&lt;/p&gt;"
