"""Skin weights are those of the skeleton's joints, whatever order they have in the file."""

import numpy as np
import pytest

from mocapflow.errors import RecordingError
from mocapflow.geometry.skeleton import Skeleton
from mocapflow.io.subject.weights import read_weights

NAMES = ("pelvis", "chest", "head")
SKELETON = Skeleton(NAMES, np.array([-1, 0, 1], np.int32), np.array([[0, 0, 1.0], [0, 0, 1.3], [0, 0, 1.6]]))
VERTICES = np.array([[0, 0.1, 1.1], [0, 0.1, 1.2], [0, 0.1, 1.4], [0, 0.1, 1.7]])
WEIGHTS = np.array([[1, 0, 0], [0.7, 0.3, 0], [0, 1, 0], [0, 0, 1.0]])


def read(folder, weights, **names):
    np.savez(folder / "weights.npz", weights=weights, **names)
    return read_weights(folder / "weights.npz", SKELETON, VERTICES)


@pytest.mark.parametrize("order", [[0, 1, 2], [2, 0, 1], [1, 2, 0]])
def test_names_tell_whose_a_column_is(tmp_path, order):
    np.testing.assert_array_equal(read(tmp_path, WEIGHTS[:, order], names=np.array(NAMES)[order]), WEIGHTS)


def test_without_names_columns_are_in_the_order_of_the_skeleton(tmp_path):
    np.testing.assert_array_equal(read(tmp_path, WEIGHTS), WEIGHTS)
    with pytest.raises(
        RecordingError, match="what 'pelvis' moves lies at 'chest'\n.*in another order(.|\n)*which a program has sorted"
    ):
        read(tmp_path, WEIGHTS[:, [2, 0, 1]])


@pytest.mark.parametrize("row", [[np.nan, 1, 0], [np.inf, 0, 0], [1.1, -0.1, 0], [0, 0, 0]])
def test_weights_that_move_no_skin(tmp_path, row):
    with pytest.raises(RecordingError, match="have to be numbers of at least 0, one of each vertex above"):
        read(tmp_path, np.vstack([WEIGHTS[:3], row]))
