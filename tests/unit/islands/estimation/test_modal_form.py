"""Modal form: a similar matrix with one block for each mode."""

import numpy as np
import pytest

from islands.estimation.modal_form import find_modal_form


def test_the_form_is_similar_and_has_a_block_for_each_mode():
    a = np.array([[0.9, 0.3, 0.1], [-0.3, 0.9, 0.0], [0.2, 0.0, 0.5]])
    blocks, forward = find_modal_form(a)
    assert np.linalg.solve(forward, a @ forward) == pytest.approx(blocks, abs=1e-12)
    pair = blocks[:2, :2]
    assert pair[0, 0] == pair[1, 1]
    assert pair[0, 1] == -pair[1, 0] > 0.0
    assert not blocks[:2, 2].any()
    assert not blocks[2, :2].any()


def test_the_slowest_mode_is_the_first():
    blocks, _ = find_modal_form(np.array([[0.2, 1.0], [0.0, 0.95]]))
    assert np.diag(blocks) == pytest.approx([0.95, 0.2])


def test_modes_that_depend_on_each_other_have_no_form():
    assert find_modal_form(np.array([[0.9, 1.0], [0.0, 0.9]])) is None
