"""Simulation of a record by a specification, with initial states that are fitted to the measured output."""

import warnings
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from islands.diagnosis.calibration.levenberg_marquardt import calibrate
from islands.diagnosis.calibration.preparation import make_target
from islands.errors import ExtrapolationWarning
from islands.records.compatibility import ColumnReference, match_record
from islands.records.dataset import Dataset
from islands.records.signal_ranges import compare_ranges, measure_ranges
from islands.simulators.extended import ExtendedSimulator, make_context
from islands.simulators.interface import Simulator
from islands.simulators.specification.factory import make_simulator
from islands.simulators.specification.table import ExtendedSpec, LocalExtendedSpec, LocalSpec, SimulationSpec


def simulate_spec(
    spec: str | Mapping[str, Any] | SimulationSpec | LocalSpec,
    record: Dataset,
    columns: Mapping[str, Any] | None = None,
) -> NDArray[np.float64]:
    """Simulate the output of a record; an extended simulation can be given as its document.

    Initial states are fitted to the measured output of the record.

    Returns
    -------
    ndarray, shape (samples,)

    Warns
    -----
    ExtrapolationWarning
        The record leaves the ranges in which the extended simulation was tested.

    Raises
    ------
    RecordError
        The columns or units of the record are not those of the extended simulation.
    """
    if isinstance(spec, Mapping):
        spec = LocalExtendedSpec.model_validate(spec)
    if isinstance(spec, ExtendedSpec):
        record = match_record(ColumnReference(spec.inputs, spec.output), record, "the extended simulation")
    tested = spec.tested if isinstance(spec, ExtendedSpec) else ()
    simulator = make_simulator(spec, record, columns)
    y = _simulate(simulator, record)
    for statement in compare_ranges(tested, measure_ranges(record, y)):
        warnings.warn(statement, ExtrapolationWarning, stacklevel=2)
    return y


def _simulate(simulator: Simulator, record: Dataset) -> NDArray[np.float64]:
    alone = ExtendedSimulator(simulator, (), make_context(record, simulator, record.samples))
    is_state = np.array([parameter.initial for parameter in alone.parameters], dtype=bool)
    if not is_state.any():
        return alone.simulate(alone.nominal)
    # Initial states belong to this record. All other parameters keep their values. With friction there are
    # several minima; the nominal states may be those of another record, which was not at rest.
    target = make_target(record, record.samples, {})
    resting = np.clip(np.where(is_state, 0.0, alone.nominal), *alone.bounds)
    fits = [calibrate(alone, target, start, is_fixed=~is_state) for start in (alone.nominal, resting)]
    return min(fits, key=lambda fit: np.nan_to_num(fit.mean_square, nan=np.inf)).output
