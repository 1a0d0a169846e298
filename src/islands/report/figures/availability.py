"""Which figures a model of a result has. No figure is drawn, so that the service need not load matplotlib."""

from islands.models.form import is_static
from islands.models.latent import LatentModel
from islands.models.protocol import DynamicModel
from islands.report.figures.names import (
    CURVES,
    LATENT_FIGURES,
    LOOP,
    MODEL_FIGURES,
    STATIC_CURVE,
    STATIC_FIGURES,
)


def list_model_figures(model: DynamicModel | None, has_loop: bool) -> tuple[str, ...]:
    """Return the names of the figures of a model, in their order.

    Parameters
    ----------
    model : DynamicModel or None
        None for an equation with a past, whose figures do not depend on its terms.
    has_loop : bool
        Whether the output over the input of the record is a loop.
    """
    if model is not None and is_static(model):
        return STATIC_FIGURES
    absent = {STATIC_CURVE} if has_loop else {STATIC_CURVE, LOOP}
    if not isinstance(model, LatentModel):
        absent |= set(LATENT_FIGURES)
    elif not model.units:
        absent.add(CURVES)
    return tuple(name for name in MODEL_FIGURES if name not in absent)
