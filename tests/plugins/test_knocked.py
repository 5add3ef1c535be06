"""Cameras that are knocked while they film."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mocapflow_robustness import knocked
from mocapflow_robustness.check_views import CheckViews
from scipy.spatial.transform import Rotation

from mocapflow.geometry.turned import as_seen, shift_px
from mocapflow.recordings.recording import open_recording
from mocapflow.records import record

DEMO = Path(__file__).parents[2] / "examples" / "data" / "skirt_steps"


def turn(camera, degrees):
    about = Rotation.from_euler("xyz", degrees, degrees=True).as_matrix()
    return camera.intrinsics @ about @ np.linalg.inv(camera.intrinsics)


@record
class Knocked:
    """Pictures of cam02 as it stands otherwise from some frames on, and nothing in frames of black pictures."""

    turns: tuple  # (first frame, degrees), ascending
    black: tuple[int, ...] = ()

    def frames(self, source, indices):
        names = [view.lens.name for view in source.views]
        for frame in replace(source, indices=indices).frames():
            now = [degrees for first, degrees in self.turns if first <= frame.index]
            images = list(frame.images)
            if "cam02" in names and now:
                view = names.index("cam02")
                images[view], _ = as_seen(images[view], turn(source.cameras[view], now[-1]))
            if frame.index in self.black:
                images = [np.zeros_like(image) for image in images]
            yield replace(frame, images=tuple(images))


@pytest.fixture(scope="module")
def demo():
    return open_recording(DEMO)


def found(demo, *turns, black=(), background=True):
    """Return (frame, camera, px off what is true) of each knock."""
    shaken = replace(demo, changes=(Knocked(turns=turns, black=black),))
    knocks = CheckViews().run(shaken, demo.background() if background else None).knocks
    if knocks is None:
        return []
    told = []
    for frame, number, homography in zip(knocks.frame.tolist(), knocks.camera.tolist(), knocks.turn, strict=True):
        true = turn(demo.cameras[number], [degrees for first, degrees in turns if first <= frame][-1])
        told.append((frame, number, shift_px(homography @ np.linalg.inv(true), demo.cameras[number])))
    return told


def test_nobody_knocked_a_camera(demo, caplog):
    assert found(demo) == []
    assert caplog.messages == []


@pytest.mark.parametrize("first", [1, 20, 58])
@pytest.mark.parametrize("degrees", [(0.15, 0.1, 0.2), (0.6, -1.0, 0.5)])
def test_the_frame_and_the_turn_are_found(demo, caplog, first, degrees):
    ((frame, camera, off),) = found(demo, (first, degrees))
    assert (frame, camera) == (first, 1)
    assert off < 0.3
    (message,) = caplog.messages
    assert message.startswith(f"cam02 was knocked in frame {first}: its pictures are ")


def test_a_camera_that_swings_and_is_put_back(demo, monkeypatch):
    monkeypatch.setattr(knocked, "EVERY_S", 0.5)
    told = found(demo, (20, (0.6, -1.0, 0)), (22, (0.2, -0.5, 0)), (23, (0.3, 0.2, 0)), (40, (0, 0, 0)))
    assert [(frame, camera) for frame, camera, _ in told] == [(20, 1), (22, 1), (23, 1), (40, 1)]
    assert max(off for *_, off in told) < 0.3


def test_black_pictures_do_not_tell(demo):
    told = found(demo, (20, (0.6, -1.0, 0)), black=(0, 18, 19, 21))
    assert [(frame, camera) for frame, camera, _ in told] == [(20, 1)]


def test_the_track_is_passed_what_the_camera_would_have_seen(demo):
    shaken = replace(demo, changes=(Knocked(turns=((20, (0.6, -1.0, 0.5)),)),))
    checks = CheckViews().run(shaken, demo.background())
    true, seen = demo.frame(30), checks.passed(shaken.frame(30))
    known = ~seen.hidden[1]
    assert known.mean() > 0.9
    off = np.abs(seen.images[1].astype(int) - true.images[1])[known]
    assert np.mean(off) < 2.0  # grey levels: resampled twice
    assert np.abs(shaken.frame(30).images[1].astype(int) - true.images[1]).mean() > 5
