"""Choice of inputs with direct feedthrough, which the model reads at sample k."""

from collections.abc import Sequence

import numpy as np

from islands.errors import RecordError
from islands.estimation.linear.latent import identify_linear_model
from islands.estimation.structure_selection.direct_feedthrough import find_direct_inputs, find_linear_paths
from islands.facade.trials.library import TrialLibrary
from islands.facade.trials.rate_selection import compute_errors
from islands.records.channel_names import parse_channel_name
from islands.records.input_lead import advance_inputs, check_feedthrough
from islands.records.inspection.feedback import find_feedback
from islands.records.split import Split
from islands.simulation.predictors import free_run

#: Largest squared error relative to that of models without feedthrough.
LARGEST_RATIO = 0.98


def select_feedthrough(split: Split, feedthrough: str, library: TrialLibrary) -> Split:
    """Advance the inputs to which the output responds within the sample, as the setting says.

    ``auto`` tests the estimation data (see `find_direct_inputs`). It advances the inputs that it finds if
    small models of the library are then better in free run on the validation data. Otherwise it advances the
    inputs whose present value improves a linear prediction, if the linear model is then better in free run on
    the estimation data: an impact is in these alone. In a closed loop, that would be the path of the
    controller. Inputs that the caller already reads one sample early (``u_V+1``) do not change.

    Parameters
    ----------
    split : Split
    feedthrough : str
        ``auto``, ``yes`` (all inputs) or ``no``.
    library : TrialLibrary
        Library and constraints of the models that are compared.

    Raises
    ------
    SettingsError
        The setting is none of the three.
    """
    check_feedthrough(feedthrough)
    names = split.estimation.input_names
    measured = [place for place, name in enumerate(names) if not parse_channel_name(name).at_once]
    if feedthrough == "no" or not measured:
        return split
    if feedthrough == "yes":
        return advance_split(split, measured)
    # Statistics of very large numbers overflow: no input of such a record is advanced.
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        found = [place for place in find_direct_inputs(split.estimation) if place in measured]
        if found:
            advanced = advance_split(split, found)
            return advanced if _error(advanced, library) <= LARGEST_RATIO * _error(split, library) else split
        found = [place for place in find_linear_paths(split.estimation) if place in measured]
        if not found or find_feedback(split.estimation).value:
            return split
        advanced = advance_split(split, found)
        return advanced if _linear_error(advanced) <= LARGEST_RATIO * _linear_error(split) else split


def advance_split(split: Split, places: Sequence[int]) -> Split:
    """Return the split with some inputs read one sample early; see `advance_inputs`."""
    if not places:
        return split
    return Split(advance_inputs(split.estimation, places), advance_inputs(split.validation, places))


def _linear_error(split: Split) -> float:
    try:
        model = identify_linear_model(split.estimation)
    except RecordError:
        return np.inf
    return float(np.nanmean((split.estimation.y - free_run(model, split.estimation).y) ** 2))


def _error(split: Split, library: TrialLibrary) -> float:
    try:
        errors = compute_errors(split, library, 1)
    except RecordError:
        return np.inf  # too short for the library: the search reports it
    return float(np.nanmean(errors**2))
