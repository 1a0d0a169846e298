"""Choice of a static record: the output depends on the inputs of the same sample only."""

from math import log

import numpy as np

from islands.errors import RecordError
from islands.facade.trials.feedthrough_selection import advance_split
from islands.facade.trials.library import TrialLibrary
from islands.facade.trials.rate_selection import compute_errors
from islands.progress import Steps
from islands.records.channel_names import parse_channel_name
from islands.records.split import Split
from islands.validation.evidence import is_static, measure_size
from islands.validation.recommendation import DECISIVE, recommend
from islands.validation.simple_models import assess_linear_model, assess_static_models

#: Name of the step.
STATIC = "static models"


def find_static(split: Split, library: TrialLibrary, steps: Steps) -> tuple[int, ...]:
    """Return the places of all inputs that are not read one sample early if a static model needs them so.

    The static models compete with the linear one of the inputs as recorded, as in the front of a result. If
    one of them is recommended, small models of a library must not have decisively more evidence on the
    validation data. Otherwise the places are none. A slow input does not tell by itself whether the output
    responds within the sample: its present value follows from the past.

    Parameters
    ----------
    split : Split
    library : TrialLibrary
        Library and constraints of the models that are compared.
    steps : Steps

    Raises
    ------
    StoppedError
        A stop is requested.
    """
    names = split.estimation.input_names
    late = tuple(place for place, name in enumerate(names) if not parse_channel_name(name).at_once)
    steps.report(STATIC, None)
    linear = assess_linear_model(split, 1, library.lags, steps=steps)
    warm_up = library.lags if linear is None else linear.warm_up
    static = assess_static_models(advance_split(split, late), 1, warm_up, steps)
    models = [*static, *([linear] if linear else [])]
    if not static:
        return ()
    found = models[recommend([measure_size(each.model) for each in models], models, False).rank - 1]
    if not is_static(found.model):
        return ()
    try:
        other = float(np.nanmean(compute_errors(split, library, 1) ** 2))
    except RecordError:
        return ()  # too short for the library: the search reports it
    gain = log(found.validation_error**2) - log(other) if other > 0.0 else np.inf
    return late if split.validation.samples * gain <= DECISIVE else ()
