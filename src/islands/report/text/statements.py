"""Statements about the recommended model of a result, from ``result.json`` alone.

Each statement has a name, a predicate on the document and a sentence. Every text about a result consists of
them, so that a run, its folder, the REST service, the report and a notebook state the same.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from math import floor, inf
from typing import Any, Final, Generic, Protocol, TypeVar

from islands.errors import name_option
from islands.estimation.estimator_table import SIGNIFICANT
from islands.models.equations import name_columns
from islands.progress import Failure, attempt
from islands.records.preprocessing_steps import Preprocessing
from islands.records.split import compare_input_ranges
from islands.report.text.dry_friction import DryFriction, find_dry_friction
from islands.rounding import RESOLUTION
from islands.validation.predictable_residual import ADEQUATE, LARGEST_SHARE, NOT_COMPUTED
from islands.validation.prediction_bands import LEVEL

#: Smallest R2 of a simulation that counts as good.
_GOOD_R2 = 0.9

#: R2 of a simulation below which it is hardly better than the mean of the output.
_NO_R2 = 0.05

#: Largest ratio of the free-run error and the noise level at which the error is that of the noise.
_NOISE_RATIO = 1.2

#: Ratio of the free-run error and the noise level from which on noise does not explain the error.
_FAR_RATIO = 3.0

#: Ratio of the errors on validation data and estimation data above which a model does not generalise.
_LARGE_RATIO = 2.0

#: Ratio of the free-run error and that one step ahead below which the free run is better.
_BETTER = 0.95

#: Ratio of the errors on estimation data and validation data above which the latter is too favourable.
_LARGE_INVERSE_RATIO = 3.0

#: Least fraction of the validation samples inside a band of 90 %: two standard errors of 20 independent ones.
_LEAST_COVERAGE = 0.75

#: Ratio of a likely error on new data and the error on the validation data from which on it is stated: of
#: fewer than 17 independent samples.
UNCERTAIN_RATIO = 1.4

#: Largest ratio that is stated: of two independent samples, and as an order of magnitude.
_LARGEST_RATIO = 5.0

#: Normal quantile of 5 %: a likely error is one that is exceeded in one of twenty cases.
_LOWER_QUANTILE = -1.645

#: Error of a linear model relative to that of the model below which the model is no better.
_BETTER_THAN_LINEAR = 1.05

#: Inclusion probability from which a term is certain.
_CERTAIN = 0.9

#: Inclusion probability below which most of the weight is on models without the term.
_UNLIKELY = 0.5

#: Closure of a loop, in per cent of the output range, above which the loop is open.
_OPEN_PERCENT = 5.0

#: Where to look for missing terms, by correlation test.
_HINTS = {
    "xi_xi": "terms in past outputs (larger lags{lags}, other powers), or a model of coloured noise",
    "u_xi": "linear or odd terms in {input}, also at larger lags{lags}",
    "xi_xiu": "products of past outputs and {input}",
    "u2_xi": "even terms in {input}, such as squares or absolute values",
    "u2_xi2": "terms that grow with {input}, because the size of the residual depends on it",
}

#: Estimators of the parameters, by the name of the criterion.
_ESTIMATES = {
    "least-squares": "least squares of the error one step ahead",
    "extended-least-squares": "least squares of the error one step ahead, with a model of the noise",
    "shooting": "least error of simulations over {interval} samples",
    "free-run": "least error of the free run",
    "output-error": "least error of the free run and its initial state (linear output-error model)",
    "box-jenkins": "least error of the free run and its initial state, whitened (linear Box-Jenkins model)",
}

#: What is added to an error on the validation data if the parameters were estimated again after it.
BEFORE_REFIT = "measured before the parameters were estimated again on all data"

#: Values of a JSON object.
Document = Mapping[str, Any]

F = TypeVar("F")
F_contra = TypeVar("F_contra", contravariant=True)


class SimulationFacts(Protocol):
    """Quantities that decide on the use of a result of one output or several as a simulation."""

    @property
    def simulates(self) -> bool:
        """Whether the free run follows every output."""
        ...

    @property
    def predicts(self) -> bool:
        """Whether the prediction one step ahead follows every output."""
        ...

    @property
    def has_limits(self) -> bool:
        """Whether a check fails."""
        ...

    @property
    def extrapolation(self) -> list[str]:
        """Inputs of the validation data that leave the range of the estimation data."""
        ...

    @property
    def measured(self) -> str:
        """Measured quantities of the verdict."""
        ...


class RunFacts:
    """Quantities of the free run of one output.

    Parameters
    ----------
    metrics : mapping
        Errors by part and simulation; null for a divergence.
    unit : str
        Unit of the output.
    bands, residual, data : mapping
        Prediction bands, residual tests and facts about the data; empty if they are unknown.
    """

    def __init__(
        self, metrics: Document, unit: str, bands: Document, residual: Document, data: Document
    ) -> None:
        self.metrics, self.unit, self.bands, self.residual, self.data = metrics, unit, bands, residual, data

    def error(self, mode: str = "free_run", part: str = "validation") -> Document:
        """Return the errors of a simulation; null for a divergence."""
        errors: Document = self.metrics[part][mode]
        return errors

    def write_amount(self, value: float) -> str:
        """Write a value of the output with its unit."""
        return write_amount(value, self.unit)

    @property
    def coverage(self) -> float | None:
        """Fraction of the validation samples in the band."""
        found: float | None = self.bands.get("coverage")
        return found

    @property
    def is_covered(self) -> bool:
        """Whether the band contains enough of the validation samples, as far as that is known."""
        return self.coverage is None or self.coverage >= _LEAST_COVERAGE

    @property
    def independent_samples(self) -> float | None:
        """Number of independent samples that the errors on the validation data are worth."""
        found: float | None = self.bands.get("independent_samples")
        return found

    @property
    def likely_ratio(self) -> float:
        """Largest likely ratio of the error on new data and that on the validation data; 0 if it is unknown.

        The variance of normal errors is estimated with as many degrees of freedom as there are independent
        samples. The quantile of its chi-square distribution is that of Wilson and Hilferty (1931).
        """
        count = self.independent_samples
        if count is None or self.error()["rmse"] is None or self.is_rounding(self.error()["rmse"]):
            return 0.0
        share = 2.0 / (9.0 * count)
        root = 1.0 - share + _LOWER_QUANTILE * share**0.5
        return root**-1.5 if root > 0.0 else inf

    @property
    def is_vague(self) -> bool:
        """Whether the band is wider than the range of the output, so that it says nothing about it."""
        output_range = self.data.get("output_range")
        return bool(self.bands and output_range and 2.0 * typical_half_width(self.bands) > output_range)

    @property
    def verdict(self) -> str | None:
        """Verdict on the residual of the free run. Results of earlier versions have none."""
        found: str | None = self.residual.get("verdict")
        return found

    def share(self, mode: str) -> float | None:
        """Return the predictable share of a residual; null after a divergence."""
        found: float | None = self.residual.get("predictable_share", {}).get(mode)
        return found

    @property
    def has_structure(self) -> bool:
        """Whether the residual of the free run has a predictable part, or the free run diverges."""
        return self.verdict not in (ADEQUATE, NOT_COMPUTED, None)

    @property
    def has_visible_structure(self) -> bool:
        """Whether the residual of the free run has a predictable part."""
        return self.has_structure and self.residual["predictable_percent"] is not None

    @property
    def is_unrelated(self) -> bool:
        """Whether the free run is hardly better than the mean of an output that nothing predicts."""
        r2 = self.error()["r2"]
        return r2 is not None and r2 < _NO_R2 and self.is_unpredictable

    @property
    def simulates(self) -> bool:
        """Whether the free run follows the output: R2 is good, or the error is that of the noise."""
        rmse, r2, noise = self.error()["rmse"], self.error()["r2"], self.data.get("noise")
        if rmse is None or self.is_unrelated:
            return False
        # R2 is undefined for a constant output.
        return r2 is None or r2 >= _GOOD_R2 or (noise is not None and rmse <= _NOISE_RATIO * noise)

    @property
    def predicts(self) -> bool:
        """Whether the prediction one step ahead follows the output."""
        return (self.error("one_step_ahead")["r2"] or 0.0) >= _GOOD_R2

    def is_rounding(self, rmse: float) -> bool:
        """Return whether an error is that of rounding: its ratio to another one says nothing."""
        return bool(rmse <= RESOLUTION * self.data.get("output_range", 0.0))

    @property
    def least_error(self) -> float | None:
        """Error one step ahead that cannot be predicted: the smallest that the data show."""
        found: float | None = self.error("one_step_ahead")["rmse"]
        return None if exceeds_limit(self.share("one_step_ahead")) else found

    @property
    def one_step_ratio(self) -> float:
        """Error one step ahead divided by the noise level, as written; 0 if one of them is unknown."""
        rmse, noise = self.error("one_step_ahead")["rmse"], self.data.get("noise")
        return 0.0 if rmse is None or not noise or self.is_rounding(rmse) else round_ratio(rmse / noise)

    @property
    def is_far_ahead(self) -> bool:
        """Whether the error one step ahead is far above the noise."""
        return self.one_step_ratio >= _FAR_RATIO

    @property
    def noise_ratio(self) -> float | None:
        """Free-run error divided by the noise level, or by the least error if that is unknown, as written."""
        rmse, level = self.error()["rmse"], self.data.get("noise") or self.least_error
        return None if rmse is None or not level or self.is_rounding(rmse) else round_ratio(rmse / level)

    @property
    def is_unpredictable(self) -> bool:
        """Whether neither inputs nor past outputs predict the residual of the free run."""
        return self.verdict == ADEQUATE and not exceeds_limit(self.share("free_run"))

    @property
    def exceeds_noise(self) -> bool:
        """Whether an unpredictable residual of the free run is far above the noise."""
        return self.is_unpredictable and (self.noise_ratio or 0.0) >= _FAR_RATIO

    @property
    def error_ratio(self) -> float:
        """Free-run error on the validation data divided by that on the estimation data; 0 for rounding."""
        estimated, validated = (self.error(part=part)["rmse"] for part in ("estimation", "validation"))
        if not estimated or validated is None or self.is_rounding(validated):
            return 0.0
        return float(validated / estimated)

    @property
    def inverse_ratio(self) -> float:
        """Error on the estimation data divided by that on the validation data; infinite if it diverges."""
        estimated, validated = (self.error(part=part)["rmse"] for part in ("estimation", "validation"))
        if not validated or (estimated is not None and self.is_rounding(estimated)):
            return 0.0
        return inf if estimated is None else float(estimated / validated)

    @property
    def fits_poorly(self) -> bool:
        """Whether the error on the estimation data is much larger than that on the validation data."""
        return self.inverse_ratio > _LARGE_INVERSE_RATIO

    @property
    def generalises_poorly(self) -> bool:
        """Whether the error on the validation data is much larger than that on the estimation data."""
        return self.error_ratio > _LARGE_RATIO


class ResultFacts(RunFacts):
    """Quantities of a ``result.json`` that the statements read. Those of earlier versions lack some of them.

    Parameters
    ----------
    document : mapping
        Content of ``result.json``.
    """

    def __init__(self, document: Document) -> None:
        self.document = document
        self.record: Document = document["record"]
        # Results of earlier versions recommend no model.
        self.recommended: Document = document.get("recommended", {"rank": 1, "reasons": ()})
        self.model: Document = document["models"][self.recommended["rank"] - 1]
        self.physics: Document = self.model["physics"]
        model, unit = self.model, self.record["units"]["output"]
        bands, data = model.get("bands") or {}, document.get("data", {})
        super().__init__(model["metrics"], unit, bands, model["residual_tests"], data)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the output and of every input in equations."""
        columns = self.record["names"]
        return name_columns(columns["output"], columns["inputs"])

    @property
    def requires_property_1(self) -> bool:
        """Whether the search constrains the parameters of models of hysteresis."""
        return "hysteresis" in self.document["settings"]["constraints"]

    @property
    def claims_hysteresis(self) -> bool:
        """Whether the search is for models of hysteresis, or found a model with Property 1."""
        models = self.document["models"]
        return self.requires_property_1 or any(bool(entry["physics"]["property_1"]) for entry in models)

    @property
    def is_sound(self) -> bool:
        """Whether holds and excursions are bounded and, if required, Property 1 holds."""
        tests = (*self.physics["holds"], *self.physics["excursions"])
        bounded = all(test["bounded"] for test in tests)
        return bounded and bool(self.physics["property_1"] or not self.requires_property_1)

    @property
    def criterion(self) -> Document:
        """Error that the parameters minimise. Empty in results of earlier versions."""
        return self.model.get("criterion") or {}

    @property
    def refit(self) -> Document:
        """Estimate of the parameters on all data. Empty if there is none."""
        return self.model.get("refit") or {}

    @property
    def linear(self) -> Document:
        """Linear model of the same data. Empty if the model is linear, and in results of earlier versions."""
        return self.document.get("linear") or {}

    @property
    def linear_error(self) -> float:
        """RMSE of the free run of that linear model on the validation data."""
        return float(self.linear["metrics"]["validation"]["free_run"]["rmse"])

    @property
    def linear_ratio(self) -> float | None:
        """Error of the linear model relative to that of the model; None if that is unknown or exact."""
        own = self.error()["rmse"]
        return None if not self.linear or not own or self.is_rounding(own) else self.linear_error / own

    @property
    def has_tried_free_run(self) -> bool:
        """Whether the validation data have chosen between least squares and the error of the free run."""
        return bool(self.document["settings"].get("estimator") == "")

    @property
    def has_output_noise(self) -> bool:
        """Whether least squares is biased by noise of the measured output.

        The measured past then makes the prediction one step ahead worse than an adequate free run.
        """
        if self.criterion.get("estimator") != "least-squares" or self.is_unrelated or self.has_tried_free_run:
            return False
        return self.is_unpredictable and all(map(self._is_free_run_better, ("estimation", "validation")))

    def _is_free_run_better(self, part: str) -> bool:
        """Return whether the free run is clearly better than the prediction one step ahead."""
        free, one = self.error(part=part)["rmse"], self.error("one_step_ahead", part)["rmse"]
        return bool(free is not None and one and not self.is_rounding(one) and free < _BETTER * one)

    @cached_property
    def extrapolation(self) -> list[str]:
        """Inputs of the validation data that leave the range of the estimation data."""
        if "inputs" not in self.data:
            return []
        ranges, columns = self.data["inputs"], self.record
        found = compare_input_ranges(
            columns["names"]["inputs"], columns["units"]["inputs"], ranges["estimation"], ranges["validation"]
        )
        # The ranges that are stated before a search are those of the samples of the record.
        count = self.document["preprocessing"]["average"]
        return [f"{each}, in means of {count} samples" for each in found] if count > 1 else found

    @property
    def ignores_limits(self) -> bool:
        """Whether the measured output is flat at an extreme, and the model is a difference equation."""
        limits = self.data.get("output_limits") or ()
        return "kind" not in self.model and any(each is not None for each in limits)

    @property
    def is_unpredictable_ahead(self) -> bool:
        """Whether the error of the free run has a cause that the residual one step ahead does not show."""
        return (self.has_structure or self.exceeds_noise) and not exceeds_limit(self.share("one_step_ahead"))

    @property
    def has_limits(self) -> bool:
        """Whether a check fails."""
        return bool(find_statements(FAILURES, self))

    @property
    def measured(self) -> str:
        """Measured quantities of the verdict."""
        return "; ".join(write_statements(VERDICT_DETAILS, self))

    @property
    def counts_samples(self) -> bool:
        """Whether k counts samples of the given data: means or filtered rates have other units."""
        done = self.document["preprocessing"]
        steps = done.get("steps")
        filtered = steps is not None and Preprocessing.from_document(steps).has_rate_steps
        return bool(done["average"] == 1 and not filtered)

    @cached_property
    def friction(self) -> DryFriction | None:
        """Dry friction of a model of a velocity."""
        return find_dry_friction(self.model["terms"], self.unit) if self.counts_samples else None

    @property
    def has_named_parameters(self) -> bool:
        """Whether the models are of a class with named parameters in place of terms."""
        return "kind" in self.model

    @cached_property
    def doubtful(self) -> list[tuple[str, float]]:
        """Terms that are not certain, each with the probability of its inclusion."""
        return list_doubtful(self.model["terms"])

    @cached_property
    def insignificant(self) -> list[str]:
        """Terms whose parameters are within two standard errors of zero."""
        return list_insignificant(self.model["terms"])

    @property
    def constraints(self) -> list[Document]:
        """Constraints of the user; the physics checks state whether Property 1 holds."""
        return [check for check in self.model["constraints"] if check["text"] != "hysteresis"]

    @property
    def implausible(self) -> list[Document]:
        """Extremes of the inputs at which the output diverges or is far from its range."""
        # Results of earlier versions have no extremes, or do not state which are plausible.
        return [test for test in self.physics.get("extremes", ()) if not test.get("plausible", True)]

    @property
    def missing_checks(self) -> list[str]:
        """Names of the checks that are not computed."""
        checks = {"physics checks": self.physics, "residual tests": self.residual}
        return [name for name, each in checks.items() if each.get("not_computed")]

    @property
    def diverging(self) -> list[str]:
        """Names of the excursions at which the output diverges."""
        return [test["name"] for test in self.physics["excursions"] if not test["bounded"]]

    @property
    def lost_holds(self) -> int:
        """Number of holds in which the output diverges."""
        return sum(not hold["bounded"] for hold in self.physics["holds"])

    @property
    def open_loops(self) -> list[Document]:
        """Excursions of a model of hysteresis whose loops do not close."""
        if not self.claims_hysteresis:
            return []
        tests = self.physics["excursions"]
        return [
            test for test in tests if test["bounded"] and (test["closure_percent"] or 0.0) > _OPEN_PERCENT
        ]


