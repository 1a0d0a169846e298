"""Models of every class, with a record of each, and the starts of their exported programs."""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest

from islands.expressions.evaluation import value
from islands.expressions.primitives import PRIMITIVES
from islands.expressions.user_primitive import primitive
from islands.models.coupled_latent import CoupledLatentModel
from islands.models.coupled_narx import CoupledModel
from islands.models.latent import StateSpaceLayout
from islands.models.measured_signals import measured_block, program_block
from islands.records.coupled import CoupledRecord
from islands.records.dataset import Dataset
from islands.records.preprocessing_steps import Preprocessing, PreprocessingSteps
from islands.records.signal_map import map_coupled_signals, map_signals, match_rate
from islands.simulation.blocks import make_simulator
from islands.simulation.predictors import free_run
from support.coupled_systems import PREY, TWO_MASSES, equation
from support.gain_scheduled import TRUE, GainScheduledModel, make_record
from support.latent_systems import SPRING, make_coupled_latent_model, make_model
from support.programs import CASES, SAMPLES, model

#: Chosen for their states: past inputs and outputs, several inputs, no past, an input that acts at once.
OF_STATES = {
    **{
        name: replace(CASES[name], dt=CASES[name].dt or 0.1)
        for name in (
            "published 12",
            "many parts",
            "several inputs",
            "a constant, that needs no past",
            "no output",
            "tanh",
        )
    },
    "at once": replace(model({"y(k-1)": 0.5, "u1(k-1)*u2(k-2)": 0.25}, ("a_V+1", "b_A")), dt=0.1),
}

_TERMS = {"y(k-1)": 0.5, "max(u1(k-1), u3(k-2))": 0.1, "u2(k-1)*u4(k-1)*y(k-2)": -0.2, "1": 0.1 + 0.2}

#: Three outputs, two inputs, one of which acts within the sample, and names that end comments and strings.
THREE = CoupledModel(
    tuple(
        equation(_TERMS, ("u+1", '*/"""', *(other for other in ("a", "b'", "c") if other != name)), name)
        for name in ("a", "b'", "c")
    )
)


def saturate(a):
    return a / (1.0 + abs(a))


_OWN = primitive(
    "own", saturate, c="return a / (1.0 + fabs(a));", matlab="r = a / (1 + abs(a));"
)  # not in Modelica

#: Two states and two inputs, which drive the output at once, also through a unit.
_AT_ONCE = {
    **{name: SPRING[name] for name in ("a1_1", "a1_2", "a2_1", "a2_2")},
    "b1_1": 0.02,
    "b2_2": 0.15,
    "c1": 1.2,
    "d1": 0.7,
    "e2_1": -0.05,
    "f1": 0.2,
    "w1_1": 1.0,
    "v1_2": 0.5,
    "level": 0.3,
}

#: A second-order lag, which the first input reaches also within a sample of its dead time.
_LATE = {"a1_1": 0.9, "a1_2": 0.1, "a2_2": 0.8, "b1_1": 0.1, "b2_2": 0.3, "c1": 1.0, "d1": 0.2, "level": 0.4}


def with_offsets(of, output, inputs):
    """Return a model of deviations from the given output and inputs."""
    steps = PreprocessingSteps(detrend="constant")
    return replace(of, preprocessing=Preprocessing(steps, of.dt, inputs, output, 0.0))


def make_shared_states():
    """Return a model of two outputs of the same states, in deviations.

    The states are a resonance, and the mean magnitude of both inputs, which changes the gain by a difference
    of squares.
    """
    layout = StateSpaceLayout(3, 2, 4)
    theta = np.zeros(len(layout.names))
    blocks = layout.split(theta)
    blocks["A"][:] = [[0.7, 0.4, 0.0], [-0.4, 0.7, 0.0], [0.0, 0.0, 0.9]]
    blocks["B"][:2] = [[0.3, 0.0], [0.2, 0.1]]
    blocks["E"][[0, 0, 2, 2], [2, 3, 0, 1]] = 0.02, -0.02, 0.05, 0.05
    blocks["W"][[0, 1, 2, 2, 3, 3], [3, 4, 0, 2, 0, 2]] = 1.0, 1.0, 0.5, 1.0, 0.5, -1.0
    blocks["o"][2] = -0.02
    models = []
    for name, c, level in (("a_m", (1.0, 0.3), 0.2), ("b_m", (-0.5, 0.8), -0.1)):
        blocks["C"][:2], blocks["level"][0] = c, level
        named = {key: value for key, value in zip(layout.names, theta.tolist(), strict=True) if value}
        fields = {"input_names": ("p_V", "q_V"), "output_name": name, "operating_inputs": (0.1, -0.2)}
        units = ("abs", "abs", "square", "square")
        models.append(make_model(named, units, 3, memory=12, **fields))
    return CoupledLatentModel(tuple(map(with_offsets, models, (3.7, -1.2), ((20.0, 5.0),) * 2)))


