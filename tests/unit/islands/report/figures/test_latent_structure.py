"""Block diagrams of latent models: which blocks act on which."""

import numpy as np
import pytest

from islands.models.latent import StateSpaceLayout
from islands.report.figures.latent import draw_structure
from support.latent_systems import SPRING, make_large_model, make_model

# The kernels of state spaces are compiled at their first use.
pytestmark = pytest.mark.ci


def list_arrows(model) -> set[str]:
    from matplotlib.patches import FancyArrowPatch

    (axes,) = draw_structure(model).axes
    arrows = [patch.get_label() for patch in axes.patches if isinstance(patch, FancyArrowPatch)]
    assert len(set(arrows)) == len(arrows)
    # The arrow behind the sum has no block.
    return set(arrows) - {""}


def list_texts(model) -> list[str]:
    (axes,) = draw_structure(model).axes
    return [text.get_text() for text in axes.texts]


@pytest.mark.parametrize(
    ("units", "blocks"),
    [
        ((), {"A", "B", "C"}),
        (("tanh",), {"A", "B", "C", "F1", "W1"}),
        (("tanh", "square"), {"A", "B", "C", "E1", "V1", "E2", "V2"}),
        (("cube",), {"A", "B", "C", "E1", "W1"}),
        (("cube", "abs"), {"A", "B", "C", "D", "E1", "F1", "W1", "V1", "F2", "V2"}),
        (("tanh",), {"A", "D", "F1", "V1"}),
    ],
    ids=["linear", "wiener", "hammerstein", "feedback", "all", "static"],
)
def test_there_is_an_arrow_for_each_block_that_is_not_zero(units, blocks):
    layout = StateSpaceLayout(2, 1, len(units))
    kept = [name for name in layout.names if find_block(name) in blocks]
    model = make_model(dict.fromkeys(kept, 0.3), units, input_names=("u_V+1",))
    assert list_arrows(model) == blocks - {"A"}


def find_block(name: str) -> str:
    """Return the block of a parameter, with the number of its unit."""
    if name[0] in "abcdsol":
        return name[0].upper()
    return name[0].upper() + (name.split("_")[1] if name[0] == "e" else name[1:].split("_", maxsplit=1)[0])


def test_all_parts_are_inside_of_the_figure():
    for model in (make_model(), make_large_model()):
        figure = draw_structure(model)
        (axes,) = figure.axes
        for patch in axes.patches:
            points = patch.get_path().transformed(patch.get_patch_transform()).vertices
            assert (points >= 0.0).all()
            assert (points <= np.array([figure.get_figwidth(), figure.get_figheight()])).all()


def test_without_a_sampling_time_there_are_no_modes():
    assert list_texts(make_model(SPRING, dt=None))[0] == "linear system with 2 states"
