"""Generalised least squares against cases whose answer is known in closed form."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from radiometry.fitting.components import Component, Problem, index_labels
from radiometry.fitting.gls import are_separable, estimate_variances, expect_variance, leave_groups_out, solve

ONES = np.ones((4, 1))


def independent(*sigmas, variance=1.0):
    return Component(source="noise", kind="A", sensitivity=np.array(sigmas, float), variance=variance)


def shared(labels, variance, *, sensitivity=1.0, source="shared"):
    labels = index_labels(list(labels))
    sensitivity = sensitivity * np.ones(labels.size)
    return Component(source=source, kind="B", sensitivity=sensitivity, labels=labels, variance=variance)


def estimate(design, response, *components):
    problem = Problem(design, response, components)
    variances, covariance = estimate_variances(problem)
    return variances[list(problem.unknown)], covariance


class Dense:
    """The same problem with its matrices written out."""

    def __init__(self, design, response, components, variances):
        self.design, self.response = design, response
        self.columns = [each.columns() for each in components]
        self.structures = [z @ z.T for z in self.columns]
        self.covariance = sum(v * q for v, q in zip(variances, self.structures, strict=True))
        inverse = np.linalg.inv(self.covariance)
        information = design.T @ inverse @ design
        self.weights = np.linalg.solve(information, design.T @ inverse)
        self.projection = inverse - inverse @ design @ self.weights
        self.variances = variances

    def check_estimates(self, unknown, covariance):
        """Newton's next step from here, relative to each variance."""
        p, left = self.projection, self.projection @ self.response
        structures = [self.structures[i] for i in unknown]
        slope = np.array([left @ q @ left - np.trace(p @ q) for q in structures]) / 2
        expected = np.array([[np.trace(p @ q @ p @ r) for r in structures] for q in structures]) / 2
        average = np.array([[left @ q @ p @ r @ left for r in structures] for q in structures])
        sizes = np.sqrt(np.outer(np.diag(covariance), np.diag(covariance)))
        np.testing.assert_allclose(covariance / sizes, np.linalg.inv(expected) / sizes, rtol=0, atol=1e-9)
        return np.linalg.solve(average - expected, slope) / [self.variances[i] for i in unknown]


@pytest.fixture
def campaign():
    """Readings, f-numbers and a scatter to estimate, a dark signal and times that are known: 48 points."""
    random = np.random.default_rng(8)
    n = 48
    scenes, f_numbers = random.integers(0, 7, n), random.integers(0, 5, n)
    design = np.column_stack([np.ones(n), random.normal(0, 1, n)])
    response = 3.4 + 0.02 * random.normal(size=7)[scenes] + 0.03 * random.normal(size=5)[f_numbers]
    response = response + random.normal(0, 0.004, n) + 0.2 * design[:, 1]
    return (
        design,
        response,
        [
            independent(*random.uniform(1e-3, 3e-3, n)),
            shared(np.zeros(n), 1e-6, sensitivity=random.uniform(0.1, 2, n), source="dark"),
            shared(scenes, None, sensitivity=random.uniform(0.5, 1, n), source="reading"),
            shared(f_numbers, None, sensitivity=2.0, source="f-number"),
            shared(random.integers(0, 2, n), 1e-5, source="time"),
            independent(*np.ones(n), variance=None),
        ],
    )


