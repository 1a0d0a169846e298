"""Selection of the widths over which effects with a discontinuity are smoothed, and of their instants.

Dry friction is smoothed around a rate of zero, and a step over time around its instant, since calibration
requires a derivative. A record whose noise is small next to the effect shows the difference from a sign or a
step, which would be taken for another law.
"""

from dataclasses import replace

from islands.diagnosis.calibration.intersample_selection import improve
from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult, calibrate
from islands.diagnosis.calibration.pattern_search import Coordinate, search_pattern
from islands.diagnosis.calibration.target import Target
from islands.effects.baseline import JUMP
from islands.effects.friction import COULOMB_FRICTION
from islands.effects.interface.context import Signal, SimulationContext
from islands.effects.time_variation import GAIN_STEP, INSTANTS, instant_bounds
from islands.simulators.extended import ExtendedSimulator

#: Effects with an instant.
_STEPS = frozenset((JUMP, GAIN_STEP))

#: Width of a try relative to the one before.
_NARROWER = 0.25

#: Least width of dry friction relative to the typical rate, and of a step in samples.
_LEAST_FRICTION, _LEAST_STEP = 2e-4, 0.1


def narrow_friction(fit: CalibrationResult, target: Target) -> SimulationContext:
    """Return the context of a fit, with a narrower dry friction if that explains the record better."""
    if COULOMB_FRICTION in fit.simulation.effects:
        fit = improve(fit, target, _make_friction_narrower)
    return fit.simulation.context


def narrow_steps(fit: CalibrationResult, target: Target) -> CalibrationResult:
    """Return a fit with steps at better instants, and narrower ones if these explain the record better.

    The instants are searched for with each width: a wide step at the end of a recording is better a few
    samples later, and from there a calibration does not move a narrower one back.
    """
    if not _STEPS.intersection(fit.simulation.effects):
        return fit

    def refit(simulation: ExtendedSimulator, target: Target, values: Signal) -> CalibrationResult:
        return _search_instants(calibrate(simulation, target, values), target)

    return improve(_search_instants(fit, target), target, _make_steps_narrower, refit)


def _search_instants(fit: CalibrationResult, target: Target) -> CalibrationResult:
    simulation, context = fit.simulation, fit.simulation.context
    earliest, latest = instant_bounds(context)
    moves = (latest - earliest) / (INSTANTS - 1), context.step_width * context.dt
    places = [simulation.get_slice(each).start + 1 for each in simulation.effects if each in _STEPS]
    return search_pattern(fit, target, [Coordinate(each, earliest, latest, *moves) for each in places])


def _make_friction_narrower(simulation: ExtendedSimulator) -> ExtendedSimulator | None:
    context = simulation.context
    width = _NARROWER * context.force_coordinate.friction_smoothing
    coordinate = replace(context.force_coordinate, friction_smoothing=width)
    changed = replace(context, force_coordinate=coordinate)
    return None if width < _LEAST_FRICTION else replace(simulation, context=changed)


def _make_steps_narrower(simulation: ExtendedSimulator) -> ExtendedSimulator | None:
    width = _NARROWER * simulation.context.step_width
    changed = replace(simulation.context, step_width=width)
    return None if width < _LEAST_STEP else replace(simulation, context=changed)
