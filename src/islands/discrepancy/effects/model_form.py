"""The model's own form is wrong: it lacks psi |y - c u|, |psi| (y - c u), psi(k-1), psi its regressors."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from islands.discrepancy.interfaces.context import Parameter
from islands.discrepancy.interfaces.effect import Effect, EffectTemplate, Signal, SimulationContext, Site
from islands.discrepancy.interfaces.simulator import Simulator
from islands.model.expression import Apply, Constant, Expression, Lagged, Shift
from islands.model.model import Model
from islands.model.primitives import MUL, PRIMITIVES, SUB
from islands.model.regressor import Regressor, regressor
from islands.model.rendering import plain

#: The name of the effect.
CORE_SHAPE = "core-shape"

#: The name of the slope c.
SLOPE = f"{CORE_SHAPE} c"

#: How the slope is read within a term.
_SLOPE_READ = re.compile(r"u2\(k-\d+\)")

#: Regressors of the least degree that are folded, and those that are read a sample further back, at the most.
_FOLDED, _SHIFTED = 4, 8

#: A change of a coefficient that matters, relative to that of the regressor it stands beside, and the part of
#: it that a derivative steps.
_SCALE, _STEP = 0.01, 0.01

#: What it costs, in values, however many coefficients it has. That the form of an identified model is wrong
#: is no surprise: it pays no more than what imitates it, a second hysteresis and friction beside it. Nor
#: less: by chance every coefficient gains one, in minus twice the log-likelihood.
_PRICE = 4

#: Slopes c that are tried, in parts of the output's own slope over the input.
_SLOPES = (0.5, 0.7, 1.0, 1.4, 2.0, 2.8)

#: Of these so many are starts; as far, in the ratio of the peaks, the slope may go; and directions that are
#: so much fainter than the strongest one are left alone at the start.
_STARTS, _FAR, _FAINT = 2, 10.0, 1e-2


@dataclass(frozen=True, slots=True)
class MissingTerm:
    """A term that a model may lack; it vanishes wherever the model's own regressor does.

    Attributes
    ----------
    name : str
        Of its coefficient.
    regressor : Regressor
        Its second input, which never moves, is the slope c.
    beside : int
        Place of the model's regressor that it is made of.
    folded : bool
        It is that regressor times a distance in the unit of the output.
    """

    name: str
    regressor: Regressor
    beside: int
    folded: bool

    def at(self, slope: float) -> Expression:
        """Return the term with a slope written into it."""
        return _at(self.regressor.expression, slope)


def missing_terms(model: Model, among: Sequence[int]) -> tuple[MissingTerm, ...]:
    """Return the terms that a model may lack, beside those of its regressors whose places are given.

    What a loop's width depends on is the distance of the output from a line over the input: a polynomial in
    both has no such fold. And a model reads no further back than it was told to.
    """
    reading = sorted(
        (place for place in among if model.regressors[place].lags),
        key=lambda place: (model.regressors[place].degree, model.regressors[place].maximum_lag),
    )
    least = model.regressors[reading[0]].degree if reading else 0
    plainest = [place for place in reading if model.regressors[place].degree == least][:_FOLDED]
    psi = {place: model.regressors[place].expression for place in reading}
    near, far = (_distance(lag) for lag in (1, 2))
    asked = [(place, _product(psi[place], _size(near)), True) for place in plainest]
    asked += [(place, _product(psi[place], _size(far)), True) for place in plainest]
    # The nearest one's size times levels is what models of hysteresis have.
    asked += [(place, _product(_size(psi[place]), near), True) for place in plainest[1:]]
    asked += [(place, Shift(1, psi[place]), False) for place in reading[:_SHIFTED]]
    known, found = set(model.regressors), []
    for place, expression, folded in asked:
        _, item = regressor(expression)
        if item is not None and item not in known:
            known.add(item)
            text = plain(item.expression, inputs=2).replace("u1(", "u(")
            name = f"{CORE_SHAPE} {_SLOPE_READ.sub('c', text)}"
            found.append(MissingTerm(name, item, place, folded))
    return tuple(found)


def _distance(lag: int) -> Expression:
    """Return y - c u, so many samples back."""
    return Apply(SUB, (Lagged(0, lag), _product(Lagged(2, lag), Lagged(1, lag))))


def _product(*factors: Expression) -> Expression:
    return Apply(MUL, factors)


def _size(expression: Expression) -> Expression:
    return Apply(PRIMITIVES["abs"], (expression,))


def model_form(simulator: Simulator, model: Model, terms: Sequence[MissingTerm]) -> Effect:
    """Return the effect on a model: the coefficients of the terms that it lacks, and their slope.

    Parameters
    ----------
    core : Simulator
        The model as a simulation; the effect's parameters are its own, by their names.
    terms : sequence of MissingTerm
    """
    theta = model.parameters

    def parameters(context: SimulationContext) -> tuple[Parameter, ...]:
        found = []
        for term in terms:
            size = _SCALE * abs(theta[term.beside]) or _SCALE
            found.append(Parameter(term.name, "", 0.0, size / context.output_peak if term.folded else size))
        slope = context.output_peak / context.input_peak
        unit = f"{context.output_unit}/{context.input_unit}"
        return (*found, Parameter(SLOPE, unit, slope, 0.02 * slope, -_FAR * slope, _FAR * slope))

    def grid(context: SimulationContext, residual: Signal) -> tuple[tuple[float, ...], ...]:
        seen = round(context.fit_end_time / context.dt)
        own, added = simulator.parameters, parameters(context)[:-1]
        at = np.array([each.nominal for each in own])

        def simulated(values: Signal, **shape: float) -> Signal:
            return simulator.simulate(values, context.u, context, shape, ())[:seen]

        rest = simulated(at)
        moved = at + _STEP * np.diag([each.scale for each in own])
        known = [(simulated(values) - rest) / _STEP for values in moved]
        u = context.u[:seen]
        usual = float(np.polyfit(u, rest, 1)[0])
        tried: list[tuple[float, tuple[float, ...]]] = []
        for part in _SLOPES:
            slope = part * usual
            columns = known + [
                (simulated(at, **{SLOPE: slope, each.name: _STEP * each.scale}) - rest) / _STEP
                for each in added
            ]
            design = np.column_stack(columns)
            if not np.isfinite(design).all():
                continue
            sizes = np.linalg.norm(design, axis=0) + 1e-300
            found = np.linalg.lstsq(design / sizes, residual[:seen], rcond=_FAINT)[0] / sizes
            left = float(np.sum((residual[:seen] - design @ found) ** 2))
            scales = [each.scale for each in added]
            tried.append((left, (*(found[len(own) :] * scales).tolist(), slope)))
        return tuple(point for _, point in sorted(tried)[:_STARTS])

    return Effect(
        name=CORE_SHAPE,
        summary=MODEL_FORM.summary,
        family="shape",
        site=Site.CORE,
        parameters=parameters,
        starting_points=grid,
        form=None,
        source="Ikhouane and Rodellar, Systems with Hysteresis, section 2; Billings, Nonlinear System "
        "Identification, section 2",
        linear_parameters=len(terms),
        extra_degrees_of_freedom=_PRICE - len(terms) - 1,
    )


def _at(expression: Expression, slope: float) -> Expression:
    match expression:
        case Lagged(2, _):
            return Constant(slope)
        case Apply(primitive, arguments):
            return Apply(primitive, tuple(_at(argument, slope) for argument in arguments))
    return expression


#: The effect for a model and the terms that it lacks.
MODEL_FORM = EffectTemplate(
    CORE_SHAPE,
    "The model's own form is wrong: it lacks psi |y - c u|, |psi| (y - c u), psi(k-1), psi its regressors",
    similar_to="second-hysteresis, coulomb-friction, exponential-creep",
    distinguished_by="a loop that is too wide or too narrow wherever the input moves",
)
