"""Access to the equations of a simulator, through the wrappers around them, and their extension by terms."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult
from islands.diagnosis.discovery.candidate_terms import CandidateTerm
from islands.diagnosis.inference.screening import transfer_effects
from islands.effects.interface.context import Signal
from islands.simulators.extended import ExtendedSimulator
from islands.simulators.interface import Simulator
from islands.simulators.intersample import ResampledSimulator
from islands.simulators.ode.simulator import OdeSimulator
from islands.simulators.ode.system import OdeSystem
from islands.simulators.output_equation import OutputEquation


def find_equations(simulator: Simulator) -> OdeSimulator | OutputEquation | None:
    """Return the simulator of equations; None if the simulator has no equations that can be extended."""
    if isinstance(simulator, ResampledSimulator):
        return find_equations(simulator.simulator)
    return simulator if isinstance(simulator, OdeSimulator | OutputEquation) else None


def with_equations(simulator: Simulator, system: OdeSystem) -> Simulator:
    """Return the simulator with other equations; the wrappers stay."""
    if isinstance(simulator, ResampledSimulator):
        return replace(simulator, simulator=with_equations(simulator.simulator, system))
    assert isinstance(simulator, OdeSimulator | OutputEquation)
    return replace(simulator, system=system)


def add_terms(
    fit: CalibrationResult,
    system: OdeSystem,
    terms: Sequence[tuple[CandidateTerm, int]],
    target_sizes: Mapping[str, float],
) -> tuple[ExtendedSimulator, Signal]:
    """Return a simulation of a system with more, numbered terms, and its values.

    Known parameters have the values of ``fit``; coefficients of new terms are zero.
    """
    for term, number in terms:
        system = term.add_to(system, number, target_sizes[term.target])
    simulation = replace(fit.simulation, simulator=with_equations(fit.simulation.simulator, system))
    values = {term.name_parameters(number)[0]: 0.0 for term, number in terms}
    known = fit.simulation.simulator_slice
    values |= {
        each.name: value
        for each, value in zip(fit.simulation.parameters[known], fit.values[known], strict=True)
    }
    start = simulation.nominal
    part = simulation.simulator_slice
    start[part] = [values.get(each.name, each.nominal) for each in simulation.parameters[part]]
    transfer_effects(fit.values, fit.simulation, start, simulation)
    return simulation, start


def get_system(fit: CalibrationResult) -> OdeSystem:
    """Return the equations of a fit."""
    equations = find_equations(fit.simulation.simulator)
    assert equations is not None
    return equations.system


def find_used_names(fit: CalibrationResult) -> set[str]:
    """Return the names in the equations of a fit and those of its parameters."""
    return {*get_system(fit).find_names(), *(each.name for each in fit.simulation.parameters)}