@dataclass(frozen=True, slots=True)
class Statement(Generic[F_contra]):
    """A statement about a result.

    Attributes
    ----------
    name : str
    holds : callable
        Predicate: whether the facts of a result make the statement true.
    write : callable
        Text of a statement that holds: a sentence, or a part of one.
    """

    name: str
    holds: Callable[[F_contra], object]
    write: Callable[[F_contra], str]


def find_statements(statements: Iterable[Statement[F]], facts: F) -> list[Statement[F]]:
    """Return the statements that hold, and those of which that is unknown because their predicate fails."""
    return [each for each in statements if attempt(partial(each.holds, facts))]


def write_amount(value: float, unit: str) -> str:
    """Write a value with its unit."""
    return f"{value:.4g} {unit}".rstrip()


def write_percent(share: float) -> str:
    """Write a share in per cent."""
    return f"{100 * share:.0f} %"


def round_down(share: float) -> str:
    """Write a share so that one below a limit never shows the limit."""
    return f"{floor(100 * share) / 100:.2f}"


def round_ratio(ratio: float) -> float:
    """Round a ratio to the digits that are written, so that a limit decides as the written value does."""
    return float(f"{ratio:.3g}")


def list_doubtful(terms: Iterable[Document]) -> list[tuple[str, float]]:
    """Return the terms that are not certain, each with the probability of its inclusion."""
    shares = [(term["term"], term.get("inclusion")) for term in terms if "term" in term]
    return [(text, share) for text, share in shares if share is not None and share < _CERTAIN]


