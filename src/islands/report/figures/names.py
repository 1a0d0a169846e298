"""Names of the figures of a result.

They are apart from the functions that draw them: the import of matplotlib would delay every command and every
start of the service.
"""

from collections.abc import Mapping
from types import MappingProxyType

from islands.errors import SettingsError

FREE_RUN = "free-run"

#: The figure of a model that needs a loop.
LOOP = "loop"

#: The figure of a latent model that needs units.
CURVES = "curves"

#: Figures of a latent model: block diagram, curves of the units.
LATENT_FIGURES = ("structure", CURVES)

#: The figure of a static model: the output over its inputs, with the measured samples.
STATIC_CURVE = "static-curve"

#: Figures of a static model. Without a past, there are no states, and a held input gives the same output.
STATIC_FIGURES = (FREE_RUN, STATIC_CURVE, "residuals")

#: Figures of the linear system of a model about an operating point, which need no record.
LINEAR_FIGURES = ("bode", "nyquist", "pole-map", "unit-step")

#: Figures of a model on its data; see `islands.report.figures.availability`.
MODEL_FIGURES = (FREE_RUN, STATIC_CURVE, *LATENT_FIGURES, LOOP, "hold", "residuals")

#: Figures of a search: ``convergence`` of an evolution, ``islands`` of several islands.
SEARCH_FIGURES = ("record", "front", "convergence", "islands")

#: Least number of islands of the searches that have a figure; others have it always.
LEAST_ISLANDS: Mapping[str, int] = MappingProxyType({"convergence": 1, "islands": 2})

#: Responses of a model with a past; of one with several equilibria, as of hysteresis, there are none.
RESPONSES = ("characteristic", "step-response")

ALL_FIGURES = (*MODEL_FIGURES, *LINEAR_FIGURES, *SEARCH_FIGURES, *RESPONSES)

#: The figures of a result that are drawn by default: measured output, free run with its band, and residual
#: over time, and of a static model over its inputs.
OVERVIEW = (FREE_RUN, STATIC_CURVE)

#: The same as a text for `parse_figures`.
OVERVIEW_TEXT = ",".join(OVERVIEW)


def parse_figures(text: str) -> tuple[str, ...]:
    """Return the figures that a text names: names separated by commas, ``all`` or ``none``.

    Raises
    ------
    SettingsError
        There is no figure of a name.
    """
    if text in ("all", "none"):
        return ALL_FIGURES if text == "all" else ()
    names = [name.strip() for name in text.split(",")]
    for name in names:
        if name not in ALL_FIGURES:
            known = ", ".join((*ALL_FIGURES, "all", "none"))
            raise SettingsError(f"there is no figure {name!r}: take one or several of {known}")
    return tuple(dict.fromkeys(names))


def name_free_runs(outputs: int) -> list[str]:
    """Return the names of the figures of the free run, of each of several outputs."""
    return [FREE_RUN] if outputs == 1 else [f"{FREE_RUN}-{place + 1}" for place in range(outputs)]
