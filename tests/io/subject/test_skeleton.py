"""Whether a mesh and a skeleton are of a person in metres, upright; what is read of the file is tested with bodies."""

import numpy as np
import pytest

from mocapflow.errors import RecordingError
from mocapflow.geometry.skeleton import Skeleton
from mocapflow.io.subject.skeleton import check_size

CORNERS = np.array(np.meshgrid([-0.5, 0.5], [-0.5, 0.5], [0, 1])).reshape(3, -1).T


def check(size, joint=(0.0, 0.0, 0.1)):
    check_size(CORNERS * size, Skeleton(("pelvis",), np.array([-1], np.int32), np.array([joint])), "body.obj")


@pytest.mark.parametrize("size", [(0.5, 0.3, 2.9), (0.2, 0.2, 0.31), (0.5, 1.6, 1.3), (1.8, 1.0, 0.7)])
def test_sizes_that_a_person_has(size):
    """A child may be small, and who lies or spreads the arms is longer than high."""
    check(size)


@pytest.mark.parametrize(
    ("size", "said"),
    [
        ((0.5, 0.3, 3.1), "the mesh measures 0.5, 0.3, 3.1: it seems to be not in metres"),
        ((50, 30, 180), "it seems to be not in metres"),
        ((500, 300, 1800), "it seems to be in millimetres: divide by 1000"),
        ((0.2, 0.2, 0.29), "too small for a person"),
        ((0.5, 1.8, 1.3), "it seems to stand along y"),
    ],
)
def test_sizes_that_nobody_has(size, said):
    with pytest.raises(RecordingError, match=said):
        check(size)


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("sign", [-1, 1])
def test_a_joint_may_lie_ten_centimetres_outside_the_mesh(axis, sign):
    middle, half = np.array([0, 0, 0.9]), np.array([0.25, 0.15, 0.9])
    way = sign * np.eye(3)[axis]
    check((0.5, 0.3, 1.8), middle + way * (half + 0.09))
    with pytest.raises(RecordingError, match="1 of 1 joints lie more than 10 cm outside the mesh, first 'pelvis'"):
        check((0.5, 0.3, 1.8), middle + way * (half + 0.11))
