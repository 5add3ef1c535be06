"""What the silhouettes of the first frame tell of a pose, and the search for poses that agree with them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from mocapflow.data import NO_CLOTH, Past, Pose
from mocapflow.dressing.roles import Draper
from mocapflow.errors import RecordingError
from mocapflow.model import ClothedModel
from mocapflow.recordings.recording import Recording
from mocapflow.records import F64
from mocapflow.scene import Scene
from mocapflow_recovery.candidates import farthest_points, separate_minima
from mocapflow_recovery.disagreement import HANGING
from mocapflow_recovery.placing import centred, largest_changes, mask_centre, placed
from mocapflow_recovery.sampling import SHARES, Plan, Spread, search
from mocapflow_recovery.scoring import FACES, Scorer
from mocapflow_recovery.trimaps import Trimap, small_rooms, trimaps

NEAR_M = 0.6  # what differs from the room farther from somebody who stands upright there is somebody else
SPREAD = Spread(angle=np.radians(25.0), turn=np.radians(12.0), shift=0.06)  # of the first samples
SAMPLES, SEEN_SAMPLES = 40, 60  # of each part in a round, and of each limb as it was seen
CANDIDATES = 24  # of the poses that people were seen in, as unlike each other as can be; standing upright is the first
DIRECTIONS = 16  # in which each of them is turned
SEARCHES = 4  # from the best pose of as many directions
REPEATS = 4  # of those that may be right, as far as that helps
NATURAL = np.radians(20.0)  # a pose so far in each angle from all that were seen counts as twice as far off
ENOUGH = 0.95  # times the cost before: a search that gains less is the last


class Target(NamedTuple):
    """What poses are compared with."""

    scorer: Scorer  # of the clothed person, by the views
    middle: F64  # (3,) m, where the rays through the middles of the silhouettes meet
    seen: F64  # (N, D) rad, poses that people were seen in; NaN where an angle is not known

    def begins(self) -> list[Pose]:
        """Return the best poses of some directions, best first."""
        turns = np.linspace(0, 2 * np.pi, DIRECTIONS, endpoint=False)
        angles, bare = farthest_points(np.nan_to_num(self.seen), CANDIDATES), self.scorer.coarse.undressed
        poses = [[self.centred(placed(bare, turn, bent, self.middle)) for bent in angles] for turn in turns]
        off = np.array([self.costs(those) for those in poses])
        return [poses[turn][int(off[turn].argmin())] for turn in separate_minima(off.min(axis=1), SEARCHES)]

    def centred(self, pose: Pose) -> Pose:
        """Return a pose moved to where the silhouettes are."""
        cameras = [trimap.camera for trimap in self.scorer.trimaps]
        return centred(pose, self.scorer.coarse.undressed, self.middle, cameras)

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


def first_trimaps(recording: Recording, bare: Scene) -> list[Trimap]:
    """Return what the views tell that show in the first frame somebody who is not in their clean plates.

    Raises:
        RecordingError: there are fewer than two of them.
    """
    frame, background = recording.frame(recording.indices[0]), recording.background()
    assert background is not None
    rooms = small_rooms(background, bare.cameras)
    upright = placed(bare, 0.0, np.zeros(len(bare.body.twists)), mask_centre(*largest_changes(frame, rooms)))
    every = trimaps(frame, bare.surface(upright, NO_CLOTH), rooms, NEAR_M)
    found = [trimap for trimap in every if trimap.informative]
    if len(found) < 2:
        raise RecordingError(
            f"frame {frame.index}: fewer than two cameras show a person who is not in their clean plates",
            where=str(recording.folder),
            hint="begin where two cameras see all of the person; do plates and videos show the same room?",
        )
    return found


def target_of(scene: Scene, draper: Draper | None, found: Sequence[Trimap], seen: F64) -> Target:
    """Return what poses (the angles of those that people were `seen` in: (N, D)) of a person are compared with.

    Without a draper clothes are left out.
    """
    dressed = scene if draper else scene.undressed
    model = ClothedModel(scene=dressed, draper=draper)
    coarse, cloth = dressed.simplified(FACES), scene.neutral_parameters
    scorer = Scorer(model, coarse, found, cloth, Past(), start=None, cloth_weight=HANGING)
    return Target(scorer, mask_centre([trimap.person for trimap in found], [trimap.camera for trimap in found]), seen)
