"""What is computed once is forgotten with what it is about."""

import gc

import numpy as np

from mocapflow.data import Pose
from mocapflow.memo import memoised


def test_computed_once_for_the_same_arguments_and_forgotten_with_the_first() -> None:
    asked, forgotten = [], []

    class Said:
        def __del__(self) -> None:
            forgotten.append(self)

    @memoised
    def said(pose: Pose, factor: float) -> Said:
        asked.append(factor)
        return Said()

    one, other = (Pose(root=np.eye(4), angles=np.zeros(1)) for _ in range(2))
    assert said(one, 2.0) is said(one, 2.0)
    assert said(one, 3.0) is not said(one, 2.0)
    assert said(other, 2.0) is not said(one, 2.0)
    assert asked == [2.0, 3.0, 2.0]
    del one
    gc.collect()
    assert len(forgotten) == 2