def list_insignificant(terms: Iterable[Document]) -> list[str]:
    """Return the terms whose parameters are within two standard errors of zero."""
    return [
        term.get("term", term["regressor"])
        for term in terms
        if term["standard_error"] is not None
        and abs(term["parameter"]) < SIGNIFICANT * term["standard_error"]
    ]


def describe(document: Document) -> list[str]:
    """Describe the recommended model in sentences: equation, error, uses, failures and next steps.

    The equation and the units are indented.

    Parameters
    ----------
    document : mapping
        Content of ``result.json``.
    """
    facts = ResultFacts(document)
    return [
        describe_choice(document),
        f"    {facts.model.get('named_equation', facts.model['equation'])}",
        f"    {describe_units(document)}",
        *describe_findings(document),
    ]


def describe_choice(document: Document) -> str:
    """State which model is recommended, and the first reason, or that none is of use."""
    facts = ResultFacts(document)
    rank, reasons = facts.recommended["rank"], facts.recommended["reasons"]
    if facts.is_unrelated:
        return f"No model found: {_describe_unrelated(facts)}. Model {rank} of {len(document['models'])}:"
    text = f"Recommended: model {rank} of {len(document['models'])}, size {facts.model['size']}"
    return f"{text}: {reasons[0]}." if reasons else f"{text}."


