"""Linear model of the data of a search, which competes with the other models and shows what they gain."""

from islands.errors import RecordError
from islands.estimation.estimator_table import BOX_JENKINS
from islands.estimation.linear.latent import identify_linear_model
from islands.estimation.parameter_constraints import constraint
from islands.progress import Steps
from islands.records.split import Split
from islands.validation.assessment import Assessment, assess


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
