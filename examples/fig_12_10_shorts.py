"""Figure 12.10: shorts, two tubes joined at the hip, on a person who stands, steps and raises a knee.

Run `python examples/fig_12_10_shorts.py [PICTURE.png]`.
"""

from __future__ import annotations

from figures import clothed, draped, posed, write
from mocapflow_draping.kinematic import Kinematic
from mocapflow_report.portrait import portrait


def main() -> None:
    """Write the panels."""
    scene = clothed("shorts_steps")
    poses = {
        "standing": posed(scene),
        "a step": posed(scene, hip_l=30, knee_l=25, hip_r=-15, knee_r=15),
        "knee raised": posed(scene, hip_l=65, knee_l=70),
        "thigh level": posed(scene, hip_l=90, knee_l=90),
    }
    write({title: portrait(scene, pose, draped(Kinematic(), scene, pose)) for title, pose in poses.items()})


if __name__ == "__main__":
    main()