def describe_units(document: Document) -> str:
    """State the units of the columns, the signals that the equation reads and direct feedthrough."""
    facts = ResultFacts(document)
    units = facts.record["units"]
    pairs = zip(facts.names, (units["output"], *units["inputs"]), strict=True)
    listed = ", ".join(f"{name} in {unit}" for name, unit in pairs if unit)
    head = f"{'; '.join(filter(None, [listed, _describe_rate(facts)]))}."
    return " ".join([head, *write_statements(_REMARKS, facts)])


def describe_findings(document: Document) -> list[str]:
    """Describe errors, uncertainty, uses, failures and next steps of the recommended model."""
    facts = ResultFacts(document)
    good, bad = write_statements(USES, facts), write_statements(FAILURES, facts)
    return [
        *write_statements(MEASURES, facts),
        *write_statements(VERDICTS, facts),
        f"Good for: {'; '.join(good) or 'no use that the checks confirm'}.",
        f"Fails at: {'; '.join(bad) or 'none of the checks'}.",
        f"Next: {'; '.join(write_statements(NEXT_STEPS, facts))}.",
        *describe_not_computed(document),
    ]


def describe_not_computed(document: Document) -> list[str]:
    """State each optional step that failed, with the reason; a result of an earlier version has none."""
    return [f"Not computed: {each['step']}: {each['reason']}." for each in document.get("not_computed", ())]


def write_statements(statements: Iterable[Statement[F]], facts: F) -> list[str]:
    """Return the texts of the statements that hold; the text of one that fails says so."""
    texts = []
    for each in statements:
        text = attempt(partial(_write_statement, each, facts))
        if isinstance(text, Failure):
            texts.append(f"(not computed: {each.name}: {text.reason})")
        elif text is not None:
            texts.append(text)
    return texts


def _write_statement(statement: Statement[F], facts: F) -> str | None:
    return statement.write(facts) if statement.holds(facts) else None


def _describe_rate(facts: ResultFacts) -> str:
    model, done = facts.model, facts.document["preprocessing"]
    signals, steps = model.get("named_signals", model.get("signals", "")), done.get("steps")
    if facts.counts_samples:
        return "; ".join(filter(None, [signals, f"k counts samples of {done['dt']:g} s"]))
    dt = facts.record["dt"] if steps is None else steps["dt"]
    return f"{signals}, and simulate prepares a record of {dt:g} s in the same way"


def _describe_feedthrough(facts: ResultFacts) -> str:
    inputs = ", ".join(facts.document["preprocessing"]["feedthrough"])
    return f"Direct feedthrough: the output responds to {inputs} within the sample, so models read it at k."


def _describe_friction(friction: DryFriction, facts: ResultFacts) -> str:
    step, dt = facts.write_amount(friction.step), facts.document["preprocessing"]["dt"]
    text = f"Dry friction: {step} against the motion in each sample of {dt:g} s"
    if friction.input is not None:
        (name,), (unit,) = facts.record["names"]["inputs"], facts.record["units"]["inputs"]
        text += f", as much as {write_amount(friction.input, unit)} of {name}"
    return f"{text}."


def _describe_criterion(facts: ResultFacts) -> str:
    found = facts.criterion
    text = _ESTIMATES[found["estimator"]].format(interval=found["interval"])
    return f"Parameters: {text}{', under constraints' if facts.model['constraints'] else ''}."


