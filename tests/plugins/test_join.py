"""Parts of a track as one: where they are joined, what is told, what is refused."""

import logging
from dataclasses import replace

import numpy as np
import pytest
from mocapflow_sequence.join import Join, cut
from results_scene import demo_scene, stepping

from mocapflow.errors import PipelineError
from mocapflow.geometry.twists import exp
from mocapflow.series import Series

SCENE = demo_scene()
WHOLE = stepping(SCENE.body)  # 40 frames


def part(first, stop, shift_m=()):
    """The frames of a part, the first ones moved sideways: by so many metres each."""
    track = cut(WHOLE, (WHOLE.frame >= first) & (WHOLE.frame < stop))
    root = track.root.copy()
    for row, shift in enumerate(shift_m):
        root[row] = exp(np.array([0, 0, 0, shift, 0, 0.0])) @ root[row]
    return replace(track, root=root)


def test_parts_that_agree_are_the_whole():
    joined = Join().run((part(0, 20), part(15, 32), part(28, 40)), SCENE)
    for name in ("frame", "time", "root", "angles", "covariance", "cloth", "iterations", "seconds", "energy"):
        np.testing.assert_array_equal(getattr(joined, name), getattr(WHOLE, name))
    assert [note.partition(", ")[0] for note in joined.notes] == ["frame 15: parts joined", "frame 28: parts joined"]


@pytest.mark.parametrize("wide", [0, 1])
def test_what_is_wide_is_joined_in_order_and_stays_on_the_drive(wide):
    parts = [part(0, 20), part(15, 40)]
    numbered = [np.arange(len(each.frame))[:, None, None] + each.frame[0] + 0 * each.covariance for each in parts]
    given = list(numbered)
    given[wide] = Series(numbered[wide].shape, lambda rows: numbered[wide][rows])
    parts = [replace(each, covariance=covariance) for each, covariance in zip(parts, given, strict=True)]
    joined = Join().run(tuple(parts), SCENE).covariance
    assert isinstance(joined, Series)
    np.testing.assert_array_equal(np.asarray(joined)[:, 0, 0], np.arange(40))


def test_parts_are_joined_where_they_agree_best():
    first, second = part(0, 20), part(15, 40, shift_m=[0.1, 0.03, 0.004, 0.005, 0.006])
    joined = Join().run((first, second), SCENE)
    assert joined.frame.tolist() == list(range(40))
    np.testing.assert_array_equal(joined.root[:17], first.root[:17])
    np.testing.assert_array_equal(joined.root[17:], second.root[2:])
    said = "frame 17: parts joined, 4.0 mm apart; in the 5 frames of both 6.0 mm in the median, 100.0 at most"
    assert joined.notes == (said,)


def test_parts_that_disagree_are_warned_of(caplog):
    with caplog.at_level(logging.WARNING):
        joined = Join(tolerance_mm=20).run((part(0, 20), part(18, 40, shift_m=[0.5, 0.3])), SCENE)
    assert joined.notes == tuple(caplog.messages)
    assert caplog.messages[0].startswith("frame 19: parts that disagree are joined, 300.0 mm apart; in the 2 frames")


def test_notes_go_with_their_frames():
    first = replace(part(0, 20), notes=("frame 3: cam01 black", "frame 18: of the first"))
    second = replace(part(15, 40, shift_m=[0.01]), notes=("frame 15: of the second", "frame 30: lost"))
    notes = Join().run((first, second), SCENE).notes
    assert [note.split(": ")[0] for note in notes] == ["frame 3", "frame 16", "frame 30"]


def test_parts_without_a_common_frame():
    with pytest.raises(PipelineError, match=r"frames 19 and 20 have nothing between them\n.*parts\.overlap"):
        Join().run((part(0, 20), part(20, 40)), SCENE)
