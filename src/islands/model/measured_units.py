"""Model of deviations as a model of the signals as measured."""

from collections.abc import Callable
from dataclasses import replace

from islands.model.expression import Apply, Constant, Expression, Lagged, Shift
from islands.model.model import Model, make_model
from islands.model.primitives import SUB


def measured_model(model: Model) -> Model:
    """Return a model with the offsets of its preprocessing inside its expressions.

    It reads and predicts the signals as measured: y(k-1) becomes y(k-1) less the offset of the output, and
    the offset of the output is a term. Standard errors, which are those of the deviations, are left out.

    Parameters
    ----------
    model : Model
        Model with parameters.

    Returns
    -------
    Model
        The model itself if it has no offsets. The filter and the decimation of its preprocessing remain.
    """
    done = model.preprocessing
    if done is None:
        return model
    offsets = (done.output_offset, *done.input_offsets)
    rate = done.without_offsets if done.has_rate_steps else None
    if not any(offsets):
        return replace(model, preprocessing=rate)

    def subtract(leaf: Lagged) -> Expression:
        offset = offsets[leaf.channel]
        return Apply(SUB, (leaf, Constant(offset))) if offset else leaf

    terms = [
        (replace_leaves(item.expression, subtract), parameter)
        for item, parameter in zip(model.regressors, model.parameters, strict=True)
    ]
    terms.append((Constant(1.0), done.output_offset))
    measured = make_model(terms, model.input_names, model.output_name, model.dt)
    return replace(measured, average=model.average, preprocessing=rate)


def replace_leaves(expression: Expression, transform: Callable[[Lagged], Expression]) -> Expression:
    """Return an expression in which every signal is replaced by what ``transform`` returns for it."""
    match expression:
        case Lagged():
            return transform(expression)
        case Shift(samples, argument):
            return Shift(samples, replace_leaves(argument, transform))
        case Apply(primitive, arguments):
            return Apply(primitive, tuple(replace_leaves(argument, transform) for argument in arguments))
    return expression
