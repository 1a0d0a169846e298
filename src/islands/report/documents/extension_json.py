"""Extended simulation of a diagnosis as JSON: ``extended.json``, which can be used as a simulation."""

import json
from dataclasses import asdict
from typing import Any

import numpy as np

from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult
from islands.effects import catalogue
from islands.effects.interface.effect import Effect, Site
from islands.records.dataset import Dataset
from islands.records.signal_ranges import measure_ranges
from islands.simulators.extended import ExtendedSimulator
from islands.simulators.specification.description import make_effect_spec, make_extended_spec


def extended_json(fit: CalibrationResult, record: Dataset) -> str:
    """Return ``extended.json``: a simulator with its effects and the values of both."""
    return json.dumps(extended_document(fit, record), indent=2, allow_nan=False) + "\n"


def extended_document(fit: CalibrationResult, record: Dataset) -> dict[str, Any]:
    """Return a simulator with its effects and the values of both as a JSON document.

    Wrong parameters are corrected and missing terms of a model are added to it, so that they are no longer
    effects.
    """
    simulation, values = fit.simulation, fit.values.copy()
    names = [parameter.name for parameter in simulation.simulator.parameters]
    for effect in simulation.effects:
        if effect.site == Site.PARAMETER:
            index = names.index(effect.name.partition(":")[2])
            values[index] *= 1.0 + values[simulation.get_slice(effect)][0]
    parts = [(effect, _get_own_slice(simulation, effect)) for effect in simulation.effects]
    shape = {
        parameter.name: float(value)
        for effect, part in parts
        if effect.name == catalogue.CORE_SHAPE
        for parameter, value in zip(simulation.parameters[part], values[part], strict=True)
    }
    found = [
        make_effect_spec(effect, simulation.parameters[part], values[part])
        for effect, part in parts
        if effect.site != Site.PARAMETER and effect.name != catalogue.CORE_SHAPE
    ]
    signals = (record.input_names, record.output_name)
    spec = make_extended_spec(
        simulation.simulator, values[: len(names)], found, simulation.context, *signals, shape
    )
    tested = [asdict(each) for each in measure_ranges(record, fit.output)]
    return spec.model_dump(mode="json", by_alias=True) | {"tested": tested}


def _get_own_slice(simulation: ExtendedSimulator, effect: Effect) -> slice:
    """Return the slice of an effect without its last values, the initial states of further recordings."""
    part = simulation.get_slice(effect)
    return slice(part.start, part.stop - int(np.count_nonzero(simulation.is_copy[part])))