def make_shared_poles():
    """Return a model of two outputs with the same poles and other dead times."""
    return CoupledLatentModel(
        tuple(
            make_model(
                {**_LATE, "c1": c1},
                (),
                input_names=("p_V", "q_V"),
                output_name=name,
                operating_inputs=(0.2, 0.5),
                delays=delays,
                memory=20,
            )
            for name, c1, delays in (("a_m", 1.0, (3, 1)), ("b_m", -0.4, (1, 5)))
        )
    )


#: A state that no constant input holds, except for zero.
_INTEGRATOR = {"a1_1": 1.0, "a1_2": 0.1, "a2_2": 0.8, "b2": 0.1, "c1": 1.0}


#: Models of every class, and with every property on which programs depend.
OF_BLOCKS = {
    **OF_STATES,
    "own primitive": replace(
        model({"y(k-1)": 0.5, "own(u(k-1))": 0.25}, primitives=PRIMITIVES | {"own": _OWN}), dt=0.1
    ),
    "means": replace(OF_STATES["tanh"], average=2),
    "deviations": with_offsets(OF_STATES["many parts"], 0.3, (20.0,)),
    "deviations at once": with_offsets(OF_STATES["at once"], 0.3, (2.0, -7.0)),
    "two masses": TWO_MASSES,
    "prey": PREY,
    "three outputs": THREE,
    "coupled deviations": CoupledModel(
        tuple(
            with_offsets(each, y, (5.0, other))
            for each, y, other in zip(TWO_MASSES.models, (0.3, 40.0), (40.0, 0.3), strict=True)
        )
    ),
    "states from outputs": GainScheduledModel.of_record(make_record(), TRUE),
    "state space": make_model(operating_inputs=(0.5,)),
    "state space at once": make_model(
        _AT_ONCE, input_names=("u_V+1", "v_V+1"), operating_inputs=(0.2, -0.3), memory=45
    ),
    "state space of deviations": with_offsets(make_model(operating_inputs=(0.1,), memory=45), 3.7, (20.0,)),
    "state space with dead times": with_offsets(
        make_model(
            _LATE, (), input_names=("u_V", "v_V+1"), operating_inputs=(0.2, 20.0), delays=(3, 1), memory=45
        ),
        3.7,
        (0.0, 20.0),
    ),
    "integrator": make_model(_INTEGRATOR, (), operating_inputs=(0.4,)),
    "state spaces": make_coupled_latent_model(),
    "state spaces of deviations": CoupledLatentModel(
        tuple(with_offsets(each, 3.7, (20.0,)) for each in make_coupled_latent_model().models)
    ),
    "shared states": make_shared_states(),
    "shared poles with dead times": make_shared_poles(),
}


def mark_slow(names):
    """Return names of `OF_BLOCKS`; equilibria that are searched, and new machine code, take a second."""
    slow = ("many parts", "deviations", "own primitive")
    return [pytest.param(name, marks=pytest.mark.ci) if name in slow else name for name in names]


@dataclass(frozen=True)
class Run:
    """Start and inputs of a free run, for programs of whole records and for blocks.

    Attributes
    ----------
    past : list of float or None
        Samples before the first compared one, in the order of the state of a block; None for its own.
    inputs : ndarray, shape (samples, inputs)
        Inputs of a block, from the first compared sample.
    u : ndarray, shape (given + samples, inputs)
        Inputs of a program of whole records.
    given : int
        Number of samples before the first compared one in the record of such a program.
    first : ndarray, shape (given, outputs)
        Outputs there, which a state space does not read.
    states : tuple of float or None
        States of a state space at the first of them; None for those of the program.
    """

    past: list[float] | None
    inputs: np.ndarray
    u: np.ndarray
    given: int
    first: np.ndarray
    states: tuple[float, ...] | None


