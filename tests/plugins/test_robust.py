"""Losses of pairs by their distance, and the threshold that their statistics set."""

from __future__ import annotations

import numpy as np
import pytest
from mocapflow_matching.robust import robust_weights, zhang_keeps


def test_robust_weights_at_their_scale() -> None:
    distance = np.array([0.0, 1.0, 2.0, 8.0])
    assert robust_weights(distance, "none", 2.0) == pytest.approx([1, 1, 1, 1])
    assert robust_weights(distance, "huber", 2.0) == pytest.approx([1, 1, 1, 0.25])
    assert robust_weights(distance, "geman_mcclure", 2.0) == pytest.approx([1, 0.64, 0.25, (4 / 68) ** 2])


def test_zhang_rejects_clutter_and_keeps_good_pairs() -> None:
    rng = np.random.default_rng(1)
    distance = np.concatenate([np.abs(rng.normal(0, 1, 300)), rng.uniform(15, 40, 30)])
    kept = zhang_keeps(distance, 2.0)
    assert kept[:300].all()
    assert kept[300:].mean() < 0.5


@pytest.mark.parametrize(("mean", "spreads"), [(0.9, 3), (1.1, 2), (2.9, 2), (3.1, 1), (5.9, 1)])
def test_zhang_keeps_as_many_standard_deviations_as_the_mean_is_good(mean: float, spreads: int) -> None:
    """The mean in units of D: below 1, 3 and 6 times D the limit is three, two and one standard deviations above it."""
    good, spread = 4.0, 0.1
    middle = np.resize([-1.0, 1.0], 800)
    tails = np.concatenate([np.full(2, s) for k in (0.8, 1.2, 1.8, 2.2, 2.8, 3.2) for s in (-k, k)])
    scaled = np.concatenate([middle, tails])
    distance = good * mean + spread * (scaled - scaled.mean()) / scaled.std()
    kept = zhang_keeps(distance, good)
    assert distance.mean() == pytest.approx(good * mean)
    assert kept.sum() == np.count_nonzero(distance <= good * mean + spreads * spread)
    assert distance[kept].max() > good * mean + (spreads - 1) * spread
    assert distance.max() > good * mean + 3 * spread


def test_zhang_finds_the_valley_when_everything_is_far() -> None:
    rng = np.random.default_rng(1)
    distance = np.concatenate([rng.normal(20, 1, 300), rng.normal(40, 1, 250)])  # one deviation above the mean: 39
    assert zhang_keeps(distance, 2.0).sum() == pytest.approx(300, abs=3)


def test_the_valley_is_where_the_histogram_first_rises_again_after_its_main_peak() -> None:
    counts = np.array([1, 0, 2, 5, 10, 4, 4, 1, 3, 6, *np.full(20, 1)])  # a plateau on the way down is none
    distance = np.repeat(np.arange(30) + 0.5, counts)
    distance[0], distance[-1] = 0.0, 30.0  # of thirty bins
    assert zhang_keeps(distance, 1.0).sum() == counts[:8].sum()


def test_of_no_pairs_none_is_kept() -> None:
    assert zhang_keeps(np.empty(0), 2.0).shape == (0,)
