import json

import pytest


@pytest.mark.parametrize(("arm", "pairs"), [("two_link", 4), ("panda", 20)])
def test_step_reports_its_keys(command, tmp_path, arm, pairs):
    path = tmp_path / "step.json"
    done = command("bench", "step", "--arm", arm, "--pairs", pairs, "--json", path)
    assert done.status == 0
    assert done.err == ""
    data = json.loads(path.read_text(encoding="utf-8"))
    assert list(data) == ["step_us", "bare_us", "ratio", "pairs"]
    assert data["pairs"] == pairs
    assert data["step_us"] > data["bare_us"] > 0.0
    assert data["ratio"] == pytest.approx(data["step_us"] / data["bare_us"])
    assert f"{data['ratio']:.2f}" in done.out