def record_of_class(exported):
    """Return the inputs, shape (samples, inputs), and the outputs of a record as measured, and the record.

    The inputs move from the first sample on.
    """
    rng = np.random.default_rng(8)
    if isinstance(exported, CoupledModel):
        parts, names = exported.models, [each.removesuffix("+1") for each in exported.input_names]
        u = rng.uniform(-0.5, 0.5, size=(SAMPLES, len(names)))
        y = rng.uniform(-0.5, 0.5, size=(SAMPLES, len(parts)))
        done = [each.preprocessing for each in parts]
        if done[0] is not None:
            u += done[0].input_offsets[: len(names)]
            y += [each.output_offset for each in done]
        columns = zip(y.T, exported.output_names, strict=True)
        return (
            u,
            y,
            CoupledRecord(tuple(Dataset(u, each, exported.dt, names, name) for each, name in columns)),
        )
    done, samples = exported.preprocessing, SAMPLES * exported.average
    data = match_rate(
        exported,
        Dataset(
            rng.normal(size=(samples, exported.inputs)) + (0.0 if done is None else done.input_offsets),
            rng.normal(size=samples) + (0.0 if done is None else done.output_offset),
            exported.dt / exported.average,
            exported.column_names,
            exported.output_name,
        ),
    )
    return data.u, data.y[:, None], data


@cache
def start_from_record(name):
    """Return the run that starts as `free_run` does, and its outputs, shape (samples, outputs)."""
    exported = OF_BLOCKS[name]
    u, y, data = record_of_class(exported)
    simulated = free_run(exported, data)
    assert simulated.outcome
    block, first = measured_block(exported), max(exported.maximum_lag, 1)
    states = []
    if block.is_state_space:
        mapped = map_coupled_signals if isinstance(exported, CoupledModel) else map_signals
        states = make_simulator(exported, mapped(exported, data)[0], None, first).states[0].tolist()
        names = block.signals[block.computed :]
        states += [float(u[first - 1 - lag, names.index(of)]) for of, lag in block.late_inputs]
        block = block.expand_delays()
    elif block.starts:
        states = [
            value(each, lambda channel, _lag: y[first - 1, channel], block.parameters)
            for each in block.starts
        ]
    # Equations read one past sample of a state.
    signals = [*y.T, *(np.full(SAMPLES, state) for state in states), *u.T]
    past = [float(signals[channel][first - lag]) for channel, lag in block.samples]
    given = 1 if block.is_state_space else exported.maximum_lag
    begin = first - given
    run = Run(past, u[first:], u[begin:], given, y[begin:first], tuple(states) or None)
    return run, simulated.y.reshape(len(u), -1)[first:]


@cache
def start_by_default(name):
    """Return the run without a given start, and the outputs of the equations of the block."""
    exported = OF_BLOCKS[name]
    u, block = record_of_class(exported)[0], program_block(exported)
    given = 0 if block.is_state_space else exported.maximum_lag
    newest = [block.levels.get(signal, 0.0) for signal in block.signals]
    values = dict(zip(block.samples, block.start_values(), strict=True))
    newest[: block.computed] = [values[channel, 1] for channel in range(block.computed)]
    before = np.tile(newest[block.computed :], (given, 1))
    first = np.tile(newest[: block.outputs], (given, 1))
    run = Run(None, u, np.vstack([before, u]), given, first, None)
    return run, evaluate_equations(block, newest, u)


def evaluate_equations(block, levels, u):
    """Return the outputs of a block that follow constant signals, shape (samples, outputs)."""
    depth = max(block.depths)
    history = [[level] * depth for level in levels]
    for k, inputs in enumerate(u, start=depth):
        for signal, sample in zip(history[block.computed :], inputs, strict=True):
            signal.append(float(sample))
        for place in block.order:
            total = 0.0
            for term in block.equations[place]:
                found = value(
                    term.expression,
                    lambda channel, lag, k=k: history[channel][k - lag + block.leads[channel]],
                    block.parameters,
                )
                total += block.parameters[term.weight] * found if term.weight else found
            history[place].append(total)
    return np.array(history[: block.outputs]).T[depth:]