def is_refitted(entry: Document) -> bool:
    """Return whether the parameters of a model are others than those that its errors belong to.

    Parameters
    ----------
    entry : mapping
        Entry of the model in ``result.json``.
    """
    refit = entry.get("refit")
    return bool(refit and not refit["discarded"])


def _describe_refit(facts: ResultFacts) -> str:
    return (
        f"Refit: the parameters were estimated again on all {facts.refit['samples']} samples, estimation and "
        "validation data together; errors, residual tests and bands are measured with the parameters before, "
        "since no data are left to measure the new ones."
    )


def _describe_discarded_refit(facts: ResultFacts) -> str:
    return (
        "Refit: discarded, the parameters are those of the estimation data. With estimation and validation "
        f"data, {facts.refit['discarded']}."
    )


def _describe_error(facts: ResultFacts) -> str:
    free = facts.error()
    parts = [f"RMSE {facts.write_amount(free['rmse'])}"]
    # Both are undefined for a constant output.
    if free["mape"] is not None:
        parts.append(f"mean absolute error {free['mape']:.3g} % of the output range")
    if free["r2"] is not None:
        parts.append(f"R2 {free['r2']:.5f}")
    estimated = facts.model.get("estimated_start", False)
    start = "and initial outputs estimated from its first samples" if estimated else "alone"
    head = f"Error: free run on the validation data, from the inputs {start}, {', '.join(parts)}"
    return f"{head}; one step ahead {_describe_one_step(facts)}."


def _describe_linear_model(facts: ResultFacts) -> str:
    size = facts.linear["size"]
    text = f"Linear model: RMSE {facts.write_amount(facts.linear_error)} with {size} terms"
    ratio = facts.linear_ratio
    return f"{text}." if ratio is None else f"{text}, {ratio:.3g} times the error of this model."


def _describe_one_step(facts: ResultFacts) -> str:
    rmse = facts.error("one_step_ahead")["rmse"]
    return "it diverges" if rmse is None else f"RMSE {facts.write_amount(rmse)}"


def _describe_recordings(facts: ResultFacts) -> str:
    errors = facts.model["recordings"]["validation"].items()
    listed = [
        f"{name} {'diverges' if each['rmse'] is None else facts.write_amount(each['rmse'])}"
        for name, each in errors
    ]
    return f"RMSE of the free run by recording: {', '.join(listed)}."


def _describe_missing_outputs(facts: ResultFacts) -> str:
    return (
        f"Missing outputs: {facts.data['missing_outputs']} of {facts.record['samples']} samples are skipped, "
        "and every simulation is started again after them."
    )


def _describe_left_out(facts: ResultFacts) -> str:
    found = facts.data["left_out"]
    without, together = (facts.write_amount(found[key]) for key in ("rmse", "rmse_with"))
    return (
        f"Gross errors: over the whole record, the free run has an RMSE of {without} without the "
        f"{found['samples']} samples that are left out, and of {together} with them."
    )


def _describe_uncertainty(facts: ResultFacts) -> str:
    half = facts.write_amount(typical_half_width(facts.bands))
    text = f"Uncertainty: the {100 * LEVEL:g} % prediction band of the free run has a median half-width of "
    text += half
    if facts.has_named_parameters:
        return f"{text}."
    doubtful = [f"{term} {round_down(share)}" for term, share in facts.doubtful]
    if doubtful:
        return f"{text}; doubtful terms, with the probability of their inclusion: {', '.join(doubtful)}."
    return f"{text}; every term has an inclusion probability of {_CERTAIN:g} or more."


def typical_half_width(bands: Document) -> float:
    """Return the median half-width of the band of the default level."""
    half: float = bands["factors"][bands["levels"].index(LEVEL)] * bands["width"]
    return half


def _describe_met_constraints(facts: ResultFacts) -> str:
    met = [_name_constraint(check) for check in facts.constraints if check["met"]]
    return f"Constraints that the model meets: {'; '.join(met)}."


def _name_constraint(check: Document) -> str:
    named: str = check.get("named", check["text"])
    return named


def _describe_unmet_constraint(check: Document) -> str:
    value = "undefined" if check["value"] is None else f"{check['value']:.6g}"
    return f"the constraint {_name_constraint(check)} (value {value})"


def _describe_verdict(word: str) -> Callable[[SimulationFacts], str]:
    """Return a writer of the verdict, with the measured quantities of the free run in brackets."""

    def write(facts: SimulationFacts) -> str:
        measured = facts.measured
        return f"As a simulation: {word} ({measured})." if measured else f"As a simulation: {word}."

    return write


def exceeds_limit(share: float | None) -> bool:
    """Return whether more than the limit of a residual is predictable, or the share is unknown."""
    return share is None or share > LARGEST_SHARE


def describe_error_level(facts: RunFacts, name: str) -> str:
    """State the error of a bounded free run against the noise level of the output, or one step ahead.

    Parameters
    ----------
    facts : RunFacts
    name : str
        Name of the output.

    Returns
    -------
    str
        Empty if neither is known, the free run diverges, its error is a rounding error, or nothing predicts
        the output.
    """
    ratio, noise = facts.noise_ratio, facts.data.get("noise")
    if ratio is None or facts.is_unrelated:
        return ""
    if not noise:
        return f"RMSE {ratio:.3g} times the unpredictable error one step ahead"
    # The level has an uncertainty: an error below it is no contradiction.
    times = "at" if ratio <= _NOISE_RATIO else f"{ratio:.3g} times"
    return f"RMSE {times} the noise level of {name}, {facts.write_amount(noise)}"


def describe_unexplained_error(facts: RunFacts) -> str:
    """State that the free-run error is far above the noise, although its residual is unpredictable."""
    level = "noise level" if facts.data.get("noise") else "error one step ahead"
    return (
        f"the free-run error is {facts.noise_ratio:.3g} times the {level}, and neither inputs nor past "
        "outputs predict it: a disturbance, or a state that the model lacks"
    )


def describe_estimation_error(facts: RunFacts) -> str:
    """State how much larger the free-run error on the estimation data is than that on the validation data."""
    ratio = facts.inverse_ratio
    if ratio == inf:
        return "the free run on the estimation data diverges"
    return f"the free-run error on the estimation data is {ratio:.2g} times that on the validation data"


