"""Figure 12.12: wind from the front and from behind, on a skirt and on shorts.

Run `python examples/fig_12_12_wind.py [PICTURE.png]`.
"""

from __future__ import annotations

from figures import clothed, draped, posed, write
from mocapflow_draping.kinematic import Kinematic
from mocapflow_report.portrait import portrait

TILT = 0.4  # rad, of the tails; a person at rest looks along -y, so wind from the front blows along +y


def main() -> None:
    """Write the panels."""
    panels = {}
    for garment in ("skirt", "shorts"):
        scene = clothed(f"{garment}_steps")
        pose = posed(scene)
        for title, tilt in (("no wind", 0.0), ("from the front", TILT), ("from behind", -TILT)):
            blown = draped(Kinematic(), scene, pose, wind_sin_rad=tilt)
            panels[f"{garment}: {title}"] = portrait(scene, pose, blown, bearing_deg=75)
    write(panels)


if __name__ == "__main__":
    main()
