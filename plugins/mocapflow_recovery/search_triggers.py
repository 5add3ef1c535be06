"""What triggers a search: images that contradict a fit, or a fit so odd that images need not contradict it."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from typing import NamedTuple

import numpy as np
from mocapflow_priors.density import Density
from pydantic import PositiveFloat

from mocapflow.assets import Body
from mocapflow.components import Recovery
from mocapflow.data import REMEMBERED, Past, Pose
from mocapflow.records import I32
from mocapflow.settings import PositiveOrInf
from mocapflow_recovery.leaps import leaping, overbent
from mocapflow_recovery.scoring import Mismatch

OVERBENT = np.radians(5.0)  # a joint so far beyond its soft limits is looked for: lost limbs go there


class Trigger(NamedTuple):
    """Why limbs are looked for, and which."""

    reason: str
    doubtful: bool  # the images contradict the fit
    limbs: Sequence[I32]  # none: all


class TriggeredSearch(Recovery):
    """A recovery that looks for limbs where the images contradict a fit, or where it is odd."""

    uncovered_cm2: PositiveFloat = 30.0  # area of the person off the model, all views, above which the fit is doubted
    floating_cm2: PositiveFloat = 30.0  # area of skin in empty space above which the fit is doubted
    hint_cm2: PositiveOrInf = inf  # area of the person 3 cm off it above which limbs are looked for; noise has some
    beginnings: bool = True  # look for limbs in the first frame, and in the first one after a gap
    leap_deg: PositiveOrInf = 20.0  # a limb so far from what was predicted and from all `poses` is looked for

    def doubtful(self, mismatch: Mismatch) -> bool:
        """Return whether the images contradict a fit."""
        return mismatch.uncovered > self.uncovered_cm2 or mismatch.floating > self.floating_cm2

    def trigger(
        self, mismatch: Mismatch, fitted: Pose, predicted: Pose, past: Past, body: Body, density: Density
    ) -> Trigger | None:
        """Return why limbs are to be looked for, if they are.

        Cloth off the model is no contradiction, for it may fly; but a raised knee may hold it there. A joint that is
        bent too far, or a limb that leapt, is looked for alone: nothing is known against the others.

        Args:
            mismatch: of the fit.
            fitted: its pose.
            predicted: the pose before the images were looked at.
            past: of the frame.
            body: of both poses.
            density: its training poses are what people were seen in.
        """
        reason, limbs, doubtful = "", list[I32](), self.doubtful(mismatch)
        if doubtful:
            reason = f"fit doubted, {mismatch}"
        elif mismatch.uncovered + mismatch.cloth > self.uncovered_cm2:
            reason = f"cloth off the model, {mismatch}"
        elif mismatch.hint > self.hint_cm2:
            reason = f"{mismatch.hint:.0f} cm² of the person a little off the model"
        elif self.beginnings and not past.moments:
            reason = f"looked for the limbs {'after a gap' if past.after_gap else 'of a first frame'}"
        elif limbs := overbent(fitted, body, OVERBENT):
            reason = "a joint is bent beyond its limits"
        elif limbs := leaping(fitted, predicted, body, density, np.radians(self.leap_deg)):
            reason = "a limb leapt into a pose that nobody was seen in"
        return Trigger(reason, doubtful, limbs) if reason else None


def stay_overbent(past: Past, body: Body) -> bool:
    """Return whether all frames that are remembered have a joint beyond its limits."""
    bent = [bool(overbent(moment.pose, body, OVERBENT)) for moment in past.moments]
    return len(bent) == REMEMBERED and all(bent)