def describe_few_errors(facts: RunFacts) -> str:
    """State how much larger the error on new data may be, since the errors are correlated."""
    return (
        "its errors are correlated and count as about "
        f"{facts.independent_samples or 0.0:.0f} independent samples, so that the RMSE on new data may be "
        f"{min(facts.likely_ratio, _LARGEST_RATIO):.2g} times as large"
    )


def describe_wide_band() -> str:
    """State that the models that the data do not exclude disagree by more than the output moves."""
    return (
        f"the {100 * LEVEL:g} % prediction band is wider than the output range: the free runs of models that "
        "the data do not exclude are far apart"
    )


def describe_excess(facts: RunFacts) -> str:
    """State how much larger the free-run error on the validation data is than that on the estimation data."""
    ratio = f"{facts.error_ratio:.2g}"
    return f"the free-run error on the validation data is {ratio} times that on the estimation data"


def _describe_reason(facts: ResultFacts) -> str:
    reason: str = facts.recommended["reasons"][1]
    return reason


def _has_physics_reason(facts: ResultFacts) -> bool:
    return len(facts.recommended["reasons"]) > 1


def _describe_unrelated(facts: ResultFacts) -> str:
    share = write_percent(max(0.0, facts.error()["r2"]))
    return (
        f"the free run explains {share} of the variance of {facts.names[0]}, and neither inputs nor past "
        "outputs predict the rest"
    )


def _describe_structure(facts: ResultFacts) -> str:
    return (
        f"{write_percent(facts.share('free_run') or 0.0)} of the free-run residual is predictable "
        f"(RMS {facts.residual['predictable_percent']:.2g} % of the output range)"
    )


def _describe_implausible(facts: ResultFacts) -> str:
    return "; ".join(
        f"the output {_describe_escape(test)} at {_describe_level(facts, test['level'])} "
        f"({abs(test['level']):g} of the recorded amplitude)"
        for test in facts.implausible
    )


def _describe_escape(test: Document) -> str:
    if not test["bounded"]:
        return "diverges"
    if test["ranges"] is None:
        return "changes, but is constant in the record,"
    return f"leaves its recorded range by {test['ranges']:.3g} ranges"


def _describe_level(facts: ResultFacts, level: float) -> str:
    """Return the values of the inputs at a level of the physics checks: ``u = -1 V, valve = 3``."""
    if "inputs" not in facts.data:
        return f"{level:g} of the amplitude of the inputs"
    values = [(low + high) / 2 + level * (high - low) / 2 for low, high in facts.data["inputs"]["estimation"]]
    parts = zip(facts.names[1:], values, facts.record["units"]["inputs"], strict=True)
    return ", ".join(f"{name} = {write_amount(value, unit)}" for name, value, unit in parts)


def _describe_open_loops(facts: ResultFacts) -> str:
    worst = max(facts.open_loops, key=lambda test: test["closure_percent"])
    return f"loops do not close at {worst['name']}: {worst['closure_percent']:.3g} % of the output range"


def _largest_size(facts: ResultFacts) -> int:
    return max(int(entry["size"]) for entry in facts.document["models"])


def _may_grow(facts: ResultFacts) -> bool:
    is_largest = facts.model["size"] == _largest_size(facts)
    return facts.has_structure and is_largest and "max_terms" in facts.document["settings"]


def _describe_longer_record(facts: ResultFacts) -> str:
    # The recommended model is the smallest one that is as good as the best, unless by another rule.
    smaller = " or a smaller model" if facts.document["settings"].get("select") == "fitness" else ""
    return f"try a longer record{smaller}, since {describe_insignificant(facts.insignificant)}"


def describe_insignificant(terms: Sequence[str]) -> str:
    """State the first of the terms whose parameters are not significant, and the number of the others."""
    more = f" (and of {len(terms) - 1} more)" if len(terms) > 1 else ""
    return f"the parameter of {terms[0]}{more} is within two standard errors of zero"


def _find_unlikely(facts: ResultFacts) -> tuple[str, float]:
    """Return the least probable term, with a probability of 1 if every term is certain."""
    return min(facts.doubtful, key=lambda each: each[1], default=("", 1.0))


def _describe_unlikely(facts: ResultFacts) -> str:
    term, share = _find_unlikely(facts)
    return (
        f"try a longer record, since models without {term} are about as good (probability of its "
        f"inclusion {round_down(share)})"
    )


def _suggest_form(facts: ResultFacts) -> str:
    """Return the hint of a steep nonlinearity that the residual does not show."""
    form = "terms of another form (a higher degree, another library)"
    if facts.has_named_parameters:
        form = _name_other_class(facts)
    times = f"{facts.one_step_ratio:.3g} times the noise level of {facts.names[0]}"
    return f"try {form}: the error one step ahead is {times}"


def _name_other_class(facts: ResultFacts) -> str:
    """Return which models to try in place of those of a class with named parameters."""
    fixed = "structure" in facts.document["settings"]
    any_structure = f"any structure ({name_option('structure', 'auto')}), or " if fixed else ""
    return f"{any_structure}another class of models, as NARX ({name_option('model', 'narx')})"


def _suggest_terms(facts: ResultFacts) -> str:
    """Return the hint of the test with an input that exceeds its limit by most, or of the one without."""
    if facts.has_named_parameters:
        return f"try {_name_other_class(facts)}"
    past, *tests = facts.residual["tests"]
    # The residual of a slow record is correlated in time whatever term is missing.
    excess = [test["largest"] / test["limit"] if test["largest"] and test["limit"] else 0.0 for test in tests]
    worst = tests[excess.index(max(excess))] if max(excess) > 1.0 else past
    name = "" if worst["input"] is None else facts.names[1 + worst["input"]]
    return f"try {_HINTS[worst['name']].format(input=name, lags=_name_lags(facts))}"


