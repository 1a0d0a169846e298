"""Estimation of the parameters of a latent model on a whole record, from those that it has."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from islands.estimation.constraints.state_space import find_conditions
from islands.estimation.fitted_state_space import number
from islands.estimation.latent_data import SignalScales, estimate_start
from islands.estimation.state_space_fit import StateSpaceFit
from islands.models.latent import LatentModel
from islands.records.dataset import Dataset
from islands.records.flat_extremes import SensorLimits, find_limits
from islands.simulation.initial_states import Segment, read_inputs
from islands.simulation.outcome import EvaluationOutcome, Status
from islands.simulation.segment_lanes import SegmentLanes


def refit_latent(
    model: LatentModel,
    record: Dataset,
    max_steps: int,
    stop: Callable[[], bool],
    constraints: str = "none",
) -> LatentModel | EvaluationOutcome:
    """Estimate the parameters of a model by the error of the free run of each recording of a record.

    The limits of the sensor become those of the record, which may be beyond those of the estimation data; a
    model without a limit gets none.

    Parameters
    ----------
    model : LatentModel
    record : Dataset
        Signals of the model.
    max_steps : int
        Largest number of steps.
    stop : callable
        Whether to end the estimation with the parameters so far.
    constraints : str
        Statements that the parameters meet; see `find_conditions`.
    """
    stated, layout = find_conditions(constraints, record.inputs), model.layout
    # Means that are subtracted need the parameters that restore them.
    offsets = {*layout.blocks["o"], *layout.blocks["s"]} <= {*model.wiring}
    scales = SignalScales.measure(record, offsets=offsets, level="level" in model.wiring)
    theta = scales.use_scaled_units(layout, model.theta)
    pairs = zip(model.limits, find_limits(record.y, record.bounds), strict=True)
    limits = SensorLimits(*(new if old is not None else None for old, new in pairs))
    limits = limits.mirror(record.y) if stated.is_odd else limits
    scaled_limits = scales.scale_limits(limits)
    segments = []
    for begin, end in record.bounds:
        u, late = read_inputs(record, model, begin, end)
        y = scales.scale_outputs(record.y[begin + late : end])
        u = scales.scale_inputs(u)
        u.setflags(write=False)  # as inputs of a record: kernels are compiled for each type
        segments.append(Segment(u, y, *scaled_limits))
    states = np.array([estimate_start(theta, model.codes, each, model.order) for each in segments])
    free = np.isin(layout.names, model.wiring)
    conditions = scales.scale_conditions(stated)
    fit = StateSpaceFit(theta, number(free), model.codes, SegmentLanes(segments), states, conditions)
    fit.advance(max_steps, stop)
    if not fit.meets_conditions:
        return EvaluationOutcome(Status.INFEASIBLE, "the state space does not meet the constraints")
    if not np.isfinite(fit.mean_square):
        return EvaluationOutcome(Status.DIVERGED, "a free run of the state space diverges")
    found = stated.polish(fit.system.with_theta(scales.use_record_units(layout, fit.theta)))
    return replace(model.with_parameters(found[free].tolist()), limits=limits)
