import numpy as np
import pytest

from islands.estimation.linear.sections import find_point_poles, find_poles, is_stable, pair_poles


@pytest.mark.parametrize(
    "poles", [[], [0.5], [0.0, 0.3], [0.0, 0.0], [0.9, 0.9, -0.2], [0.5 + 0.5j, 0.5 - 0.5j, 0.1, 0.99, 0.3]]
)
def test_sections_keep_their_poles(poles):
    found = find_poles(pair_poles(poles))
    np.testing.assert_array_equal(find_point_poles([pair_poles(poles)] * 2), [found, found])
    np.testing.assert_allclose(np.sort_complex(found), np.sort_complex(np.array(poles, complex)), atol=1e-7)


def test_sections_are_stable_inside_of_the_unit_circle_only():
    radii = np.random.default_rng(1).uniform(0.5, 1.5, (50, 2))
    for one, other in radii:
        assert is_stable(pair_poles([one, -other])[0]) == (max(one, other) < 1.0)
        pole = one * np.exp(1j * other)
        assert is_stable(pair_poles([pole, pole.conjugate()])[0]) == (one < 1.0)
