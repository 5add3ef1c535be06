"""Figure 12.11: strands alone part beside a raised knee; re-constraining the rings closes the skirt again.

Run `python examples/fig_12_11_rings.py [PICTURE.png]`.
"""

from __future__ import annotations

from figures import clothed, draped, posed, write
from mocapflow_draping.kinematic import Kinematic
from mocapflow_report.portrait import portrait


def main() -> None:
    """Write the panels."""
    scene = clothed("skirt_steps")
    pose = posed(scene, hip_l=65, knee_l=70)
    titles = {0: "strands alone", 4: "4 sweeps of the rings", 10: "10 sweeps", 40: "40 sweeps"}
    write({title: portrait(scene, pose, draped(Kinematic(sweeps=n), scene, pose)) for n, title in titles.items()})


if __name__ == "__main__":
    main()
