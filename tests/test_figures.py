"""T-OUT5: the figures of the drape are written by their scripts, and every panel shows a drape of its own."""

import subprocess
import sys
from itertools import combinations
from pathlib import Path

import cv2
import numpy as np
import pytest

EXAMPLES = Path(__file__).parents[1] / "examples"
PANELS = {"08_plane": 4, "09_skirt": 4, "10_shorts": 4, "11_rings": 4, "12_wind": 6}
TITLE = 40  # px from the top
CHANGED = 30  # grey levels


@pytest.mark.long
@pytest.mark.parametrize(("figure", "count"), PANELS.items(), ids=list(PANELS))
def test_a_figure_of_the_drape_is_written(figure, count, tmp_path):
    picture = tmp_path / "figure.png"
    subprocess.run([sys.executable, EXAMPLES / f"fig_12_{figure}.py", picture], check=True, capture_output=True)
    panels = np.split(cv2.imread(str(picture)).astype(int)[TITLE:], count, axis=1)
    differing = [int((np.abs(a - b).max(axis=2) > CHANGED).sum()) for a, b in combinations(panels, 2)]
    print("pixels by which panels differ:", sorted(differing))
    assert min(differing) > 200
