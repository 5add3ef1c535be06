"""What calls for a search: images that contradict a fit, or a fit so odd that images need not contradict it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from mocapflow_priors.density import Density

from mocapflow.assets import Body
from mocapflow.data import REMEMBERED, Past, Pose
from mocapflow.records import I32
from mocapflow_recovery.judge import Stray
from mocapflow_recovery.leaps import leaping, overbent

OVERBENT = np.radians(5.0)  # a joint so far beyond its soft limits is looked for: lost limbs go there


class Signs(NamedTuple):
    """Thresholds above which something about a fit is odd."""

    uncovered: float  # cm² of the person off the model
    floating: float  # cm² of skin in empty space
    hint: float  # cm² of the person a little off the model
    beginnings: bool  # a frame without one before it
    leap: float  # rad, from what was believed and from all that was seen

    def doubtful(self, stray: Stray) -> bool:
        """Return whether the images contradict a fit."""
        return stray.uncovered > self.uncovered or stray.floating > self.floating

    def stay_bent(self, past: Past, body: Body) -> bool:
        """Return whether all frames that are remembered have a joint beyond its limits."""
        bent = [bool(overbent(moment.pose, body, OVERBENT)) for moment in past.moments]
        return len(bent) == REMEMBERED and all(bent)


class Suspicion(NamedTuple):
    """Why limbs are looked for, and which."""

    why: str
    doubtful: bool  # the images contradict the fit
    limbs: Sequence[I32]  # none: all


def suspicion(
    signs: Signs, stray: Stray, fitted: Pose, believed: Pose, past: Past, body: Body, density: Density
) -> Suspicion | None:
    """Return why limbs are to be looked for, if they are.

    Cloth that strays is no contradiction, for it may fly; but a raised knee may hold it there. A joint that is bent too
    far, or a limb that leapt, is looked for alone: nothing is known against the others.

    Args:
        signs: what is odd.
        stray: what strays of the fit.
        fitted: its pose.
        believed: the pose that was believed before looking.
        past: of the frame.
        body: of both poses.
        density: its training poses are what people were seen in.
    """
    why, limbs, doubtful = "", list[I32](), signs.doubtful(stray)
    if doubtful:
        why = f"fit doubted, {stray}"
    elif stray.uncovered + stray.cloth > signs.uncovered:
        why = f"cloth off the model, {stray}"
    elif stray.near > signs.hint:
        why = f"{stray.near:.0f} cm² of the person a little off the model"
    elif signs.beginnings and not past.moments:
        why = f"looked for the limbs {'after a gap' if past.after_gap else 'of a first frame'}"
    elif limbs := overbent(fitted, body, OVERBENT):
        why = "a joint is bent beyond its limits"
    elif limbs := leaping(fitted, believed, body, density, signs.leap):
        why = "a limb leapt into a pose that nobody was seen in"
    return Suspicion(why, doubtful, limbs) if why else None
