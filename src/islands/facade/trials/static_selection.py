"""Choice of a static record: the output depends on the inputs of the same sample only."""

from math import log

from islands.errors import RecordError
from islands.evolution.search_result import take_recommended
from islands.facade.trials.feedthrough_selection import advance_split
from islands.facade.trials.library import TrialLibrary
from islands.facade.trials.prepared_data import PreparedData
from islands.facade.trials.rate_selection import compute_errors
from islands.models.form import is_static
from islands.progress import Steps
from islands.records.channel_names import parse_channel_name
from islands.records.split import Split
from islands.simulation.initial_outputs import simulate_freely
from islands.validation.assessment import Assessment
from islands.validation.evidence import DECISIVE, ErrorNoise
from islands.validation.simple_models import assess_curve_models, assess_linear_model, assess_static_models

#: Name of the step.
STATIC = "static models"


def find_static(split: Split, library: TrialLibrary, steps: Steps) -> PreparedData | None:
    """Return the data of a static record, whose inputs are read one sample early; None of another record.

    The static models compete with the linear one of the inputs as recorded, and with those with one curve, as
    in the front of a result. If one of them is recommended, small models of a library must not have clearly
    more evidence on the validation data. A slow input does not tell by itself whether the output responds
    within the sample: its present value follows from the past.

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
    advanced = advance_split(split, late)
    models = assess_static_models(advanced, 1, warm_up, steps)
    models += [linear] if linear else []
    # Curves take longer than the linear model, which shows most dynamics.
    if not _is_static(models) or not _is_static(
        [*models, *assess_curve_models(split, 1, warm_up, "none", steps)]
    ):
        return None
    best, held_out = take_recommended(models), advanced.validation
    run = simulate_freely(best.model, held_out, best.warm_up)
    own = (held_out.y - run.y) / split.estimation.output_range
    try:
        other = compute_errors(split, library, 1) / split.estimation.output_range
    except RecordError:
        return None  # too short for the library: the search reports it
    noise = ErrorNoise.fit_closest((own, other), split.validation.segments)
    gain = log(noise.measure(own)) - log(noise.measure(other))
    return PreparedData(advanced, 1, late) if noise.samples * gain <= DECISIVE else None


def _is_static(models: list[Assessment]) -> bool:
    return bool(models) and is_static(take_recommended(models).model)
