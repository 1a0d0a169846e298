"""Calibrated values of the parameters of a simulation, with their intervals."""

from islands.diagnosis.calibration.levenberg_marquardt import estimate_deviations, whiten_target
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.discovery.state_equations import get_linear
from islands.diagnosis.inference.finding import Value
from islands.diagnosis.result import CalibratedValue, Diagnosis


def list_calibrated_values(found: Diagnosis, target: Target) -> tuple[CalibratedValue, ...]:
    """Return the values of the best simulation of a diagnosis, without those of its terms and initial states.

    Parameters
    ----------
    found : Diagnosis
    target : Target
        The record that it explains.

    Returns
    -------
    tuple of CalibratedValue
        Without intervals if the residual is a rounding error.
    """
    fit, base = found.best, found.base
    simulation, part = fit.simulation, fit.simulation.simulator_slice
    parameters = simulation.parameters[part]
    if not parameters:
        return ()
    is_exact = target.is_matched(fit.output)
    deviations = None if is_exact else estimate_deviations(fit, whiten_target(target, fit))
    known = base.simulation.simulator_slice
    alone = {
        parameter.name: float(value)
        for parameter, value in zip(base.simulation.parameters[known], base.values[known], strict=True)
    }
    is_replaced = get_linear(base) is not None and get_linear(fit) is None
    terms = {name for each in found.causes if each.term for name in each.parameters}
    values = []
    for place, parameter in enumerate(parameters, part.start):
        if parameter.initial or parameter.name in terms:
            continue
        value, unit = float(fit.values[place]), parameter.unit
        estimate = (
            Value(value, unit, None)
            if deviations is None
            else Value.estimate(value, unit, float(deviations[place]))
        )
        name, before = parameter.name, None if is_replaced else parameter.nominal
        # The nominal values of equations in place of a linear simulation are those of its calibration.
        without = parameter.nominal if is_replaced else alone.get(name)
        values.append(CalibratedValue(name, before, without, estimate))
    return tuple(values)
