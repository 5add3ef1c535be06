"""Figure 12.9: a skirt falls on a person with a knee raised, step by step of 2 degrees.

Run `python examples/fig_12_09_skirt.py [PICTURE.png]`.
"""

from __future__ import annotations

from figures import clothed, draped, posed, write
from mocapflow_draping.kinematic import Kinematic
from mocapflow_report.portrait import portrait


def main() -> None:
    """Write the panels."""
    scene = clothed("skirt_steps")
    pose = posed(scene, hip_l=65, knee_l=70)
    falling = {n: Kinematic(rule="literal", limited=True, sweeps=0, iterations=n) for n in (2, 12, 25, 50)}
    panels = {}
    for steps, draper in falling.items():
        panels[f"after {steps} steps"] = portrait(scene, pose, draped(draper, scene, pose), size=(440, 460))
    write(panels)


if __name__ == "__main__":
    main()
