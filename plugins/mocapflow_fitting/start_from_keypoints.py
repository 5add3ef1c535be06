"""Stage `start_from_keypoints`: the first pose from 2D keypoints of the first usable frame."""

from __future__ import annotations

import logging
from typing import ClassVar, Literal

from mocapflow.components import Stage
from mocapflow.data import Start
from mocapflow.recordings.recording import Recording
from mocapflow.scene import Scene
from mocapflow_fitting.detections import keypoint_error, names_of, need_keypoints, person_at, seen, tells_pose
from mocapflow_fitting.keypoint_fit import fit
from mocapflow_fitting.keypoint_layouts import Layout
from mocapflow_fitting.landmarks import landmarks

LOG = logging.getLogger("mocapflow")


class StartFromKeypoints(Stage):
    """Finds the person whose detections reproject best, and the pose of the body that explains them.

    Only the first frame is used; where keypoints of fewer than two cameras agree, or show too little of what the body
    has, the next one of the first ten. Keypoints are taken as they are: not moved back in a run that begins after a
    camera was knocked.
    """

    name: ClassVar[str] = "start_from_keypoints"
    extent: ClassVar[Literal["beginning"]] = "beginning"
    layout: Layout | None = None  # order of the keypoints; null: told by their number

    def need(self, recording: Recording) -> None:
        """Raise if there are no keypoints."""
        need_keypoints(recording)

    def run(self, recording: Recording, scene: Scene) -> Start:
        """Return the pose of the first usable frame; the cloth starts without forces.

        Raises:
            RecordingError: there are no keypoints, or no frame in which two cameras see enough of the same person.
        """
        need_keypoints(recording)
        names, first, last = landmarks(scene.body).names, recording.indices[0], recording.indices[-1]
        for index in recording.indices:
            person = person_at(recording, index, scene.cameras)
            if person is None:
                continue
            points = seen(person, names_of(recording, [index], self.layout), names)
            if tells_pose(points):
                if index > first:
                    LOG.warning("keypoints of frame %d tell no pose: that of frame %d is taken for it", first, index)
                _, (pose,) = fit(scene.body, [points], scene.cameras)
                return Start(pose=pose, parameters=scene.neutral_parameters)
        later = range(last + recording.indices.step, recording.length, recording.indices.step)
        usable = next((index for index in later if person_at(recording, index, scene.cameras)), None)
        begin = "" if usable is None else f"they do in frame {usable}: begin there, with --frames {usable}:\nor "
        hint = f"{begin}check that keypoints and cameras belong together (`mocapflow doctor`), or write init.json"
        message = f"in frames {first} to {last} no two cameras see enough of the same person"
        raise keypoint_error(recording, message, hint)
