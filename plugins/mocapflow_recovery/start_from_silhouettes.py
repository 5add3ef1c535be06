"""Stage `start_from_silhouettes`: the first pose from what differs from the empty room; no file, no keypoints."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from typing import ClassVar, NamedTuple

import numpy as np
from mocapflow_draping.kinematic import Kinematic
from mocapflow_priors.density import Poses, read
from mocapflow_priors.parzen import SHIPPED

from mocapflow.components import Stage
from mocapflow.data import NO_CLOTH, Past, Pose, Start
from mocapflow.dressing.roles import Draper
from mocapflow.errors import RecordingError
from mocapflow.io.recording.plates import plate_files
from mocapflow.model import ClothedModel
from mocapflow.recordings.recording import Recording
from mocapflow.records import F64
from mocapflow.scene import Scene
from mocapflow_recovery.candidates import farthest_points, likely_headings, separate_minima
from mocapflow_recovery.disagreement import HANGING
from mocapflow_recovery.placing import centred, largest_changes, mask_centre, placed
from mocapflow_recovery.sampling import SHARES, Plan, Spread, search
from mocapflow_recovery.scoring import FACES, Scorer
from mocapflow_recovery.trimaps import small_rooms, trimaps

LOG = logging.getLogger("mocapflow")
NEAR_M = 0.6  # what differs from the room farther from somebody who stands upright there is somebody else
SPREAD = Spread(angle=np.radians(25.0), turn=np.radians(12.0), shift=0.06)  # of the first samples
SAMPLES, SEEN_SAMPLES = 40, 60  # of each part in a round, and of each limb as it was seen
CANDIDATES = 24  # of the poses that people were seen in, as unlike each other as can be; standing upright is the first
DIRECTIONS = 16  # in which each of them is turned
SEARCHES = 4  # from the best pose of as many directions
REPEATS = 4  # of those that may be right, as far as that helps
NATURAL = np.radians(20.0)  # a pose so far in each angle from all that were seen counts as twice as far off
ENOUGH = 0.95  # times the cost before: a search that gains less is the last
FAR_M = 0.008  # off the silhouettes: right poses were at most 0.006 off, most wrong ones farther than this
GO_ON = "begin where the person stands freely and in all pictures, or use start_from_file or start_from_keypoints"


class Target(NamedTuple):
    """What poses are compared with."""

    scorer: Scorer  # of the clothed person, by the views
    middle: F64  # (3,) m, where the rays through the middles of the silhouettes meet
    seen: F64  # (N, D) rad, poses that people were seen in; NaN where an angle is not known

    def begins(self) -> list[Pose]:
        """Return the best poses of some directions, best first."""
        turns = np.linspace(0, 2 * np.pi, DIRECTIONS, endpoint=False)
        angles = farthest_points(np.nan_to_num(self.seen), CANDIDATES)
        bare, cameras = self.scorer.coarse.undressed, [trimap.camera for trimap in self.scorer.trimaps]

        def there(turn: float, bent: F64) -> Pose:
            return centred(placed(bare, turn, bent, self.middle), bare, self.middle, cameras)

        poses = [[there(turn, bent) for bent in angles] for turn in turns]
        off = np.array([self.costs(those) for those in poses])
        return [poses[turn][int(off[turn].argmin())] for turn in separate_minima(off.min(axis=1), SEARCHES)]

    def searched(self, begin: Pose, seed: int) -> Pose:
        """Return the best pose that is found around one."""
        plan = Plan(SPREAD, SHARES, SAMPLES, self.seen, SEEN_SAMPLES)
        return search(self.costs, begin, self.scorer.coarse.body, plan, np.random.default_rng(seed))

    def searched_again(self, pose: Pose, seed: int) -> Pose:
        """Return the pose that is searched again and again from one, as long as that helps; by seeds from `seed` on."""
        least = float(self.costs([pose])[0])
        for again in range(REPEATS):
            pose = self.searched(pose, seed + again)
            before, least = least, float(self.costs([pose])[0])
            if least > ENOUGH * before:
                break
        return pose

    def costs(self, poses: Sequence[Pose]) -> F64:
        """Return how far poses (B,) are from the silhouettes, m per unit of the person's area.

        They count as farther the farther they are from all that people were seen in.
        """
        known = np.concatenate([np.zeros((1, self.seen.shape[1])), np.nan_to_num(self.seen)])
        unusual = [np.sqrt(((known - pose.angles) ** 2).mean(axis=1).min()) for pose in poses]
        return np.asarray(self.scorer.distances(poses) * (1 + np.array(unusual) / NATURAL))


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
        target = self._target(recording, scene)
        ends = [target.searched(begin, number) for number, begin in enumerate(target.begins())]
        begins = [ends[row] for row in likely_headings(ends, target.costs(ends))]
        found = [target.searched_again(begin, len(ends)) for begin in begins]
        off = target.costs(found)
        best, *others = (found[row] for row in likely_headings(found, off))
        told = f"first pose: {1000 * off.min():.1f} mm off the silhouettes in the mean"
        if off.min() > FAR_M:
            LOG.warning(f"{told}: it may be wrong; {GO_ON}")
        else:
            LOG.info(told)
        if others:
            LOG.info("silhouettes hardly tell which way the person looks: the track tries %d ways", 1 + len(others))
        return Start(pose=best, parameters=scene.neutral_parameters, others=tuple(others))

    def _target(self, recording: Recording, scene: Scene) -> Target:
        frame, background = recording.frame(recording.indices[0]), recording.background()
        assert background is not None
        dressed, rooms = scene if self.draper else scene.undressed, small_rooms(background, scene.cameras)
        coarse = dressed.simplified(FACES)
        bare = coarse.undressed
        upright = placed(bare, 0.0, np.zeros(len(bare.body.twists)), mask_centre(*largest_changes(frame, rooms)))
        every = trimaps(frame, bare.surface(upright, NO_CLOTH), rooms, NEAR_M)
        found = [trimap for trimap in every if trimap.informative]
        if len(found) < 2:
            raise RecordingError(
                f"frame {frame.index}: fewer than two cameras show a person who is not in their clean plates",
                where=str(recording.folder),
                hint="begin where two cameras see all of the person; do plates and videos show the same room?",
            )
        model = ClothedModel(scene=dressed, draper=self.draper)
        scorer = Scorer(model, coarse, found, scene.neutral_parameters, Past(), start=None, cloth_weight=HANGING)
        middle = mask_centre([trimap.person for trimap in found], [trimap.camera for trimap in found])
        return Target(scorer, middle, read(self.poses).on(scene.body.screw_names))
