"""Simplest models of the data of a search, which compete with the others: linear, and with one curve."""

from islands.errors import RecordError
from islands.estimation.curve_models import identify_curve_models
from islands.estimation.estimator_table import BOX_JENKINS, refinement_criterion
from islands.estimation.linear.latent import identify_linear_model
from islands.estimation.parameter_constraints import constraint
from islands.estimation.static_models import identify_static_models
from islands.models.form import is_linear
from islands.progress import Steps
from islands.records.channel_names import parse_channel_name
from islands.records.split import Split
from islands.validation.assessment import Assessment, assess

#: Error that the parameters of a static model minimise: it has no memory, so that all are one.
_STATIC = refinement_criterion(None)


def assess_linear_model(
    split: Split, shooting: int, warm_up: int = 0, constraints: str = "none", steps: Steps | None = None
) -> Assessment | None:
    """Identify the linear model of the estimation data and assess it.

    Parameters
    ----------
    split : Split
    shooting : int
        Length of a multiple-shooting interval in samples.
    warm_up : int
        Number of samples before the first prediction, at least.
    constraints : str
        Statements that the model must meet.
    steps : Steps, optional
        Receives the orders that are fitted. A stop ends the identification with a `StoppedError`.

    Returns
    -------
    Assessment or None
        None if the data are too short, or if the model does not meet the constraints: one of hysteresis is
        not linear.
    """
    if constraint(constraints).sums:
        return None
    try:
        model = identify_linear_model(split.estimation, steps)
        first = max(warm_up, model.maximum_lag)
        found = assess(model, split, shooting, first, constraints, BOX_JENKINS)
    except RecordError:
        return None
    return found if all(check.met for check in found.constraints) else None


def assess_static_models(split: Split, shooting: int, warm_up: int, steps: Steps) -> list[Assessment]:
    """Identify the static models of the estimation data, with the linear one, and assess them.

    Parameters
    ----------
    split : Split
        All inputs are read one sample early.
    shooting, warm_up, steps
        As for `assess_linear_model`.

    Returns
    -------
    list of Assessment
        None if the data are too short.
    """
    try:
        return [
            assess(model, split, shooting, warm_up, "none", _STATIC)
            for model in identify_static_models(split.estimation, steps)
        ]
    except RecordError:
        return []


def assess_curve_models(
    split: Split, shooting: int, warm_up: int, constraints: str, steps: Steps
) -> list[Assessment]:
    """Identify static models and linear models with one curve of the estimation data, and assess them.

    There are static models if all inputs are read one sample early.

    Parameters
    ----------
    split, shooting, warm_up, constraints, steps
        As for `assess_linear_model`.

    Returns
    -------
    list of Assessment
        Those that meet the constraints; none if the data are too short.
    """
    if constraint(constraints).sums:
        return []
    try:
        record = split.estimation
        is_early = all(parse_channel_name(name).at_once for name in record.input_names)
        static = identify_static_models(record, steps) if is_early else []
        # The linear rung has gains alone.
        models = [*(each for each in static if not is_linear(each)), *identify_curve_models(record, steps)]
        first = max([warm_up, *(model.maximum_lag for model in models)])
        found = [
            assess(model, split, shooting, first, constraints, refinement_criterion(None)) for model in models
        ]
    except RecordError:
        return []
    return [each for each in found if all(check.met for check in each.constraints)]
