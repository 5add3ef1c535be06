"""Figure 12.13: the garment fitted to an image without forces, and with them; the overlap of model and image.

Run `python examples/fig_12_13_forces.py [PICTURE.png]`: it fits the first frame of the demo clip, twice.
"""

from __future__ import annotations

import cv2
import numpy as np
from figures import first_frame, write
from mocapflow_report.overlay import Painter

from mocapflow.functional import overlaps
from mocapflow.geometry.cameras import project

CHANGES = ("stages.track.pose_solver.cloth_unknowns=false", "stages.track.cloth_fitter={fitter}")
FITTERS = {"without forces": "fixed", "with forces": "sampled_forces"}
VIEWS = (1, 3)
ENLARGED = 3
HALF = 210  # px, of a panel


def main() -> None:
    """Write the panels."""
    panels = {}
    for title, fitter in FITTERS.items():
        model, frame, state = first_frame(tuple(change.format(fitter=fitter) for change in CHANGES))
        surface = model.surface(state.estimate.pose, state.cloth)
        agreement = overlaps(surface, state.segmentation, model.scene.cameras)
        for view in VIEWS:
            camera, cloth = model.scene.cameras[view], state.cloth.vertices
            image = cv2.resize(frame.images[view], None, fx=ENLARGED, fy=ENLARGED, interpolation=cv2.INTER_CUBIC)
            image = np.asarray(image, np.uint8)
            Painter(model.scene).draw(image, camera, ENLARGED, state.estimate.pose, cloth)
            x, y = (ENLARGED * project(cloth, camera).mean(axis=0)).astype(int)
            part = image[y - HALF : y + HALF, x - HALF : x + HALF].copy()
            panels[f"{title}: overlap {agreement[view]:.3f}"] = part
    write(panels)


if __name__ == "__main__":
    main()
