import json

import numpy as np
import pytest

CHECKS = ["swept", "start", "goal", "limits", "replay", "stopping"]


def altered(swing_up, path, **changes):
    """Copy the run with some of its arrays changed."""
    with np.load(swing_up.npz, allow_pickle=False) as data:
        arrays = {name: data[name] for name in data}
    np.savez(path, **{**arrays, **{key: change(arrays[key]) for key, change in changes.items()}})
    return path


def test_run_is_certified(command, swing_up, tmp_path):
    done = command("verify", swing_up.npz, "--json", tmp_path / "verify.json")
    assert done.status == 0
    assert done.err == ""
    assert all(f"{name} " in done.out for name in CHECKS)
    data = json.loads((tmp_path / "verify.json").read_text(encoding="utf-8"))
    assert data["certified"] is True
    assert [check["name"] for check in data["checks"]] == CHECKS
    assert all(check["holds"] and check["detail"] for check in data["checks"])
    energy, rantzer = data["recorded"]["energy"], data["recorded"]["rantzer"]
    assert energy["verdict"] == "not applicable"
    assert f"energy          not applicable: {energy['detail']}" in done.out
    assert 0.0 <= rantzer["share"] <= 1.0
    assert f"holds at {rantzer['share']:.0%} of {rantzer['samples']} samples" in done.out


@pytest.mark.parametrize(
    ("changes", "name"),
    [({"tau": lambda tau: tau + 1e-3}, "replay"), ({"q": lambda q: q[:, [2, 3, 0, 1]]}, "swept")],
)
def test_altered_run_is_not_certified(command, swing_up, tmp_path, changes, name):
    path = altered(swing_up, tmp_path / "altered.npz", **changes)
    done = command("verify", path, "--json", tmp_path / "verify.json")
    assert done.status == 1
    assert done.err == ""
    data = json.loads((tmp_path / "verify.json").read_text(encoding="utf-8"))
    assert data["certified"] is False
    assert name in [check["name"] for check in data["checks"] if not check["holds"]]


def test_run_of_wrong_shape_is_refused(command, swing_up, tmp_path):
    path = altered(swing_up, tmp_path / "altered.npz", v=lambda v: v[:-1])
    done = command("verify", path)
    assert done.status == 2
    assert "v has shape" in done.err
