"""Simulation in discrete time of a document: a linear filter, an identified model, or a column."""

import json
from dataclasses import replace

import numpy as np

from islands.export.equations.extended_system import NamedValue, SampledCore
from islands.export.equations.program_system import refuse
from islands.expressions.primitives import ADD, MUL, SUB
from islands.expressions.tree import Apply, Constant, Expression, Symbol
from islands.models.measured_signals import measured_block
from islands.persistence.models import model_from_json
from islands.simulators.linear import LinearSimulator
from islands.simulators.ode.system import OdeSystem
from islands.simulators.ode.system_document import SIMULATED, make_output_system
from islands.simulators.specification.table import ColumnSpec, ExtendedSpec, LinearSpec, ModelSpec

#: Names of the columns that a program reads besides the input: the measured and a simulated output.
MEASURED, RECORDED = "y_measured", "simulated"


def read_core(spec: ExtendedSpec) -> SampledCore | None:
    """Return the simulation in discrete time of a document; None if it has another one.

    Raises
    ------
    ModelError
        The coefficients are estimated from a record.
    """
    match spec.core:
        case LinearSpec():
            return _make_filter(spec.core)
        case ModelSpec():
            return _make_model(spec.core, spec.output)
        case ColumnSpec(column=name):
            return SampledCore("a column of the record", columns={RECORDED: name})
    return None


def read_output_system(spec: ExtendedSpec) -> OdeSystem:
    """Return the equation of the output in a document; the output itself if it has none."""
    given = spec.output_equation
    system = make_output_system(spec.core.kind) if given is None else given.make_system(spec.core.kind)
    return replace(system, channels=(SIMULATED,), simulated=())


def _make_model(spec: ModelSpec, output: str) -> SampledCore:
    block = measured_block(model_from_json(json.dumps(spec.model), spec.name))
    start = "the operating point" if block.is_state_space else f"{block.maximum_lag} measured outputs"
    return SampledCore(
        f"free run of the model {'; '.join(block.texts)} from {start}",
        block=block,
        columns={MEASURED: output},
    )


def _make_filter(spec: LinearSpec) -> SampledCore:
    """Return a linear filter in the transposed direct form II, which starts at rest."""
    if spec.numerator is None or spec.reference_input is None:
        raise refuse("a linear simulation whose coefficients or reference are estimated from a record")
    linear = LinearSimulator(
        *(np.array(spec.numerator), np.array(spec.denominator), spec.level, spec.reference_input, spec.delay),
        "1",
    )
    given = {
        **{f"b{lag}": value for lag, value in enumerate(spec.numerator)},
        **{f"a{lag}": value for lag, value in enumerate(spec.denominator, start=1)},
        "level": spec.level,
        "reference": spec.reference_input,
    }
    x, y = Apply(SUB, (Symbol("x"), _name("reference"))), Symbol("y")
    memory = [f"z{place}" for place in range(1, spec.order + 1)]
    at_rest = map(Constant, linear.state_at_rest.tolist())
    after = []
    for lag, name in enumerate(memory, start=1):
        fed = _add(_multiply(f"b{lag}", x), _multiply(f"a{lag}", Apply(SUB, (y, _name("level")))))
        after.append((name, fed if lag == spec.order else _add(fed, Symbol(memory[lag]))))
    through = _multiply("b0", x)
    return SampledCore(
        f"linear filter of order {spec.order}; the input acts {spec.delay} samples late",
        before=tuple(
            (name, _add(_name(f"state {place}"), Apply(MUL, (each, x))))
            for place, (name, each) in enumerate(zip(memory, at_rest, strict=True), start=1)
        ),
        output=_add(_name("level"), _add(through, Symbol(memory[0])) if memory else through),
        after=tuple(after),
        delay=spec.delay,
        values={f"linear {name}": NamedValue(value) for name, value in given.items()},
        start={f"linear state {place}": NamedValue(0.0) for place in range(1, spec.order + 1)},
    )


def _name(name: str) -> Symbol:
    return Symbol(f"linear {name}")


def _multiply(name: str, factor: Expression) -> Expression:
    return Apply(MUL, (_name(name), factor))


def _add(first: Expression, second: Expression) -> Expression:
    return Apply(ADD, (first, second))