def _suggest_free_run_estimate(facts: ResultFacts) -> str:
    """Return the hint if only the free run has structure; the estimate is named unless it was tried."""
    option = name_option("estimator", "free-run")
    tried = facts.has_tried_free_run
    estimate = "" if tried else f"try an estimate that minimises the error of the free run ({option}), or "
    text = f"{estimate}measure the disturbance: one step ahead, "
    if facts.is_far_ahead:
        return f"{text}at most {write_percent(LARGEST_SHARE)} is predictable"
    return f"{text}no structure is left (at most {write_percent(LARGEST_SHARE)} is predictable)"


def _name_lags(facts: ResultFacts) -> str:
    """Return the option for twice the lags of the library; empty if they are unknown."""
    option = next((name for name in ("lags", "library_lags") if name in facts.document["settings"]), "")
    return f": {name_option(option, 2 * facts.document['settings'][option])}" if option else ""


# Statements about one output and about several outputs alike.

#: What a result can be used for as a simulation.
SIMULATION_USES: Final[tuple[Statement[SimulationFacts], ...]] = (
    Statement(
        "simulation",
        lambda facts: facts.simulates and not facts.has_limits,
        lambda _: "simulation from the inputs alone",
    ),
    Statement(
        "simulation-within-limits",
        lambda facts: facts.simulates and facts.has_limits,
        lambda _: "simulation from the inputs alone, within the limits below",
    ),
    Statement(
        "prediction",
        lambda facts: not facts.simulates and facts.predicts,
        lambda _: "prediction one step ahead",
    ),
)

#: The verdict on the use as a simulation; one of them holds.
VERDICTS: Final[tuple[Statement[SimulationFacts], ...]] = (
    Statement("good", lambda facts: facts.simulates and not facts.has_limits, _describe_verdict("good")),
    Statement(
        "usable",
        lambda facts: facts.simulates and facts.has_limits,
        _describe_verdict("usable, with limits"),
    ),
    Statement("unsuitable", lambda facts: not facts.simulates, _describe_verdict("unsuitable")),
)

NO_SIMULATION: Final[Statement[RunFacts]] = Statement(
    "no-simulation",
    lambda facts: facts.error()["rmse"] is None,
    lambda _: "simulation from the inputs alone: the free run diverges",
)

EXTRAPOLATION: Final[Statement[SimulationFacts]] = Statement(
    "extrapolation",
    lambda facts: facts.extrapolation,
    lambda facts: "; ".join(f"extrapolation: {each}" for each in facts.extrapolation),
)

TEST: Final[Statement[object]] = Statement(
    "test",
    lambda _: True,
    lambda _: "check the model on a record that was not used (islands simulate)",
)

# Statements about one output.

#: Remarks on the equation.
_REMARKS: Final[tuple[Statement[ResultFacts], ...]] = (
    Statement(
        "feedthrough",
        lambda facts: facts.document["preprocessing"].get("feedthrough"),
        _describe_feedthrough,
    ),
    Statement(
        "reading",
        lambda facts: facts.record.get("reading"),
        lambda facts: " ".join(f"Reading: {step}." for step in facts.record["reading"]),
    ),
)

#: Estimate of the parameters, measured errors, uncertainty, and what the model meets.
MEASURES: Final[tuple[Statement[ResultFacts], ...]] = (
    Statement(
        "dry-friction",
        lambda facts: facts.friction,
        lambda facts: _describe_friction(facts.friction, facts) if facts.friction else "",
    ),
    Statement("criterion", lambda facts: facts.criterion, _describe_criterion),
    Statement("refit", lambda facts: is_refitted(facts.model), _describe_refit),
    Statement("discarded-refit", lambda facts: facts.refit.get("discarded"), _describe_discarded_refit),
    Statement("error", lambda facts: facts.error()["rmse"] is not None, _describe_error),
    Statement(
        "divergence",
        lambda facts: facts.error()["rmse"] is None,
        lambda facts: (
            "Error: the free run on the validation data diverges; one step ahead "
            f"{_describe_one_step(facts)}."
        ),
    ),
    Statement("linear-model", lambda facts: facts.linear, _describe_linear_model),
    Statement(
        "recordings",
        lambda facts: facts.model.get("recordings", {}).get("validation"),
        _describe_recordings,
    ),
    Statement("missing-outputs", lambda facts: facts.data.get("missing_outputs"), _describe_missing_outputs),
    Statement("left-out", lambda facts: facts.data.get("left_out"), _describe_left_out),
    Statement(
        "uncertainty",
        lambda facts: facts.bands and facts.document.get("ensemble") is not None,
        _describe_uncertainty,
    ),
    Statement(
        "met-constraints",
        lambda facts: any(check["met"] for check in facts.constraints),
        _describe_met_constraints,
    ),
    Statement(
        "preset",
        lambda facts: facts.document["settings"].get("choice", {}).get("reasons"),
        lambda facts: " ".join(facts.document["settings"]["choice"]["reasons"]),
    ),
)

#: Measured quantities of the verdict.
VERDICT_DETAILS: Final[tuple[Statement[ResultFacts], ...]] = (
    Statement(
        "predictable-share",
        lambda facts: facts.share("free_run") is not None,
        lambda facts: (
            f"{write_percent(facts.share('free_run') or 0.0)} of the residual of the free run is predictable"
        ),
    ),
    Statement(
        "error-level",
        lambda facts: describe_error_level(facts, facts.names[0]),
        lambda facts: describe_error_level(facts, facts.names[0]),
    ),
    Statement(
        "coverage",
        lambda facts: facts.coverage is not None,
        lambda facts: (
            f"{write_percent(facts.coverage or 0.0)} of the validation samples are in the "
            f"{100 * LEVEL:g} % band"
        ),
    ),
    Statement("few-errors", lambda facts: facts.likely_ratio >= UNCERTAIN_RATIO, describe_few_errors),
    Statement(
        "one-step-share",
        lambda facts: facts.share("one_step_ahead") is not None,
        lambda facts: f"one step ahead, {write_percent(facts.share('one_step_ahead') or 0.0)} is predictable",
    ),
)

