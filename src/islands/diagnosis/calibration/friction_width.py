"""Selection of the range of rates in which simulated dry friction changes its sign.

Dry friction is smoothed around a rate of zero, since calibration requires a derivative. A record whose noise
is small next to its friction shows the difference from a sign, which would be taken for another law.
"""

from dataclasses import replace

from islands.diagnosis.calibration.intersample_selection import MIN_IMPROVEMENT
from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult, calibrate
from islands.diagnosis.calibration.target import Target
from islands.effects.friction import COULOMB_FRICTION
from islands.effects.interface.context import SimulationContext

#: Width of a try relative to the one before, and the least one relative to the typical rate.
_NARROWER, _LEAST = 0.25, 2e-4


def narrow_friction(fit: CalibrationResult, target: Target) -> SimulationContext:
    """Return the context of a fit, with a narrower dry friction if that explains the record better."""
    while COULOMB_FRICTION in fit.simulation.effects:
        context = fit.simulation.context
        width = _NARROWER * context.force_coordinate.friction_smoothing
        if width < _LEAST:
            break
        coordinate = replace(context.force_coordinate, friction_smoothing=width)
        simulation = replace(fit.simulation, context=replace(context, force_coordinate=coordinate))
        narrower = calibrate(simulation, target, fit.values)
        if not narrower.score < fit.score - MIN_IMPROVEMENT:
            break
        fit = narrower
    return fit.simulation.context
