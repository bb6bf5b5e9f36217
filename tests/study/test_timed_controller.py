import numpy as np

from densarm.study.timed_controller import TimedController


class Echo:
    def torque(self, t, q, v):
        return t + np.asarray(q) + np.asarray(v)


def test_passes_calls_on_and_keeps_their_times():
    controller = TimedController(Echo())
    np.testing.assert_array_equal(controller.torque(1.0, [2.0], [3.0]), [6.0])
    controller.torque(0.0, [0.0], [0.0])
    assert len(controller.seconds) == 2
    assert all(seconds >= 0.0 for seconds in controller.seconds)
