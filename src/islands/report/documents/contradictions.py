"""Limits of states that a simulation states, and that its extension contradicts."""

from collections.abc import Iterator

import numpy as np

from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult
from islands.effects.baseline import INPUT_OFFSET
from islands.effects.catalogue import get_title
from islands.effects.interface.effect import Effect, Site
from islands.expressions.evaluation import evaluate
from islands.expressions.tree import FMU, SIGNAL_FUNCTIONS, Apply, Expression, Symbol, substitute, walk
from islands.rounding import RESOLUTION
from islands.simulators.interface import Simulator
from islands.simulators.intersample import ResampledSimulator
from islands.simulators.ode.effects import list_terms
from islands.simulators.ode.equation_parser import FORCE, TIME
from islands.simulators.ode.simulator import OdeSimulator
from islands.simulators.ode.system import OdeSystem, sort_variables


def list_contradictions(fit: CalibrationResult) -> tuple[str, ...]:
    """Return a sentence for each limit of a state that an extended simulation contradicts.

    An offset in the balance of a state with a lower limit, such as a level, may take something away where
    nothing is left. An effect of the output may show values beyond the limits of the state that is measured.
    """
    simulator = _find_equations(fit.simulation.simulator)
    if simulator is None:
        return ()
    return (*_check_offsets(fit, simulator.system), *_check_output(fit, simulator.system))


def _find_equations(simulator: Simulator) -> OdeSimulator | None:
    if isinstance(simulator, ResampledSimulator):
        return _find_equations(simulator.simulator)
    return simulator if isinstance(simulator, OdeSimulator) else None


def _check_offsets(fit: CalibrationResult, system: OdeSystem) -> Iterator[str]:
    """Compare the balance at the lower limits without an input, where the simulation alone loses nothing."""
    states = {each.name: each for each in system.states}
    for effect in fit.simulation.effects:
        state = states.get(effect.place)
        if effect.cause != INPUT_OFFSET.name or state is None or not np.isfinite(state.lower):
            continue
        alone, extended = (_compute_balance(fit, system, effect, each) for each in (False, True))
        if alone is None or extended is None or not alone >= 0.0 > extended:
            continue
        unit = f" {state.unit}" if state.unit else ""
        yield (
            f"{get_title(effect.name).capitalize()}: with {system.input} = 0 and {state.name} at its limit "
            f"of {state.lower:g}{unit}, the extended simulation still takes away {-extended:.3g}{unit}/s. "
            "It is valid above the limit only, or the cause is another one, such as an outflow that depends "
            f"on {state.name}."
        )


def _compute_balance(
    fit: CalibrationResult, system: OdeSystem, effect: Effect, is_extended: bool
) -> float | None:
    """Return the derivative of a state with all states at their lower limits, or at zero, and no input.

    None if it depends on the time, on a channel, or on what is not an expression.
    """
    simulation = fit.simulation
    part = simulation.simulator_slice
    values = {each.name: each.value for each in system.parameters}
    values |= {
        each.name: float(value)
        for each, value in zip(simulation.parameters[part], fit.values[part], strict=True)
    }
    values |= {each.name: each.lower if np.isfinite(each.lower) else 0.0 for each in system.states}
    values |= {system.input: 0.0, FORCE: 0.0}
    if is_extended:
        listed = {each.name: each for each in list_terms(system)}
        system = system.with_effect(listed[effect.name])
        values[effect.name] = float(fit.values[simulation.get_slice(effect)][0])
    variables = dict(system.variables)
    right = dict(system.derivatives)[effect.place]
    for name in reversed(sort_variables(system)):
        right = substitute(right, {name: variables[name]})
    if not _is_known(right, set(values)):
        return None
    return float(evaluate(right, values))


def _is_known(expression: Expression, names: set[str]) -> bool:
    """Return whether an expression has no other names than these, and no function of a whole signal."""
    for part in walk(expression):
        match part:
            case Symbol(name) if name not in names or name == TIME:
                return False
            case Apply(function, _) if function in (*SIGNAL_FUNCTIONS, FMU):
                return False
    return True


def _check_output(fit: CalibrationResult, system: OdeSystem) -> Iterator[str]:
    """Compare the extended output with the limits of the state that is measured."""
    states = {each.name: each for each in system.states}
    state = states.get(system.output.name) if isinstance(system.output, Symbol) else None
    if state is None or not any(each.site == Site.OUTPUT for each in fit.simulation.effects):
        return
    low, high = float(np.min(fit.output)), float(np.max(fit.output))
    rounding = RESOLUTION * (high - low)
    for limit, is_beyond, end in (
        (state.lower, low < state.lower - rounding, low),
        (state.upper, high > state.upper + rounding, high),
    ):
        if is_beyond:
            unit = fit.simulation.context.output_unit
            yield (
                f"The output of the extended simulation reaches {end:.3g} {unit}, beyond the limit of "
                f"{limit:g} {unit} that the simulation states for {state.name}: this is possible for an "
                "error of the sensor only."
            )
