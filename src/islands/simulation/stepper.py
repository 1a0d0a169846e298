"""Simulation of a model from its inputs alone, sample by sample or several at once, with equal bits.

An observer or a controller calls a stepper once in each sample.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from islands.errors import ModelError, SettingsError
from islands.expressions.evaluation import value
from islands.kernels.simulate_block import LANES
from islands.models.coupled_latent import CoupledLatentModel
from islands.models.coupled_narx import AnyModel, CoupledModel
from islands.models.latent import LatentModel
from islands.models.linearisation import EVERYWHERE, OperatingPoint, find_rest, read_levels
from islands.models.measured_signals import measured_block
from islands.records.dataset import Dataset
from islands.simulation.blocks import LinkedBlock
from islands.simulation.initial_states import estimate_coupled_states, estimate_initial_states


class Stepper:
    """A model that computes one sample after the other; the inputs before the first one are constant.

    Parameters
    ----------
    model : DynamicModel or CoupledModel
        Model with parameters.
    u : float, sequence of float or mapping, optional
        Inputs before the first sample, as measured, in the order of the model or by column; by default those
        at which an exported program of the model starts.
    y : float or sequence of float, optional
        Outputs before the first sample; by default the stable equilibrium at the inputs. The states of a
        state space are then those that explain the constant output best.
    states : sequence of float, optional
        States of a state space at the first sample, in the order of its equations. With dead times, the
        inputs before it follow: u(k-1), u(k-2), .. of each input, as measured.

    within : (float, float), optional
        Range of the output, as that of the data of a model: the only equilibrium in it is taken of several.

    Raises
    ------
    ModelError
        The model has no unique stable equilibrium at the inputs and nothing else is given, or it has no
        states of its own and some are given.
    SettingsError
        There is not one finite number for each input, output or state.
    """

    def __init__(
        self,
        model: AnyModel,
        u: OperatingPoint | None = None,
        y: ArrayLike | None = None,
        states: ArrayLike | None = None,
        within: tuple[float, float] = EVERYWHERE,
    ) -> None:
        self._block, self._parameters = model.block(), np.array(model.parameters)
        self._linked = LinkedBlock(self._block)
        self._output_offsets, self._input_offsets = measure_offsets(model)
        measured = measured_block(model)
        inputs = read_numbers(read_levels(measured, u), len(self._input_offsets), "inputs")
        block, depth = self._block, max(1, self._block.maximum_lag)
        self._past = np.zeros((len(block.signals), depth))
        self._past[block.computed :] = (inputs - self._input_offsets)[:, None]
        self._given = None
        if states is not None:
            if not block.is_state_space or y is not None:
                raise ModelError(
                    "states are those of a state space, in place of its output: give the output before the "
                    "first sample of other models"
                )
            self._given = self._read_states(states, depth)
        elif y is None:
            at_rest = np.array(find_rest(measured, inputs.tolist(), within))
            at_rest[: block.outputs] -= self._output_offsets
            self._past[: block.computed] = at_rest[:, None]
        else:
            outputs = read_numbers(y, block.outputs, "outputs") - self._output_offsets
            self._past[: block.outputs] = outputs[:, None]
            self._past[block.outputs : block.computed] = self._explain(model, outputs)[:, None]

    def _explain(self, model: AnyModel, outputs: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the states that a constant output determines."""
        block, now = self._block, self._past[:, -1]
        if not isinstance(model, LatentModel | CoupledLatentModel):
            named = dict(zip(block.parameters, self._parameters.tolist(), strict=True))
            starts = (value(each, lambda channel, _lag: now[channel], named) for each in block.starts)
            return np.array(list(starts))
        singles: Sequence[LatentModel] = model.models if isinstance(model, CoupledLatentModel) else (model,)
        samples = max(single.maximum_lag for single in singles)
        u, first = np.tile(now[block.computed :], (samples + 1, 1)), np.array([samples])
        records = [
            Dataset(u, np.full(samples + 1, y), single.dt or 1.0, single.input_names)
            for single, y in zip(singles, outputs, strict=True)
        ]
        found = (
            estimate_coupled_states(model, records, first, samples)
            if isinstance(model, CoupledLatentModel)
            else estimate_initial_states(model, records[0], first, samples)
        )
        states: NDArray[np.float64] = found[0]
        return states

    @property
    def states(self) -> NDArray[np.float64]:
        """States at the last sample, or those before the first one; assign others to correct them.

        Empty for a model whose past outputs are its state.
        """
        block, row = self._block, self._past.shape[1] - (self._given is None)
        own = self._past[block.outputs : block.computed, -1] if self._given is None else self._given
        return np.array([*own, *(self._past[place] + offset for place, offset in self._find_late(row))])

    @states.setter
    def states(self, values: ArrayLike) -> None:
        block, row = self._block, self._past.shape[1] - (self._given is None)
        found = self._read_states(values, row)
        if self._given is None:
            self._past[block.outputs : block.computed, -1] = found
        else:
            self._given = found

    def _read_states(self, values: ArrayLike, row: int) -> NDArray[np.float64]:
        """Write the inputs before a row; return the other states."""
        late, own = self._find_late(row), len(self._block.starts)
        found = read_numbers(values, own + len(late), "states")
        for (place, offset), measured in zip(late, found[own:], strict=True):
            self._past[place] = measured - offset
        return found[:own]

    def _find_late(self, row: int) -> list[tuple[tuple[int, int], float]]:
        """Return the place in the past and the offset of every late input at the sample of a row."""
        block, found = self._block, []
        for name, lag in block.late_inputs:
            channel = block.signals.index(name)
            place = channel, row - lag - block.leads[channel]
            found.append((place, float(self._input_offsets[channel - block.computed])))
        return found

    def step(self, u: ArrayLike) -> float | NDArray[np.float64]:
        """Return the output at the next sample, of which the inputs are given.

        Parameters
        ----------
        u : float or sequence of float
            Inputs at this sample, as measured. Those that the model does not read at once act later.

        Returns
        -------
        float or ndarray, shape (outputs,)
            A number for a model of one output. A simulation that diverges grows without a bound.
        """
        y = self.run(read_numbers(u, len(self._input_offsets), "inputs")[None])[0]
        return float(y[0]) if len(y) == 1 else y

    def run(self, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the outputs at the next samples, shape (samples, outputs); equal bits as step by step.

        Parameters
        ----------
        u : ndarray, shape (samples, inputs)
        """
        block, depth = self._block, self._past.shape[1]
        signals = np.zeros((len(block.signals), depth + len(u), LANES))
        signals[:, :depth] = self._past[..., None]
        moved = (u - self._input_offsets).T[..., None]
        # An input that is read early stands one row before its sample.
        for channel, lead in enumerate(block.leads[block.computed :]):
            rows = slice(depth - lead, depth - lead + len(u))
            signals[block.computed + channel, rows] = moved[channel]
            signals[block.computed + channel, rows.stop :] = moved[channel, -1]
        first = depth
        if self._given is not None:
            signals[: block.computed, depth] = self._start_from(self._given, signals[..., 0], depth)[:, None]
            self._given, first = None, depth + 1
        sets = np.repeat(self._parameters[:, None], LANES, axis=1)
        self._linked.simulate(signals, sets, first)
        self._past = signals[:, -depth:, 0].copy()
        y: NDArray[np.float64] = signals[: block.outputs, depth:, 0].T + self._output_offsets
        return y

    def _start_from(
        self, states: NDArray[np.float64], signals: NDArray[np.float64], row: int
    ) -> NDArray[np.float64]:
        """Return outputs and states of a state space at the sample of given states."""
        block = self._block
        now = np.concatenate([np.zeros(block.outputs), states])

        def sample(channel: int, lag: int) -> float:
            return float(now[channel] if channel < block.computed else signals[channel, row - lag])

        for place in range(block.outputs):
            now[place] = sum(
                (block.parameters[term.weight] if term.weight else 1.0)
                * value(term.expression, sample, block.parameters)
                for term in block.equations[place]
            )
        return now


def measure_offsets(model: AnyModel) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the offsets that a model adds to its outputs, and those that it subtracts from its inputs."""
    models = model.models if isinstance(model, CoupledModel) else (model,)
    outputs = [each.preprocessing.output_offset if each.preprocessing else 0.0 for each in models]
    count = len(model.input_names)
    inputs = model.preprocessing.input_offsets if model.preprocessing else (0.0,) * count
    return np.array(outputs), np.array(inputs)


def read_numbers(values: ArrayLike, count: int, title: str) -> NDArray[np.float64]:
    """Return finite numbers, one for each input, output or state of a model."""
    found = np.atleast_1d(np.asarray(values, dtype=np.float64))
    if found.shape != (count,):
        raise SettingsError(f"the model has {count} {title}: give as many numbers, got shape {found.shape}")
    if not np.isfinite(found).all():
        raise SettingsError(f"the {title} are finite numbers, got {found.tolist()}")
    return found


def read_inputs(model: AnyModel, u: ArrayLike, names: Sequence[str]) -> NDArray[np.float64]:
    """Return inputs, shape (samples, inputs)."""
    count = len(model.input_names)
    signals = np.asarray(u, dtype=np.float64)
    signals = signals[:, None] if signals.ndim == 1 else signals
    if signals.ndim != 2 or signals.shape[1] != count:
        raise SettingsError(
            f"the model has the inputs {', '.join(names)}: give an array of shape (samples, {count}), got "
            f"{np.shape(u)}"
        )
    if not len(signals):
        raise SettingsError("a response has at least 1 sample, got 0")
    if not np.isfinite(signals).all():
        raise SettingsError("an input is NaN or infinite: give finite numbers")
    return signals
