"""Generalised least squares against cases whose answer is known in closed form."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from radiometry.fitting.gls import Component, are_separable, estimate_variances, shared_structure, solve

ONES = np.ones((4, 1))


def independent(*sigmas):
    return Component(source="noise", kind="A", structure=np.diag(np.square(sigmas)), variance=1.0)


def test_independent_points_give_the_weighted_mean():
    solution = solve(np.ones((2, 1)), np.array([10.0, 13.0]), [independent(1.0, 2.0)])
    assert solution.parameters[0] == pytest.approx((10 / 1 + 13 / 4) / (1 + 1 / 4))
    assert solution.covariance[0, 0] == pytest.approx(1 / (1 + 1 / 4))
    assert solution.chi_squared == pytest.approx(0.36 / 1 + 2.4**2 / 4)


def test_a_shared_error_does_not_average_down():
    shared = Component(
        source="shared", kind="B", structure=shared_structure("aaaa", np.ones(4)), variance=0.25
    )
    solution = solve(ONES, np.arange(4.0), [independent(1, 1, 1, 1), shared])
    assert solution.covariance[0, 0] == pytest.approx(1 / 4 + 0.25)
    assert [float(part[0, 0]) for part in solution.contributions] == pytest.approx([1 / 4, 0.25])


def test_a_crowded_block_weighs_less_than_its_points():
    """Three points share an error, one stands alone: means 0 and 1 with variances 1/3 + 1 and 1 + 1."""
    shared = Component(
        source="shared", kind="B", structure=shared_structure("aaab", np.ones(4)), variance=1.0
    )
    solution = solve(ONES, np.array([0.0, 0, 0, 1]), [independent(1, 1, 1, 1), shared])
    assert solution.parameters[0] == pytest.approx((4 / 3) / (4 / 3 + 2))


def test_shared_structure_by_hand():
    np.testing.assert_array_equal(
        shared_structure((1.7, 4.0, 1.7), np.array([2.0, 3.0, 5.0])), [[4, 0, 10], [0, 9, 0], [10, 0, 25]]
    )


def test_likelihood_is_the_normal_density():
    design, response = np.column_stack([np.ones(4), np.arange(4.0)]), np.array([0.1, 1.3, 1.9, 3.2])
    shared = Component(
        source="shared", kind="B", structure=shared_structure("aabb", np.ones(4)), variance=0.3
    )
    parts = [independent(0.1, 0.2, 0.3, 0.4), shared]
    solution = solve(design, response, parts)
    covariance = sum(part.variance * part.structure for part in parts)
    expected = multivariate_normal(design @ solution.parameters, covariance).logpdf(response)
    assert solution.log_likelihood == pytest.approx(expected)


@pytest.fixture
def balanced():
    """Six groups of four with known noise 0.5: here REML is the analysis of variance."""
    random = np.random.default_rng(3)
    groups, per_group, noise = 6, 4, 0.5
    response = np.repeat(random.normal(0, 1.0, groups), per_group) + random.normal(
        0, noise, groups * per_group
    )
    structure = shared_structure(list(np.repeat(np.arange(groups), per_group)), np.ones(response.size))
    return response, structure, noise, groups, per_group


def test_estimated_variance_is_the_analysis_of_variance(balanced):
    response, structure, noise, groups, per_group = balanced
    means = response.reshape(groups, per_group).mean(axis=1)
    (estimate,), ((uncertainty,),) = estimate_variances(
        np.ones((response.size, 1)), response, known=noise**2 * np.eye(response.size), structures=[structure]
    )
    assert estimate == pytest.approx(np.var(means, ddof=1) - noise**2 / per_group, rel=1e-9)
    assert uncertainty == pytest.approx(2 * np.var(means, ddof=1) ** 2 / (groups - 1), rel=1e-9)


def test_estimated_variance_reaches_the_parameter(balanced):
    response, structure, noise, groups, per_group = balanced
    means = response.reshape(groups, per_group).mean(axis=1)
    solution = solve(
        np.ones((response.size, 1)),
        response,
        [
            independent(*[noise] * response.size),
            Component(source="group", kind="A", structure=structure, variance=None),
        ],
    )
    assert solution.covariance[0, 0] == pytest.approx(np.var(means, ddof=1) / groups, rel=1e-9)
    assert solution.chi_squared == pytest.approx(
        np.sum((response.reshape(groups, -1) - means[:, None]) ** 2) / noise**2 + groups - 1
    )


def test_no_variance_is_found_where_noise_explains_the_scatter():
    (estimate,), ((uncertainty,),) = estimate_variances(
        ONES,
        np.array([0.0, 0.1, 0.0, 0.1]),
        known=np.eye(4),
        structures=[shared_structure("aabb", np.ones(4))],
    )
    assert estimate == 0.0
    assert uncertainty > 0.0


def test_two_variances_are_the_analysis_of_variance(balanced):
    """Noise and groups both unknown: the mean squares, with their variances and covariance."""
    response, structure, _, groups, per_group = balanced
    table = response.reshape(groups, per_group)
    within = np.sum(np.var(table, axis=1, ddof=1)) / groups
    among = per_group * np.var(table.mean(axis=1), ddof=1)
    n = response.size
    (group, noise), covariance = estimate_variances(
        np.ones((n, 1)), response, known=1e-12 * np.eye(n), structures=[structure, np.eye(n)]
    )
    assert noise == pytest.approx(within, rel=1e-9)
    assert group == pytest.approx((among - within) / per_group, rel=1e-9)
    of_within = 2 * within**2 / (n - groups)
    of_among = 2 * among**2 / (groups - 1)
    expected = [
        [(of_among + of_within) / per_group**2, -of_within / per_group],
        [-of_within / per_group, of_within],
    ]
    np.testing.assert_allclose(covariance, expected, rtol=1e-7)


def test_a_variance_that_would_be_negative_is_none():
    """Groups alike to the last digit: all scatter is noise, pooled over all points."""
    response = np.tile([1.0, -1.0, 2.0, -2.0], 3)
    structure = shared_structure("aaaabbbbcccc", np.ones(12))
    (group, noise), _ = estimate_variances(
        np.ones((12, 1)), response, known=1e-12 * np.eye(12), structures=[structure, np.eye(12)]
    )
    assert group == 0.0
    assert noise == pytest.approx(np.var(response, ddof=1))


def test_groups_may_differ_where_points_scatter_by_no_more_than_known():
    """Two points a group, alike within the known noise: all that is found lies between the groups."""
    response = np.repeat([1.0, -1.0, 2.0, -2.0], 2)
    structure = shared_structure("aabbccdd", np.ones(8))
    (group, noise), _ = estimate_variances(
        np.ones((8, 1)), response, known=0.01 * np.eye(8), structures=[structure, np.eye(8)]
    )
    assert noise == 0.0
    assert group == pytest.approx(np.var(response[::2], ddof=1) - 0.01 / 2)


@pytest.mark.parametrize(
    ("labels", "separable"), [("aabb", True), ("abcc", True), ("abcd", False), ("aaaa", False)]
)
def test_variances_are_told_apart_where_some_points_share_an_error_and_others_do_not(labels, separable):
    structures = [shared_structure(labels, np.ones(4)), np.eye(4)]
    assert are_separable(ONES, structures) is separable
    assert are_separable(ONES, structures[1:])
