"""What flow, low-passed contours and keypoints add to a frame of four 320x400 views, beside `contour_icp`.

Run `OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/flow.py`. CPU ms of one core for all views, medians over
rounds that take turns; the ratio is to a call of `contour_icp` in the same run. A frame calls a matcher 18 times (three
turns of five matches and one to check); only the first turn's six register shapes or, far off, low-pass. Model and
silhouettes are 5 degrees a joint apart; keypoints are the body's landmarks.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import islice

import numpy as np
from basin import bent, scene_of, shown
from mocapflow_fitting.keypoint_layouts import LAYOUTS
from mocapflow_matching.contour_icp import ContourIcp
from mocapflow_matching.fourier_icp import FourierIcp
from mocapflow_matching.keypoints import Keypoints, marks_on
from mocapflow_matching.optical_flow import OpticalFlow
from mocapflow_priors.constant_velocity import ConstantVelocity
from mocapflow_priors.image_flow import ImageFlowPredictor
from mocapflow_sequence.flow import FollowPoints
from rounds import cpu_ms

from mocapflow.components import Matcher
from mocapflow.data import NO_CLOTH, Change, Frame, Moment, Past, Pose, Turn
from mocapflow.geometry.cameras import project
from mocapflow.help.shipped import shipped
from mocapflow.recordings.recording import open_recording
from mocapflow.scene import Scene

CLIP, ROUNDS = "shorts_steps", 20
FIRST = Turn(index=0)
CALM = Turn(index=2, change=Change(body=0.005, cloth=0.0, angles=0.0, sigmas=1.0))
ALL, ONE_TURN = 18, 6  # calls a frame


def detections(scene: Scene, pose: Pose) -> tuple[np.ndarray, ...]:
    """The landmarks of a pose as an estimator would list them, one person a view."""
    marks, names = marks_on(scene.body), LAYOUTS["body_25b"]
    vertices = scene.surface(pose, NO_CLOTH).vertices
    places = np.einsum("lk,lka->la", marks.share, vertices[marks.vertex])
    views = []
    for camera in scene.cameras:
        rows = np.zeros((1, len(names), 3))
        for name, pixel in zip(marks.names, project(places, camera), strict=True):
            rows[0, names.index(name)] = (*pixel, 0.9)
        views.append(rows)
    return tuple(views)


def main() -> None:
    scene, pose = scene_of(CLIP)
    recording = open_recording(shipped("examples", "data", CLIP))
    background = recording.background()
    assert background is not None
    old, new = islice(recording.frames(), 2)
    follow = FollowPoints()

    def flow_of_frame() -> tuple:
        pairs = enumerate(zip(old.images, new.images, strict=True))
        return tuple(follow.follow(a, b, follow.differs(a, background, camera)) for camera, (a, b) in pairs)

    believed = bent(scene, pose, 5.0, np.random.default_rng(0))
    surface, silhouettes = scene.surface(believed, NO_CLOTH), shown(scene, pose)
    past = Past(moments=(Moment(time=0.0, pose=pose, cloth=NO_CLOTH),))
    frame: Frame = replace(new, flow=flow_of_frame(), keypoints=detections(scene, pose))

    def call(matcher: Matcher, turn: Turn) -> Callable[[], object]:
        return lambda: matcher.match(frame, silhouettes, surface, past, scene, turn)

    matchers = {  # name: matcher, turn, calls a frame
        "contour_icp": (ContourIcp(), CALM, ALL),
        "contour_icp, normals too": (ContourIcp(normal_px=5.0), CALM, ALL),
        "fourier_icp, low-passed": (FourierIcp(near_px=0), FIRST, ONE_TURN),
        "optical_flow between shapes": (OpticalFlow(between="shapes"), FIRST, ONE_TURN),
        "optical_flow between frames": (OpticalFlow(between="frames"), CALM, ALL),
        "keypoints": (Keypoints(), CALM, ALL),
    }
    actions = {name: call(matcher, turn) for name, (matcher, turn, _) in matchers.items()}
    actions["stage flow"] = flow_of_frame
    actions["predictor constant_velocity"] = lambda: ConstantVelocity().predict(frame, past, scene)
    actions["predictor image_flow"] = lambda: ImageFlowPredictor().predict(frame, past, scene)
    points = np.mean([len(view.pixel) for view in frame.flow or ()])
    print(f"{points:.0f} points a view are followed")
    print(f"{'':30}{'ms a call':>10}{'ratio':>8}{'calls':>7}{'ms a frame':>12}")
    spent = cpu_ms(actions, ROUNDS)
    for name, ms in spent.items():
        calls = matchers[name][2] if name in matchers else 1
        print(f"{name:30}{ms:10.2f}{ms / spent['contour_icp']:8.2f}{calls:7}{calls * ms:12.1f}")


if __name__ == "__main__":
    main()
