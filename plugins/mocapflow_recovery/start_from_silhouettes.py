"""Stage `start_from_silhouettes`: the first pose from what differs from the empty room; no file, no keypoints."""

from __future__ import annotations

import logging
from typing import ClassVar

from mocapflow_draping.kinematic import Kinematic
from mocapflow_priors.density import Poses, read
from mocapflow_priors.parzen import SHIPPED

from mocapflow.components import Stage
from mocapflow.data import Start
from mocapflow.dressing.roles import Draper
from mocapflow.errors import RecordingError
from mocapflow.io.recording.plates import plate_files
from mocapflow.recordings.recording import Recording
from mocapflow.scene import Scene
from mocapflow_recovery.candidates import likely_headings
from mocapflow_recovery.silhouette_target import first_trimaps, target_of

LOG = logging.getLogger("mocapflow")
FAR_M = 0.008  # off the silhouettes: right poses were at most 0.006 off, most wrong ones farther than this
GO_ON = "begin where the person stands freely and in all pictures, or use start_from_file or start_from_keypoints"


class StartFromSilhouettes(Stage):
    """Finds the pose of the first frame by what differs from the clean plates: the person, and nobody else.

    Poses that people were seen in are put where the rays through the middles of the silhouettes meet, and turned all
    ways. The best of some directions are searched part by part, as `limb_search` does, and those that end nearest to
    the silhouettes again, as long as that helps. If two that look different ways stay alike, the track takes the one
    that its first frame fits better. The garment is draped on each: bare legs would spread to fill a skirt.
    The farther a pose is from all that were seen the farther it counts: what silhouettes do not tell, such as how an
    arm before the trunk is turned, stays natural. It is some 10° off in each joint; the first frame of a track that has
    `first_segmenter` and `recovery` mends that.
    """

    name: ClassVar[str] = "start_from_silhouettes"
    poses: Poses = SHIPPED  # that people were seen in, made by `mocapflow prior fit`
    draper: Draper | None = Kinematic(sweeps=4)  # of the garment; null: clothes are left out

    def need(self, recording: Recording) -> None:
        """Raise if there are no clean plates."""
        if not plate_files(recording.folder, recording.views):
            raise RecordingError(
                "without clean plates silhouettes can't tell the first pose",
                where=str(recording.folder / "background"),
                hint="put a picture of the empty room per camera there, or use start_from_file or start_from_keypoints",
            )

    def run(self, recording: Recording, scene: Scene) -> Start:
        """Return the pose of the first frame; the cloth starts without forces.

        Raises:
            RecordingError: there are no clean plates, or fewer than two cameras see a person in the first frame.
        """
        self.need(recording)
        found = first_trimaps(recording, scene.undressed)
        target = target_of(scene, self.draper, found, read(self.poses).on(scene.body.screw_names))
        ends = [target.searched(begin, number) for number, begin in enumerate(target.begins())]
        begins = [ends[row] for row in likely_headings(ends, target.costs(ends))]
        poses = [target.searched_again(begin, len(ends)) for begin in begins]
        off = target.costs(poses)
        best, *others = (poses[row] for row in likely_headings(poses, off))
        told = f"first pose: {1000 * off.min():.1f} mm off the silhouettes in the mean"
        if off.min() > FAR_M:
            LOG.warning(f"{told}: it may be wrong; {GO_ON}")
        else:
            LOG.info(told)
        if others:
            LOG.info("silhouettes hardly tell which way the person looks: the track tries %d ways", 1 + len(others))
        return Start(pose=best, parameters=scene.neutral_parameters, others=tuple(others))
