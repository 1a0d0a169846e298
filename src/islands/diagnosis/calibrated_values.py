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
    is_replaced = get_linear(base) is not None and get_linear(fit) is None
    if is_replaced:  # The nominal values of the equations are those of the calibrated linear simulation.
        alone = {each.name: each.nominal for each in parameters}
    else:
        known = base.simulation.simulator_slice
        names = [each.name for each in base.simulation.parameters[known]]
        alone = dict(zip(names, base.values[known].tolist(), strict=True))
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
        before = None if is_replaced else parameter.nominal
        values.append(CalibratedValue(parameter.name, before, alone.get(parameter.name), estimate))
    return tuple(values)