def test_the_solution_is_that_of_the_dense_matrices(campaign):
    design, response, components = campaign
    solution = solve(design, response, components)
    dense = Dense(design, response, components, solution.variances)
    assert min(solution.variances) > 0.0
    assert np.abs(dense.check_estimates([2, 3, 5], solution.covariance_of_estimates)).max() < 1e-9
    np.testing.assert_allclose(solution.weights, dense.weights, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(solution.parameters, dense.weights @ response, rtol=1e-9)
    for part, variance, q in zip(solution.contributions, solution.variances, dense.structures, strict=True):
        np.testing.assert_allclose(
            part, variance * dense.weights @ q @ dense.weights.T, rtol=1e-9, atol=1e-18
        )
    residual = response - design @ solution.parameters
    assert solution.chi_squared == pytest.approx(
        residual @ np.linalg.solve(dense.covariance, residual), rel=1e-9
    )
    density = multivariate_normal(design @ solution.parameters, dense.covariance).logpdf(response)
    assert solution.log_likelihood == pytest.approx(density, rel=1e-9)
    for index in (2, 3, 4):
        expected = solution.variances[index] * dense.columns[index].T @ dense.projection
        np.testing.assert_allclose(solution.predict(components[index]), expected, rtol=1e-9, atol=1e-12)
        errors, u = solution.factored.predict(index)
        np.testing.assert_allclose(errors, expected @ response, rtol=1e-6, atol=1e-12)
        left = np.eye(len(u)) - expected @ dense.columns[index]
        np.testing.assert_allclose(u**2, solution.variances[index] * np.diag(left), rtol=1e-6)


def test_an_error_that_the_points_know_far_better_than_its_prior():
    """v - v^2 z'P z has one digit left here, and another processor finds another one."""
    n = 6
    components = [independent(*np.ones(n)), shared(np.zeros(n), 1e14), shared(np.arange(n) // 2, 1e-4)]
    components[1] = replace(components[1], sensitivity=np.arange(n) - 2.5)
    slope = np.arange(n) - 2.5
    v = np.eye(n) + 1e-4 * np.kron(np.eye(3), np.ones((2, 2)))
    solution = solve(np.ones((n, 1)), 3.0 + 0.5 * slope, components)
    (error,), (u,) = solution.factored.predict(1)
    assert error == pytest.approx(0.5, rel=1e-12)
    assert u == pytest.approx(1 / np.sqrt(slope @ np.linalg.solve(v, slope)), rel=1e-12)


def test_the_effect_of_an_error_that_the_points_know_far_better_keeps_its_digits():
    """A'z / (n + v (n z'z - (A'z)^2)) with one parameter: the sum over the points cancels by 1 / v."""
    lever, variance = np.array([0.1, 0.2, 0.4, 0.7]), 1e12
    parts = (independent(1, 1, 1, 1), shared("aaaa", variance, sensitivity=lever))
    solution = solve(ONES, np.array([1.0, 2.0, 2.0, 4.0]), parts)
    total = lever.sum()
    expected = total / (4.0 + variance * (4.0 * lever @ lever - total**2))
    np.testing.assert_allclose(solution.contributions[1], variance * expected**2, rtol=1e-12)


def test_leaving_a_group_out_is_solving_without_it(campaign):
    design, response, components = campaign
    known = [replace(c, variance=1e-4 if c.variance is None else c.variance) for c in components]
    scenes = known[2].labels
    rest = leave_groups_out(design, response, known, scenes)
    assert len(rest) == scenes.max() + 1
    for scene, (parameters, predicted) in enumerate(rest):
        keep = scenes != scene
        dense = Dense(design, response, known, [c.variance for c in known])
        v, y, a = dense.covariance[np.ix_(keep, keep)], response[keep], design[keep]
        expected = np.linalg.solve(a.T @ np.linalg.solve(v, a), a.T @ np.linalg.solve(v, y))
        np.testing.assert_allclose(parameters, expected, rtol=1e-9)
        blup = 1e-4 * dense.columns[3][keep].T @ np.linalg.solve(v, y - a @ expected)
        np.testing.assert_allclose(predicted["f-number"], blup, rtol=1e-9, atol=1e-12)


def test_a_shared_error_does_not_average_down():
    common = shared("aaaa", 0.25)
    solution = solve(ONES, np.arange(4.0), [independent(1, 1, 1, 1), common])
    assert solution.covariance[0, 0] == pytest.approx(1 / 4 + 0.25)
    assert [float(part[0, 0]) for part in solution.contributions] == pytest.approx([1 / 4, 0.25])


def test_groups_are_gathered_and_spread_by_hand():
    part = shared((4.0, 1.7, 4.0), 1.0, sensitivity=np.array([2.0, 3.0, 5.0]))
    np.testing.assert_array_equal(part.columns(), [[0, 2], [3, 0], [0, 5]])
    np.testing.assert_array_equal(part.gather(np.array([1.0, 10.0, 100.0])), [30, 502])
    np.testing.assert_array_equal(part.spread(np.array([1.0, 10.0])), [20, 3, 50])


def test_no_variance_is_found_where_noise_explains_the_scatter():
    (found,), ((uncertainty,),) = estimate(
        ONES, np.array([0.0, 0.1, 0.0, 0.1]), independent(1, 1, 1, 1), shared("aabb", None)
    )
    assert found == 0.0
    assert uncertainty > 0.0


@pytest.mark.parametrize(
    ("labels", "separable"), [("aabb", True), ("abcc", True), ("abcd", False), ("aaaa", False)]
)
def test_variances_are_told_apart_where_some_points_share_an_error_and_others_do_not(labels, separable):
    components = [shared(labels, None), independent(1, 1, 1, 1)]
    assert are_separable(ONES, components) is separable
    assert are_separable(ONES, components[1:])


def test_variance_to_expect_by_hand():
    """Five values of noise 1: information (n - 1) / 2 = 2 at no scatter, score (S - (n - 1)) / 2.

    A sum of squares S of 4 is what noise makes, and half of N(0, 1/2) has the mean sqrt(1/2) sqrt(2/pi) and
    2 mean^2 / variance = 4 / (pi - 2) degrees of freedom.
    """
    values = np.array([-1.0, -1.0, 0.0, 1.0, 1.0])
    parts = (independent(*np.ones(5)), replace(independent(*np.ones(5)), variance=None))
    found = [
        expect_variance(Problem(np.ones((5, 1)), size * values, parts), np.array([1.0, 0.0]))
        for size in (1.0, 0.0, 3.0)
    ]
    # without any scatter m is -1, with S of 36 it is 8, eleven standard deviations above 0
    assert [mean for mean, _ in found] == pytest.approx([np.sqrt(1 / np.pi), 0.3195, 8.0], rel=1e-3)
    assert [dof for _, dof in found] == pytest.approx([4 / (np.pi - 2), 2.6023, 256.0], rel=1e-3)
