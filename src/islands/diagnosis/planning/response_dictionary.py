"""Dictionary of the linear responses of effects, from which the fits of hypotheses start."""

from dataclasses import dataclass, field
from operator import itemgetter

import numpy as np

from islands.diagnosis.calibration.problem import DIFFERENCE_STEP
from islands.diagnosis.inference.screening import MAX_SCALING, get_starting_points
from islands.diagnosis.planning.experiment import Experiment, ExperimentModel, make_model
from islands.effects.interface.context import Signal
from islands.effects.interface.effect import Effect

#: Number of starting points of a hypothesis that are fitted.
FITTED_STARTS = 2


@dataclass(frozen=True, slots=True, eq=False)
class ResponseDictionary:
    """Responses of effects at their starting points, without the part that calibration reproduces.

    Attributes
    ----------
    experiment : Experiment
    without : ExperimentModel
        The simulation without effects.
    output : ndarray, shape (channels * estimation samples,)
        Its whitened output at the nominal values.
    basis : ndarray
        Orthonormal basis of the responses to its parameters, each followed by its prior.
    """

    experiment: Experiment
    without: ExperimentModel = field(init=False)
    output: Signal = field(init=False)
    basis: Signal = field(init=False)
    _models: dict[str, ExperimentModel] = field(init=False, default_factory=dict)
    _responses: dict[tuple[str, tuple[float, ...]], Signal] = field(init=False, default_factory=dict)

    def __post_init__(self) -> None:
        without = make_model(self.experiment)
        nominal, scales = without.output.nominal, without.output.scales
        outputs = without.simulate(np.vstack([nominal, nominal + DIFFERENCE_STEP * np.diag(scales)]))
        slopes = np.nan_to_num((outputs[1:] - outputs[0]) / DIFFERENCE_STEP)
        columns = np.vstack([slopes.T, np.diag(without.inverse_prior_std * scales)])
        columns = columns[:, columns.any(axis=0)]
        object.__setattr__(self, "without", without)
        object.__setattr__(self, "output", outputs[0])
        object.__setattr__(self, "basis", np.linalg.qr(columns)[0])

    def get_model(self, effect: Effect) -> ExperimentModel:
        """Return the simulation with one effect."""
        if effect.name not in self._models:
            self._models[effect.name] = make_model(self.experiment, effect)
        return self._models[effect.name]

    def project(self, response: Signal) -> Signal:
        """Remove the part of a response that calibration reproduces; a zero for each prior is appended."""
        stacked = np.append(response, np.zeros(len(self.basis) - response.size))
        remaining: Signal = stacked - self.basis @ (self.basis.T @ stacked)
        return remaining

    def find_starts(self, effect: Effect, observed: Signal) -> list[Signal]:
        """Return the starting points of an effect whose linear responses explain most of the data.

        Parameters
        ----------
        observed : ndarray, shape (channels * estimation samples,)
            Whitened noise-free data.

        Returns
        -------
        list of ndarray, each of shape (parameters,)
            The best first; empty if the effect has no response.
        """
        model = self.get_model(effect)
        misfit = observed - self.output
        wanted = self.project(misfit)
        found = []
        for point in get_starting_points(effect, model.output, self._as_residual(misfit)):
            response = self._get_response(effect, point)
            size = float(response @ response)
            if not np.isfinite(size) or size == 0.0:
                continue
            factor = 1.0
            if effect.linear_parameters:
                factor = float(np.clip(response @ wanted / size, -MAX_SCALING, MAX_SCALING))
            scaled = np.array(point)
            scaled[: effect.linear_parameters] *= factor
            remaining = wanted - factor * response
            found.append((float(remaining @ remaining), model.insert(effect, scaled.tolist())))
        found.sort(key=itemgetter(0))
        return [values for _, values in found[:FITTED_STARTS]]

    def _get_response(self, effect: Effect, point: tuple[float, ...]) -> Signal:
        key = effect.name, tuple(point)
        if key not in self._responses:
            model = self.get_model(effect)
            response = model.simulate(model.insert(effect, point)[None])[0] - self.output
            self._responses[key] = self.project(response)
        return self._responses[key]

    def _as_residual(self, misfit: Signal) -> Signal:
        """Return a whitened misfit of the output in its unit; zero after the estimation part."""
        residual = np.zeros(self.experiment.context.u.size)
        fitted = self.experiment.estimation_samples
        noise = self.experiment.noise
        residual[:fitted] = noise.colour(misfit[:fitted]) * noise.std
        return residual
