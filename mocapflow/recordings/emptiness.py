"""Whether what is taken for the empty scene is empty: a median over a recording has whoever stays in place in it."""

from __future__ import annotations

import logging

import numpy as np

from mocapflow.assets import Background, Camera
from mocapflow.data import NO_CLOTH, Frame, Start, Surface
from mocapflow.geometry.silhouettes import mask, outline
from mocapflow.recordings.recording import Recording
from mocapflow.records import F64
from mocapflow.scene import Scene

LOG = logging.getLogger("mocapflow")
ALIKE = 3.0  # standard deviations within which a pixel looks like the empty scene
NOISE = 3.0  # grey levels, the least standard deviation
CORE = 0.25  # of the depth of the silhouette: nearer to its rim may be the room, where the pose is somewhat off
MOST = 0.4  # of the person may look like the scene behind: clean plates have up to 0.15, a median with them 0.62 up


def believable(background: Background, recording: Recording, start: Start, scene: Scene) -> bool:
    """Return whether the empty scene is empty where the person is known to be, in the first frame; else say so."""
    if not background.assumed:
        return True
    frame = recording.frame(recording.indices[0])
    surface = scene.undressed.surface(start.pose, NO_CLOTH)
    views = np.flatnonzero(frame.usable).tolist()
    if all(share_alike(background, frame, surface, scene.cameras[c], c) <= MOST for c in views):
        return True
    LOG.warning(
        "the person stands in what was taken for the empty scene, so it is not used: outlines are rougher, and limbs"
        " that are lost are not looked for; give clean plates, or a recording in which the person moves about"
    )
    return False


def share_alike(background: Background, frame: Frame, surface: Surface, camera: Camera, view: int) -> float:
    """Return which share of the person's core looks like the empty scene in a view; 0 where none is in the picture."""
    import cv2

    depth = cv2.distanceTransform(mask(outline(surface, camera), camera).view(np.uint8), cv2.DIST_L2, 3)
    core = depth > CORE * depth.max()
    if not core.any():
        return 0.0
    spread = np.maximum(background.spread[view][core], NOISE)
    off: F64 = (frame.images[view][core] - background.mean[view][core]) / spread
    return float(np.mean((np.abs(off) < ALIKE).all(axis=1)))
