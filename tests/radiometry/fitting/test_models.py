"""The four models: forward, backward, and their slopes."""

import math

import numpy as np
import pytest

from radiometry.fitting.sources import (
    PARAMETER_NAMES,
    from_theta,
    invert,
    invert_gradient,
    linearise,
    predict,
    start,
)

PARAMETERS = {
    "proportional": (30.0,),
    "affine": (30.0, -4.0),
    "power": (28.0, 1.02),
    "semilog": (600.0, -900.0),
}
RHS = np.array([8.0, 20.0, 55.0])


def test_forward_by_hand():
    x = np.array([math.e**2])
    assert predict("proportional", np.array([2.0]), np.array([8.0]))[0] == 16.0
    assert predict("affine", np.array([2.0, 3.0]), np.array([8.0]))[0] == 19.0
    assert predict("power", np.array([2.0, 3.0]), np.array([4.0]))[0] == 128.0
    assert predict("semilog", np.array([5.0, 1.0]), x)[0] == pytest.approx(11.0)


@pytest.mark.parametrize("model", PARAMETER_NAMES)
def test_backward_undoes_forward(model):
    signals = predict(model, np.array(PARAMETERS[model]), RHS)
    assert [invert(model, PARAMETERS[model], float(signal)) for signal in signals] == pytest.approx(RHS)


@pytest.mark.parametrize("model", PARAMETER_NAMES)
def test_slopes_agree_with_differences(model):
    parameters, signal, step = PARAMETERS[model], 700.0, 1e-6
    by_signal, by_parameters = invert_gradient(model, parameters, signal)

    higher, lower = (invert(model, parameters, signal * (1 + sign * step)) for sign in (1, -1))
    assert by_signal == pytest.approx((higher - lower) / (2 * step * signal), rel=1e-6)
    for index, value in enumerate(parameters):
        up, down = list(parameters), list(parameters)
        up[index], down[index] = value * (1 + step), value * (1 - step)
        difference = (invert(model, up, signal) - invert(model, down, signal)) / (2 * step * value)
        assert by_parameters[index] == pytest.approx(difference, rel=1e-5)


@pytest.mark.parametrize("model", PARAMETER_NAMES)
def test_the_linear_problem_reproduces_points_on_the_curve(model):
    """Iterated to the end, the linearised problem of points on a curve has that curve's parameters."""
    signals = predict(model, np.array(PARAMETERS[model]), RHS)
    theta = start(model, RHS, signals)
    for _ in range(30):
        linear = linearise(model, RHS, signals, theta)
        theta = np.linalg.lstsq(linear.design, linear.response, rcond=None)[0]
    assert from_theta(model, theta) == pytest.approx(PARAMETERS[model], rel=1e-9)


def test_a_curve_below_dark_cannot_be_laid_out():
    assert linearise("affine", RHS, np.array([1.0, 2.0, 3.0]), np.array([1.0, -10.0])) is None


def test_no_inverse_is_not_a_number_and_no_exception():
    assert math.isinf(invert("semilog", (1e-3, 0.0), 1e6))
    assert math.isnan(invert("power", (30.0, 1.1), -5.0))
    assert math.isnan(invert("power", (30.0, 1.1), 0.0))