#: What the model can be used for.
USES: Final[tuple[Statement[ResultFacts], ...]] = (
    *SIMULATION_USES,
    Statement(
        "adequate-residual",
        lambda facts: facts.is_unpredictable and not (facts.exceeds_noise or facts.is_unrelated),
        lambda _: (
            "no structure is left in the free-run residual (at most "
            f"{write_percent(LARGEST_SHARE)} is predictable)"
        ),
    ),
    Statement(
        "rounding-residual",
        lambda facts: facts.verdict == ADEQUATE and exceeds_limit(facts.share("free_run")),
        lambda _: "the residual is a rounding error",
    ),
    Statement("sound", lambda facts: _has_physics_reason(facts) and facts.is_sound, _describe_reason),
)

#: Checks that the model fails.
FAILURES: Final[tuple[Statement[ResultFacts], ...]] = (
    Statement("unsound", lambda facts: _has_physics_reason(facts) and not facts.is_sound, _describe_reason),
    Statement(
        "unmet-constraints",
        lambda facts: any(not check["met"] for check in facts.constraints),
        lambda facts: "; ".join(
            _describe_unmet_constraint(check) for check in facts.constraints if not check["met"]
        ),
    ),
    NO_SIMULATION,
    Statement("unrelated", lambda facts: facts.is_unrelated, _describe_unrelated),
    Statement(
        "poor-simulation",
        lambda facts: facts.error()["rmse"] is not None and not (facts.simulates or facts.is_unrelated),
        lambda facts: f"simulation from the inputs alone: R2 {facts.error()['r2']:.3f}",
    ),
    Statement(
        "diverging-excursions",
        lambda facts: facts.diverging,
        lambda facts: f"diverges at {', '.join(facts.diverging)}",
    ),
    Statement(
        "missing-checks",
        lambda facts: facts.missing_checks,
        lambda facts: f"{' and '.join(facts.missing_checks)}: not computed",
    ),
    Statement(
        "diverging-holds",
        lambda facts: facts.lost_holds,
        lambda facts: f"diverges in {facts.lost_holds} of {len(facts.physics['holds'])} holds of the inputs",
    ),
    Statement("implausible-extremes", lambda facts: facts.implausible, _describe_implausible),
    Statement(
        "no-better-than-linear",
        lambda facts: facts.linear_ratio is not None and facts.linear_ratio < _BETTER_THAN_LINEAR,
        lambda facts: f"no better than a linear model of {facts.linear['size']} terms",
    ),
    Statement(
        "drift",
        lambda facts: (
            facts.requires_property_1
            and not facts.physics["property_1"]
            and facts.physics["hold_drift_percent"] is not None
        ),
        lambda facts: (
            f"the output drifts by {facts.physics['hold_drift_percent']:.3g} % of its range at constant input"
        ),
    ),
    Statement("open-loops", lambda facts: facts.open_loops, _describe_open_loops),
    Statement("predictable-residual", lambda facts: facts.has_visible_structure, _describe_structure),
    Statement("unexplained-error", lambda facts: facts.exceeds_noise, describe_unexplained_error),
    Statement(
        "low-coverage",
        lambda facts: not facts.is_covered,
        lambda facts: (
            f"the {100 * LEVEL:g} % prediction band contains {write_percent(facts.coverage or 0.0)} of "
            "the validation samples"
        ),
    ),
    Statement("wide-band", lambda facts: facts.is_vague, lambda _: describe_wide_band()),
    Statement("error-ratio", lambda facts: facts.generalises_poorly, describe_excess),
    Statement("estimation-error", lambda facts: facts.fits_poorly, describe_estimation_error),
    EXTRAPOLATION,
)

#: What to do next.
NEXT_STEPS: Final[tuple[Statement[ResultFacts], ...]] = (
    Statement("more-terms", _may_grow, lambda facts: f"allow more than {_largest_size(facts)} terms"),
    Statement(
        # Correlations do not show what a steep nonlinearity leaves, as that of a titration curve.
        "terms-of-another-form",
        lambda facts: facts.is_unpredictable_ahead and facts.is_far_ahead,
        _suggest_form,
    ),
    Statement(
        "free-run-estimate",
        lambda facts: facts.is_unpredictable_ahead and facts.criterion.get("error", "free_run") != "free_run",
        _suggest_free_run_estimate,
    ),
    Statement(
        "other-terms",
        lambda facts: facts.has_structure and exceeds_limit(facts.share("one_step_ahead")),
        _suggest_terms,
    ),
    Statement(
        "output-noise",
        lambda facts: facts.has_output_noise,
        lambda _: (
            f"estimate with {name_option('estimator', 'free-run')}: the free run is better than the "
            "prediction one step ahead, so that the noise is that of the measured output, which biases least "
            "squares"
        ),
    ),
    Statement(
        "wider-record",
        lambda facts: facts.generalises_poorly or facts.extrapolation,
        lambda _: "estimate from a record that covers the amplitudes and rates of the validation data",
    ),
    Statement(
        "sensor-limits",
        lambda facts: facts.ignores_limits,
        lambda facts: (
            f"if the sensor of {facts.names[0]} is at its limit in the flat samples, estimate a model that "
            f"has this limit ({name_option('model', 'latent')})"
        ),
    ),
    Statement("insignificant", lambda facts: facts.insignificant, _describe_longer_record),
    Statement(
        "unlikely",
        # Few samples of a correlated residual count, so that much worse models have weight in the ensemble.
        lambda facts: facts.simulates and not facts.insignificant and _find_unlikely(facts)[1] < _UNLIKELY,
        _describe_unlikely,
    ),
    Statement(
        "check-inputs",
        lambda facts: facts.is_unrelated,
        lambda facts: f"check that {' or '.join(facts.names[1:]) or 'an input'} acts on {facts.names[0]}",
    ),
    Statement(TEST.name, lambda facts: not facts.is_unrelated, TEST.write),
)

#: All statements, in the order of the text.
STATEMENTS: Final[tuple[Statement[ResultFacts], ...]] = (
    *_REMARKS,
    *MEASURES,
    *VERDICT_DETAILS,
    *VERDICTS,
    *USES,
    *FAILURES,
    *NEXT_STEPS,
)


def name_statements(document: Document) -> list[str]:
    """Return the names of the statements that hold for a result."""
    return [each.name for each in find_statements(STATEMENTS, ResultFacts(document))]
