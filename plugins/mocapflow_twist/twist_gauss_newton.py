"""Pose from matches by twists: Gauss–Newton with Levenberg–Marquardt damping, priors and re-matching."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np
from pydantic import NonNegativeFloat, NonNegativeInt, PositiveFloat, PositiveInt

from mocapflow.components import PoseSolver, Prior
from mocapflow.data import Estimate, FrameState, Matches, Past, Pose, Residual, Surface, Turn
from mocapflow.model import ClothedModel
from mocapflow.records import F64
from mocapflow_twist import steps
from mocapflow_twist.constraint import image_rows, line_rows
from mocapflow_twist.covariance import covariance, effective_share, observed, view_balance
from mocapflow_twist.motion import ClothMotion, Guess
from mocapflow_twist.normal_equations import Equations
from mocapflow_twist.problem import Anchor, Data, Problem, Quadratic

LINE_SIGMA = 0.003  # m, standard deviation of the distance to a projection ray, of a match known to one pixel
TRIALS = 8  # times that the damping is raised before a step is given up
LEAST_GAIN = 1e-14  # share of the energy below which a step is only rounding
FIRST_DAMPING_PER_TURN = 0.3  # factor of the first damping at each further turn: gentle, then exact


class TwistGaussNewton(PoseSolver):
    """Gauss–Newton on twists: moves the pose until matched surface points meet their image points.

    Rosenhahn 2008, section 12.2.2. The chapter's own choice is residual: line with steps_per_match: 4, all
    pairs independent: correlation_px: 0.
    """

    name = "twist_gauss_newton"

    iterations: PositiveInt = 10  # times that matches are found anew, at most
    far_iterations: NonNegativeInt = 0  # stands for iterations, if more, in a frame that begins far off
    steps_per_match: PositiveInt = 1  # steps with the same matches
    residual: Literal["image", "line"] = "image"  # distances in pixels, or to projection rays in space
    damping: NonNegativeFloat = 1e-4  # least damping, share of the mean diagonal; ten times more after a worse step
    damping_per_turn: PositiveFloat = 1.0  # factor on it at each turn of the loop: above 1, first exact, then gentle
    first_damping: NonNegativeFloat = 0.0  # least damping in the first turn of a first frame, whose start is far off
    cap_deg: PositiveFloat = 10.0  # largest change of an angle, and turn of the root, in a step
    cap_mm: PositiveFloat = 100.0  # largest shift of the root in a step
    correlation_px: NonNegativeFloat = 15.0  # length over which contour errors agree; 0: independent
    balance_views: bool = False  # gives every view the same weight
    cloth_unknowns: bool = False  # also solves for the cloth parameters
    root_sd_m: PositiveFloat = 0.1  # standard deviation of the root's place about where the turn of the loop began
    root_sd_deg: PositiveFloat = 11.5  # standard deviation of its orientation about where the turn of the loop began
    angle_sd_deg: PositiveFloat = 60.0  # standard deviation of joint angles about where the turn of the loop began
    cloth_sd: PositiveFloat = 0.06  # standard deviation of cloth parameters about a calm garment, share of their range
    stop_sigmas: NonNegativeFloat = 0.02  # smaller steps are not taken; standard deviations, RMS over the unknowns

    def solve(
        self,
        match: Callable[[Surface], Matches],
        state: FrameState,
        model: ClothedModel,
        priors: Sequence[Prior],
        past: Past,
        turn: Turn,
    ) -> Estimate:
        """Return the pose that explains the matches best, its covariance, and what the images told of it."""
        guess = Guess(state.estimate.pose, state.cloth)
        motion = ClothMotion(model, past, self.cloth_unknowns)
        anchor = Anchor(with_neutral_cloth(guess, model), self._anchor_precision(motion, guess))
        surface, damping = model.surface(guess.pose, guess.cloth), self._least_damping(past, turn)
        tried: dict[Pose, Sequence[Residual]] = {}
        found: Quadratic | None = None  # the last quadratic models, for the covariance
        for _ in range(max(self.iterations, self.far_iterations) if turn.far else self.iterations):
            matches, found = match(surface), None
            problem = Problem(motion, self._data(matches, model), priors, anchor, tried)
            if problem.data.measurements == 0:
                break
            before = guess
            for _ in range(self.steps_per_match):
                found = problem.quadratic(guess)
                guess, damping = self._descend(problem, guess, found.total, damping)
                damping = max(damping, self._least_damping(past, turn))
            if guess is before:
                break
            surface = model.surface(guess.pose, guess.cloth)
        return self._estimate(problem, guess, found or problem.quadratic(guess), matches)

    def _data(self, matches: Matches, model: ClothedModel) -> Data:
        """Return the matches as rows, weighted by how many independent measurements they hold."""
        cameras = model.scene.cameras
        line = self.residual == "line"
        rows = line_rows(matches, cameras, LINE_SIGMA) if line else image_rows(matches, cameras)
        share = effective_share(matches, self.correlation_px)
        balance = view_balance(matches, share) if self.balance_views else np.ones(len(share))
        weight = rows.weight * (share * balance).take(rows.match)
        used = np.isfinite(weight) & (weight > 0)
        components = 2 / 3 if line else 1.0  # of the three components of X x n - m, two are independent
        body = len(model.scene.body.vertices)
        return Data(
            body=rows.part(used & (rows.vertex < body), weight),
            cloth=rows.part(used & (rows.vertex >= body), weight, body),
            measurements=components * float(share.take(rows.match)[used].sum()),
        )

    def _least_damping(self, past: Past, turn: Turn) -> float:
        """Return the damping of a step at least, in a turn of the loop: more in a first frame."""
        least = self.damping * self.damping_per_turn**turn.index
        if past.moments:
            return least
        return max(least, self.first_damping * FIRST_DAMPING_PER_TURN**turn.index)

    def _anchor_precision(self, motion: ClothMotion, guess: Guess) -> F64:
        """Return one over the variance of each unknown (S,) about where the turn of the loop began."""
        turn, bend = np.radians(self.root_sd_deg), np.radians(self.angle_sd_deg)
        pose = np.repeat([turn, self.root_sd_m, bend], [3, 3, len(guess.pose.angles)])
        cloth = self.cloth_sd * np.ptp(motion.bounds, axis=1)
        return np.concatenate([pose, np.maximum(cloth, 1e-12)]) ** -2.0

    def _descend(self, problem: Problem, guess: Guess, equations: Equations, damping: float) -> tuple[Guess, float]:
        """Return a guess of lower energy for the same matches, or the same guess where there is none worth a step."""
        motion, angles = problem.motion, len(guess.pose.angles)
        equations = motion.within_bounds(equations, guess)
        lever = steps.levers(angles, np.ptp(motion.bounds, axis=1))
        least = max(LEAST_GAIN * equations.energy, 0.5 * problem.unknowns * self.stop_sigmas**2)
        for _ in range(TRIALS):
            increment = steps.step(equations, lever, damping)
            increment = steps.capped(increment, angles, np.radians(self.cap_deg), self.cap_mm / 1000)
            if steps.gain(equations, increment) <= least:
                return guess, damping
            trial = motion.moved(guess, steps.about_origin(problem.centre(guess), len(increment)) @ increment)
            if sum(problem.energies(trial).values()) <= equations.energy:
                return trial, steps.LOWERED * damping
            damping = max(steps.RAISED * damping, 1e-6)
        return guess, damping

    def _estimate(self, problem: Problem, guess: Guess, found: Quadratic, matches: Matches) -> Estimate:
        """Return where the solver ended; increments there are about the root, of an estimate about the origin."""
        data, prior = found
        about_root = covariance(data.hessian, prior.hessian, data.energy, problem.data.measurements)
        to_origin = steps.about_origin(problem.centre(guess), problem.unknowns)
        return Estimate(
            pose=guess.pose,
            parameters=np.array(guess.cloth.parameters),
            covariance=to_origin @ about_root @ to_origin.T,
            observed=observed(about_root, prior.hessian)[6 : 6 + len(guess.pose.angles)],
            matches=matches,
        )


def with_neutral_cloth(guess: Guess, model: ClothedModel) -> Guess:
    """Return a guess whose garment hangs without forces: where its parameters are held, however they came about."""
    return Guess(guess.pose, replace(guess.cloth, parameters=model.scene.neutral_parameters))
