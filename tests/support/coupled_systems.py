"""Coupled systems with known equations, and records of them."""

import numpy as np

from islands.expressions.evaluation import value
from islands.expressions.parsing import parse
from islands.models.coupled_narx import CoupledModel
from islands.models.narx import make_model
from islands.records.coupled import CoupledRecord
from islands.records.dataset import Dataset


def equation(terms, inputs, output, dt=0.1):
    """Return the model of one output; ``terms`` maps regressors to parameters."""
    return make_model([(parse(text), value) for text, value in terms.items()], inputs, output, dt)


#: Two masses with springs: y2 is driven by y1, and y1 feels y2. In an equation, u2 is the other output.
TWO_MASSES = CoupledModel(
    (
        equation({"y(k-1)": 1.6, "y(k-2)": -0.8, "u1(k-1)": 0.1, "u2(k-1)": 0.05}, ("u", "y2"), "y1"),
        equation({"y(k-1)": 1.5, "y(k-2)": -0.7, "u2(k-1)": 0.12, "u2(k-2)": -0.04}, ("u", "y1"), "y2"),
    )
)

#: Predator and prey about a steady state, with products of the two outputs.
PREY = CoupledModel(
    (
        equation({"y(k-1)": 0.9, "u1(k-1)": 0.2, "mul(y(k-1), u2(k-1))": -0.3}, ("u", "y2"), "y1"),
        equation({"y(k-1)": 0.8, "mul(y(k-1), u2(k-1))": 0.2, "u2(k-2)": 0.1}, ("u", "y1"), "y2"),
    )
)


def simulate_scalar(model, u, start):
    """Simulate a coupled model with Python floats, from the first outputs ``start``, (samples, outputs)."""
    y = [[float(each) for each in column] for column in np.transpose(start)]
    inputs = [column.tolist() for column in np.reshape(u, (len(u), -1)).T]
    for k in range(len(start), len(u)):
        row = []
        for place, single in enumerate(model.models):
            others = [y[other] for other in range(len(y)) if other != place]
            channels = [y[place], *inputs, *others]
            total = 0.0
            for weight, item in zip(single.parameters, single.regressors, strict=True):
                total += weight * value(item.expression, lambda c, lag, s=channels, k=k: s[c][k - lag])
            row.append(total)
        for column, each in zip(y, row, strict=True):
            column.append(each)
    return np.transpose(y)


def make_coupled_record(model, samples=400, noise=0.0, seed=1, segments=()):
    """Return a record of a coupled model, driven by a random staircase."""
    generator = np.random.default_rng(seed)
    u = np.repeat(generator.uniform(0.0, 1.0, samples // 5 + 1), 5)[:samples]
    y = simulate_scalar(model, u, np.full((model.maximum_lag, len(model.models)), 0.1))
    y = y + noise * generator.normal(size=y.shape) * y.std(axis=0)
    return CoupledRecord(
        tuple(
            Dataset(u, column, model.dt, model.input_names, name, segments=segments)
            for column, name in zip(y.T, model.output_names, strict=True)
        )
    )
