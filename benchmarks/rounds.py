"""Actions timed in turn, so that a machine that is busy for a while is busy for all of them."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping

import numpy as np

WARM_UP = 2  # rounds that compile and load, and do not count


def cpu_ms(actions: Mapping[str, Callable[[], object]], rounds: int) -> dict[str, float]:
    """Return the median CPU ms of each action over rounds of all of them."""
    spent: dict[str, list[float]] = {name: [] for name in actions}
    for number in range(WARM_UP + rounds):
        for name, action in actions.items():
            begin = time.process_time()
            action()
            spent[name] += [1e3 * (time.process_time() - begin)] if number >= WARM_UP else []
    return {name: float(np.median(values)) for name, values in spent.items()}
