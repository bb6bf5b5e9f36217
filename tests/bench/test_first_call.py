"""First calls are timed in processes of their own."""

from contextlib import nullcontext

from densarm.bench.first_call import time_first_calls


def test_making_the_controller_is_apart_from_its_first_call(monkeypatch):
    # With the compiled code that is on disk already: compiling anew takes too long for a test.
    monkeypatch.setattr("densarm.bench.first_call.TemporaryDirectory", lambda: nullcontext(""))
    calls = time_first_calls("two_link", "hull", 4)
    for call in (calls.compiled, calls.loaded):
        assert 0.0 < call.torque_us < 1e6 * call.preparation_s
    assert calls.to_json()["loaded"]["torque_us"] == calls.loaded.torque_us
