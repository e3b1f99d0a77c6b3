"""Changes of K during a flight that no file states: a sensor that drifts, light that is modelled wrongly."""

from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Change = Literal["none", "walk", "ramp", "step", "light"]

_HALF_HOUR_S = 1800.0
_SETTLING_S = 300.0


def draw_change(
    random: np.random.Generator, times_s: Sequence[float], *, kind: Change, size_rel: float
) -> NDArray[np.float64]:
    """Draw ln K against its mean at rising times.

    Parameters
    ----------
    random : Generator
        Source of randomness.
    times_s : sequence of float
        Times [s], rising.
    kind : Change
        "walk": a random walk of the sensor; "ramp": a steady drift; "step": a jump at a random time;
        "light": errors of the light that are forgotten in five minutes.
    size_rel : float
        Standard deviation: of the change in half an hour (walk, ramp), of the jump, or of the light.
    """
    at = np.asarray(times_s, dtype=np.float64)
    steps_s = np.diff(at, prepend=at[0])
    noise = random.standard_normal(at.size)
    if kind == "walk":
        return np.asarray(np.cumsum(noise * size_rel * np.sqrt(steps_s / _HALF_HOUR_S)))
    if kind == "ramp":
        return np.asarray(noise[0] * size_rel * (at - at[0]) / _HALF_HOUR_S)
    if kind == "step":
        return np.asarray(noise[0] * size_rel * (at > random.uniform(at[0], at[-1])))
    if kind == "light":
        kept = np.exp(-steps_s / _SETTLING_S)
        error = noise * size_rel
        for each in range(1, at.size):
            error[each] = kept[each] * error[each - 1] + np.sqrt(1.0 - kept[each] ** 2) * error[each]
        return np.asarray(error)
    return np.zeros(at.size)
