"""Selection of the widths over which effects with a discontinuity are smoothed, and of their instants.

Dry friction is smoothed around a rate of zero, and a step over time around its instant, since calibration
requires a derivative. A record whose noise is small next to the effect shows the difference from a sign or a
step, which would be taken for another law.
"""

from dataclasses import replace

from islands.diagnosis.calibration.instants import Instant, move_instants
from islands.diagnosis.calibration.intersample_selection import improve
from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult
from islands.diagnosis.calibration.target import Target
from islands.effects.baseline import JUMP
from islands.effects.friction import COULOMB_FRICTION
from islands.effects.interface.context import SimulationContext
from islands.effects.time_variation import GAIN_STEP, INSTANTS, instant_bounds
from islands.simulators.extended import ExtendedSimulator

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

    The instant of a step is found with the wide one, whose derivative reaches farther.
    """
    simulation, context = fit.simulation, fit.simulation.context
    steps = [effect for effect in (JUMP, GAIN_STEP) if effect in simulation.effects]
    if not steps:
        return fit
    earliest, latest = instant_bounds(context)
    distances = (latest - earliest) / (INSTANTS - 1), context.step_width * context.dt
    places = [simulation.get_slice(effect).start + 1 for effect in steps]
    fit = move_instants(fit, target, [Instant(each, earliest, latest, *distances) for each in places])
    return improve(fit, target, _make_steps_narrower)


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
