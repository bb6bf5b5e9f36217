import pytest

from densarm.arm import load_arm
from densarm.bench.swing_among_spheres import clearance_among_spheres, swing
from densarm.errors import InvalidValueError
from densarm.fields.sub_goal_chain import SensingParameters


@pytest.mark.parametrize("shapes", ["hull", "capsule"])
@pytest.mark.parametrize("pairs", [5, 64, 70])
def test_arm_among_spheres_has_the_pairs_asked_for(shapes, pairs):
    arm = load_arm("panda", shapes=shapes)
    reference = swing(arm)
    clearance = clearance_among_spheres(arm, reference, pairs)
    assert clearance.n_pairs == pairs
    q = arm.configurations(reference.position[::100])
    assert min(clearance.distances(row).min() for row in q) > 0.0


def test_some_spheres_are_sensed():
    arm = load_arm("panda")
    reference = swing(arm)
    clearance = clearance_among_spheres(arm, reference, 64)
    q = arm.configurations(reference.position[::20])
    assert min(clearance.distances(row).min() for row in q) < SensingParameters().distance


def test_number_of_pairs_that_an_arm_cannot_have():
    arm = load_arm("two_link")
    with pytest.raises(InvalidValueError, match="pairs = 3"):
        clearance_among_spheres(arm, swing(arm), 3)
