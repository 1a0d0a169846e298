"""Facts about results: the quantities and decisions that sentences state, from ``result.json`` alone.

A facts object is made once for each document, and the templates of `islands.sentences` read it. The limits of
all sentences about results are here; the templates have none.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from math import inf
from typing import Any, Final, NamedTuple

from islands.estimation.estimator_table import SIGNIFICANT
from islands.models.coupled_latent import CoupledLatentModel
from islands.models.equations import name_columns
from islands.records.preprocessing_steps import Preprocessing
from islands.records.split import compare_input_ranges
from islands.rounding import RESOLUTION
from islands.sentences import list_statements, write, write_amount
from islands.validation.predictable_residual import ADEQUATE, LARGEST_SHARE, NOT_COMPUTED
from islands.validation.prediction_bands import LEVEL

#: Smallest R2 of a simulation that counts as good.
_GOOD_R2 = 0.9

#: R2 of a simulation below which it is hardly better than the mean of the output.
_NO_R2 = 0.05

#: Largest ratio of an error and the noise level at which the error is that of the noise.
NOISE_RATIO = 1.2

#: Ratio of an error and the noise level from which on noise does not explain the error.
FAR_RATIO = 3.0

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
_UNCERTAIN_RATIO = 1.4

#: Largest ratio that is stated: of two independent samples, and as an order of magnitude.
_LARGEST_RATIO = 5.0

#: Normal quantile of 5 %: a likely error is one that is exceeded in one of twenty cases.
_LOWER_QUANTILE = -1.645

#: Inclusion probability from which a term is certain.
CERTAIN = 0.9

#: Inclusion probability below which most of the weight is on models without the term.
_UNLIKELY = 0.5

#: Closure of a loop, in per cent of the output range, above which the loop is open.
_OPEN_PERCENT = 5.0

#: Units of velocities: a length, an angle or revolutions by a time.
_VELOCITY: Final = re.compile(r"([kcmunµμ]?m|in|ft|m?rad|deg|°|rev|1)\s*/\s*(s|min|h)|rpm")

#: Terms whose sum is the friction, as long as the direction of motion does not change.
_OPPOSING: Final = re.compile(r"sign\(y\(k-\d+\)\)")

#: Terms that are linear in the only input.
_DRIVING: Final = re.compile(r"u\(k(-\d+)?\)")

#: Standard errors that a friction and a gain differ from zero by at least.
_SIGNIFICANT_FRICTION: Final = 3.0

#: What is added to an error on the validation data if the parameters were estimated again after it.
BEFORE_REFIT = "measured before the parameters were estimated again on all data"

#: Values of a JSON object.
Document = Mapping[str, Any]

#: Second word of the names of statements about one output.
_EACH_OUTPUT = "_output_"

#: What a statement is about, at its beginning.
_LABEL: Final = re.compile(r"[A-Z][a-z ]+: ")

#: Physics checks of a model that has none.
_NO_PHYSICS: Final[Document] = {
    "holds": (),
    "excursions": (),
    "extremes": (),
    "property_1": None,
    "hold_drift_percent": None,
    "not_computed": "",
}


class DryFriction(NamedTuple):
    """Dry friction of a model of a velocity.

    Attributes
    ----------
    step : float
        Change of the velocity in one sample, in the unit of the velocity.
    input : float or None
        Value of the only input that balances it, in the unit of the input. None if there are several inputs,
        or if the input has other terms than linear ones.
    """

    step: float
    input: float | None


class RunFacts:
    """Quantities of the free run of one output.

    Parameters
    ----------
    document : mapping
        Content of ``result.json``.
    model : mapping
        Entry of the model in it.
    name, unit : str
        Name and unit of the output.
    measured : mapping
        Has the errors by part and simulation as ``metrics``, null for a divergence, and the prediction bands,
        which may be null.
    residual, data : mapping
        Residual tests and facts about the data; empty if they are unknown.
    """

    #: Level of the prediction band.
    band = f"{100 * LEVEL:g} %"

    #: Inclusion probability of a certain term, and largest predictable share of an adequate residual.
    certain, largest_share = CERTAIN, LARGEST_SHARE

    def __init__(
        self,
        document: Document,
        model: Document,
        name: str,
        unit: str,
        measured: Document,
        residual: Document,
        data: Document,
    ) -> None:
        self.document, self.model, self.name, self.unit = document, model, name, unit
        self.metrics: Document = measured["metrics"]
        self.bands: Document = measured["bands"] or {}
        self.reads_inputs: bool = measured.get("reads_inputs", True)
        self.residual, self.data = residual, data

    @property
    def names(self) -> tuple[str, ...]:
        """Name of the output, and of a result of one output those of the inputs."""
        return (self.name,)

    @property
    def input_names(self) -> Sequence[str]:
        """Names of the columns of the inputs."""
        found: Sequence[str] = self.document["record"]["names"]["inputs"]
        return found

    def error(self, mode: str = "free_run", part: str = "validation") -> Document:
        """Return the errors of a simulation; null for a divergence."""
        errors: Document = self.metrics[part][mode]
        return errors

    def amount(self, value: float) -> str:
        """Write a value of the output with its unit."""
        return write_amount(value, self.unit)

    @property
    def free(self) -> Document:
        """Errors of the free run on the validation data; null for a divergence."""
        return self.error()

    @property
    def ahead(self) -> Document:
        """Errors one step ahead on the validation data; null for a divergence."""
        return self.error("one_step_ahead")

    @property
    def noise(self) -> float | None:
        """Noise level of the output; None if it is unknown."""
        found: float | None = self.data.get("noise")
        return found

    @property
    def diverges(self) -> bool:
        """Whether the free run on the validation data diverges."""
        return self.free["rmse"] is None

    @property
    def half_width(self) -> float:
        """Median half-width of the prediction band of the default level."""
        factor = self.bands["factors"][self.bands["levels"].index(LEVEL)]
        return float(factor * self.bands["width"])

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
        if count is None or self.free["rmse"] is None or self.is_rounding(self.free["rmse"]):
            return 0.0
        share = 2.0 / (9.0 * count)
        root = 1.0 - share + _LOWER_QUANTILE * share**0.5
        return root**-1.5 if root > 0.0 else inf

    @property
    def is_uncertain(self) -> bool:
        """Whether the error on new data may be much larger, since few samples are independent."""
        return self.likely_ratio >= _UNCERTAIN_RATIO

    @property
    def stated_ratio(self) -> float:
        """The likely ratio that is stated."""
        return min(self.likely_ratio, _LARGEST_RATIO)

    @property
    def is_vague(self) -> bool:
        """Whether the band is wider than the range of the output, so that it says nothing about it."""
        output_range = self.data.get("output_range")
        return bool(self.bands and output_range and 2.0 * self.half_width > output_range)

    @property
    def verdict(self) -> str:
        """Verdict on the residual of the free run."""
        found: str = self.residual["verdict"]
        return found

    def share(self, mode: str) -> float | None:
        """Return the predictable share of a residual; null after a divergence."""
        found: float | None = self.residual["predictable_share"][mode]
        return found

    @property
    def has_structure(self) -> bool:
        """Whether the residual of the free run has a predictable part, or the free run diverges."""
        return self.verdict not in (ADEQUATE, NOT_COMPUTED)

    @property
    def has_visible_structure(self) -> bool:
        """Whether the residual of the free run has a predictable part."""
        return self.has_structure and self.residual["predictable_percent"] is not None

    @property
    def explained(self) -> float | None:
        """Explained part of the variance of the output, of the part of the data in which it moves more.

        R2 of the validation data says nothing of a model if their output rests.
        """
        free, before = self.free, self.error(part="estimation")
        if None in (free["r2"], free["rmse"], before["r2"], before["rmse"]) or before["r2"] == 1.0:
            return None if free["r2"] is None else float(free["r2"])
        variance = before["rmse"] ** 2 / (1.0 - before["r2"])
        return float(max(free["r2"], 1.0 - free["rmse"] ** 2 / variance if variance else free["r2"]))

    @property
    def is_unrelated(self) -> bool:
        """Whether no model that reads an input has decisively more evidence than one that reads none."""
        return not self.reads_inputs

    @property
    def rests(self) -> bool:
        """Whether the output of the validation data hardly moves, and that of the estimation data does."""
        r2, explained = self.free["r2"], self.explained
        return r2 is not None and explained is not None and r2 < _NO_R2 and explained >= _GOOD_R2

    @property
    def is_poor(self) -> bool:
        """Whether a free run that does not diverge does not follow an output that its inputs act on."""
        return not (self.diverges or self.simulates or self.is_unrelated)

    @property
    def is_rounded(self) -> bool:
        """Whether an adequate residual of the free run is a rounding error, which may be predictable."""
        return self.verdict == ADEQUATE and exceeds_limit(self.share("free_run"))

    @property
    def is_adequate(self) -> bool:
        """Whether no structure is left in the residual of a free run whose error is that of the noise."""
        return self.is_unpredictable and not (self.exceeds_noise or self.is_unrelated)

    @property
    def error_level(self) -> float | None:
        """Ratio of the free-run error and the noise level; None where it says nothing."""
        return None if self.is_unrelated else self.noise_ratio

    @property
    def is_at_noise(self) -> bool:
        """Whether the error is at most the noise level, which has an uncertainty."""
        return self.noise_ratio is not None and self.noise_ratio <= NOISE_RATIO

    @property
    def simulates(self) -> bool:
        """Whether the free run follows the output: R2 is good, or the error is that of the noise."""
        rmse, r2, noise = self.free["rmse"], self.explained, self.noise
        if rmse is None or self.is_unrelated:
            return False
        # R2 is undefined for a constant output.
        return r2 is None or r2 >= _GOOD_R2 or (noise is not None and rmse <= NOISE_RATIO * noise)

    @property
    def predicts(self) -> bool:
        """Whether the prediction one step ahead follows the output."""
        return (self.ahead["r2"] or 0.0) >= _GOOD_R2

    def is_rounding(self, rmse: float) -> bool:
        """Return whether an error is that of rounding: its ratio to another one says nothing."""
        return bool(rmse <= RESOLUTION * self.data.get("output_range", 0.0))

    @property
    def least_error(self) -> float | None:
        """Error one step ahead that cannot be predicted: the smallest that the data show."""
        found: float | None = self.ahead["rmse"]
        return None if exceeds_limit(self.share("one_step_ahead")) else found

    @property
    def one_step_ratio(self) -> float:
        """Error one step ahead divided by the noise level, as written; 0 if one of them is unknown."""
        rmse, noise = self.ahead["rmse"], self.noise
        return 0.0 if rmse is None or not noise or self.is_rounding(rmse) else round_ratio(rmse / noise)

    @property
    def is_far_ahead(self) -> bool:
        """Whether the error one step ahead is far above the noise."""
        return self.one_step_ratio >= FAR_RATIO

    @property
    def noise_ratio(self) -> float | None:
        """Free-run error divided by the noise level, or by the least error if that is unknown, as written."""
        rmse, level = self.free["rmse"], self.noise or self.least_error
        return None if rmse is None or not level or self.is_rounding(rmse) else round_ratio(rmse / level)

    @property
    def is_unpredictable(self) -> bool:
        """Whether neither inputs nor past outputs predict the residual of the free run."""
        return self.verdict == ADEQUATE and not exceeds_limit(self.share("free_run"))

    @property
    def exceeds_noise(self) -> bool:
        """Whether an unpredictable residual of the free run is far above the noise."""
        return self.is_unpredictable and (self.noise_ratio or 0.0) >= FAR_RATIO

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

    @property
    def criterion(self) -> Document:
        """Error that the parameters minimise. Empty if they are given."""
        return self.model.get("criterion") or {}

    @property
    def linear(self) -> Document:
        """Linear model of the same data. Empty if the model is linear."""
        return self.document.get("linear") or {}

    @property
    def linear_error(self) -> float:
        """RMSE of the free run of that linear model on the validation data."""
        return float(self.linear["metrics"]["validation"]["free_run"]["rmse"])

    @property
    def linear_ratio(self) -> float | None:
        """Error of the linear model relative to that of the model; None if that is unknown or exact."""
        own = self.free["rmse"]
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
    def doubtful(self) -> list[tuple[str, float]]:
        """Terms that are not certain, each with the probability of its inclusion."""
        shares = [(term["term"], term["inclusion"]) for term in self.model["terms"]]
        return [(text, share) for text, share in shares if share is not None and share < CERTAIN]

    @property
    def is_unpredictable_ahead(self) -> bool:
        """Whether the error of the free run has a cause that the residual one step ahead does not show."""
        return (self.has_structure or self.exceeds_noise) and not exceeds_limit(self.share("one_step_ahead"))

    @property
    def has_named_parameters(self) -> bool:
        """Whether the models are of a class with named parameters in place of terms."""
        return "kind" in self.model

    @property
    def has_searched_terms(self) -> bool:
        """Whether terms of a library were searched; the recommended model may still be linear."""
        return "library" in self.document["settings"]

    @property
    def is_free_run_untried(self) -> bool:
        """Whether only the free run has structure, and the parameters minimise another error."""
        return self.is_unpredictable_ahead and self.criterion.get("error", "free_run") != "free_run"

    @property
    def lacks_terms(self) -> bool:
        """Whether the free run has structure, and the prediction one step ahead as well."""
        return self.has_structure and exceeds_limit(self.share("one_step_ahead"))

    @property
    def worst_test(self) -> tuple[str, str]:
        """Name and input of the residual test that exceeds its limit by most; of the first one if none does.

        A test with an input is preferred: the residual of a slow record is correlated in time whatever term
        is missing.
        """
        past, *tests = self.residual["tests"]
        excess = [
            test["largest"] / test["limit"] if test["largest"] and test["limit"] else 0.0 for test in tests
        ]
        worst = tests[excess.index(max(excess))] if max(excess) > 1.0 else past
        return worst["name"], "" if worst["input"] is None else self.names[1 + worst["input"]]

    @property
    def wider_lags(self) -> tuple[str, int] | None:
        """Setting of the lags of the library, and twice its value; None if they are unknown."""
        settings = self.document["settings"]
        name = next((name for name in ("lags", "library_lags") if name in settings), None)
        return None if name is None else (name, 2 * settings[name])


class ResultFacts(RunFacts):
    """Quantities of a ``result.json`` that the statements read.

    Parameters
    ----------
    document : mapping
        Content of ``result.json``.
    """

    def __init__(self, document: Document) -> None:
        self.record: Document = document["record"]
        self.recommended: Document = document["recommended"]
        model: Document = document["models"][self.recommended["rank"] - 1]
        self.physics: Document = model.get("physics", _NO_PHYSICS)
        name, unit = (self.record[key].get("output", "") for key in ("names", "units"))
        measured = {"bands": None, **model}
        residual = model.get("residual_tests", {})
        super().__init__(document, model, name, unit, measured, residual, document["data"])

    @property
    def outputs(self) -> tuple[RunFacts, ...]:
        """Facts about the free run of each output."""
        return (self,)

    def state(self, group: str) -> list[str]:
        """Return the statements of a group about the model and, of those about an output, about each one."""
        return [
            line
            for name in list_statements("result", group)
            for line in (self._state_each(name) if _EACH_OUTPUT in name else write("result", name, f=self))
        ]

    def _state_each(self, name: str) -> list[str]:
        """Return a statement about each output after its name, or once if it holds of all of them."""
        stated: dict[str, list[str]] = {}
        for output in self.outputs:
            for line in write("result", name, f=output):
                stated.setdefault(line, []).append(output.name)
        return [
            line if len(names) == len(self.outputs) else _name_statement(" and ".join(names), line)
            for line, names in stated.items()
        ]

    @cached_property
    def limits(self) -> list[str]:
        """Checks that the model fails."""
        return self.state("limit")

    #: Modes and gains of a linear system whose parameters are coordinates of its states; may be empty.
    quantities: Sequence[Document] = ()

    @property
    def columns(self) -> tuple[list[str], list[str]]:
        """Names of the inputs and of the outputs."""
        names = self.record["names"]
        return names["inputs"], names.get("outputs") or [names["output"]]

    @property
    def reasons(self) -> Sequence[str]:
        """Reasons for the recommended model: why this one, and its physics checks."""
        reasons: Sequence[str] = self.recommended["reasons"]
        return reasons

    @property
    def physics_reason(self) -> str:
        """What the physics checks of the model show; empty where they are not computed."""
        return self.reasons[1] if len(self.reasons) > 1 else ""

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
        return self.requires_property_1 or any(
            bool(entry.get("physics", _NO_PHYSICS)["property_1"]) for entry in models
        )

    @property
    def is_sound(self) -> bool:
        """Whether holds and excursions are bounded and, if required, Property 1 holds."""
        tests = (*self.physics["holds"], *self.physics["excursions"])
        bounded = all(test["bounded"] for test in tests)
        return bounded and bool(self.physics["property_1"] or not self.requires_property_1)

    @property
    def refit(self) -> Document:
        """Estimate of the parameters on all data. Empty if there is none."""
        return self.model.get("refit") or {}

    @property
    def is_refitted(self) -> bool:
        """Whether the parameters are others than those that the errors belong to."""
        return is_refitted(self.model)

    @property
    def refit_note(self) -> str:
        """What is added to an error on the validation data; empty without a refit."""
        return BEFORE_REFIT if self.is_refitted else ""

    @property
    def recordings(self) -> Document:
        """Errors of the free run by recording of the validation data; empty if there is one."""
        errors: Document = self.model.get("recordings", {}).get("validation", {})
        return errors

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
        count = self.preprocessing["average"]
        return [f"{each}, in means of {count} samples" for each in found] if count > 1 else found

    @property
    def ignores_limits(self) -> bool:
        """Whether the measured output is flat at an extreme, and the model is a difference equation."""
        limits = self.data.get("output_limits") or ()
        return "kind" not in self.model and any(each is not None for each in limits)

    @property
    def units(self) -> list[tuple[str, str]]:
        """Names of the columns that have a unit, with it."""
        units = self.record["units"]
        pairs = zip(self.names, (units["output"], *units["inputs"]), strict=True)
        return [(name, unit) for name, unit in pairs if unit]

    @property
    def signals(self) -> str:
        """Signals that the equation reads."""
        signals: str = self.model["named_signals"]
        return signals

    @property
    def preprocessing(self) -> Document:
        """What was done with the record before the search."""
        found: Document = self.document["preprocessing"]
        return found

    @property
    def recorded_dt(self) -> float:
        """Sampling time of the record before its preprocessing."""
        steps = self.preprocessing["steps"]
        return float(self.record["dt"] if steps is None else steps["dt"])

    @property
    def counts_samples(self) -> bool:
        """Whether k counts samples of the given data: means or filtered rates have other units."""
        done, steps = self.preprocessing, self.preprocessing["steps"]
        filtered = steps is not None and Preprocessing.from_document(steps).has_rate_steps
        return bool(done["average"] == 1 and not filtered)

    @cached_property
    def friction(self) -> DryFriction | None:
        """Dry friction of a model of a velocity."""
        return find_dry_friction(self.model["terms"], self.unit) if self.counts_samples else None

    @property
    def unlikely(self) -> tuple[str, float] | None:
        """The least probable term and its probability, if most of the weight is on models without it.

        Few samples of a correlated residual count, so that much worse models have weight in the ensemble.
        """
        least = min(self.doubtful, key=lambda each: each[1], default=("", 1.0))
        has_weight = self.simulates and not self.insignificant
        return least if has_weight and least[1] < _UNLIKELY else None

    @cached_property
    def insignificant(self) -> list[str]:
        """Terms whose parameters are within two standard errors of zero."""
        return list_insignificant(self.model["terms"])

    @property
    def constraints(self) -> list[tuple[str, Document]]:
        """Constraints of the user, with names of the record; the physics checks have Property 1."""
        checks = [check for check in self.model.get("constraints", ()) if check["text"] != "hysteresis"]
        return [(check["named"], check) for check in checks]

    @property
    def implausible(self) -> list[Document]:
        """Extremes of the inputs at which the output diverges or is far from its range."""
        return [test for test in self.physics["extremes"] if not test["plausible"]]

    def inputs_at(self, level: float) -> list[tuple[str, float, str]]:
        """Return name, value and unit of the inputs at a level of the physics checks; empty if unknown."""
        if "inputs" not in self.data:
            return []
        ranges = self.data["inputs"]["estimation"]
        values = [(low + high) / 2 + level * (high - low) / 2 for low, high in ranges]
        return list(zip(self.names[1:], values, self.record["units"]["inputs"], strict=True))

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
    def open_loop(self) -> Document | None:
        """Excursion of a model of hysteresis whose loop closes least; None if all of them close."""
        tests = [test for test in self.physics["excursions"] if test["bounded"]]
        worst = max(tests, key=lambda test: test["closure_percent"] or 0.0, default=None)
        is_open = worst is not None and (worst["closure_percent"] or 0.0) > _OPEN_PERCENT
        return worst if self.claims_hysteresis and is_open else None

    @property
    def drifts(self) -> bool:
        """Whether the output of a model of hysteresis drifts at constant input."""
        is_known = self.physics["hold_drift_percent"] is not None
        return self.requires_property_1 and not self.physics["property_1"] and is_known

    @property
    def largest_size(self) -> int:
        """Number of terms of the largest model."""
        return max(int(entry["size"]) for entry in self.document["models"])

    @property
    def may_grow(self) -> bool:
        """Whether a larger model may describe the structure of the residual."""
        is_largest = self.model["size"] == self.largest_size
        return self.has_structure and is_largest and "max_terms" in self.document["settings"]


class OutputFacts(RunFacts):
    """Quantities of the common free run of one of several outputs.

    Parameters
    ----------
    document : mapping
        Content of ``result.json``.
    output : mapping
        Entry of the output in it.
    """

    def __init__(self, document: Document, output: Document) -> None:
        (model,) = document["models"]
        super().__init__(
            document, model, output["name"], output["unit"], output, output["residual"], output["data"]
        )

    @property
    def lacks_terms(self) -> bool:
        """Whether its free run has structure; the estimate of an equation alone is no remedy."""
        return self.has_structure and not (self.is_unpredictable_ahead and self.is_far_ahead)


class OutputsFacts(ResultFacts):
    """Quantities of a ``result.json`` of several outputs that the statements read."""

    def __init__(self, document: Document) -> None:
        super().__init__(document)
        self.quantities = self.model.get("quantities", ())

    @cached_property
    def outputs(self) -> tuple[RunFacts, ...]:
        """Facts about the common free run of each output."""
        return tuple(OutputFacts(self.document, each) for each in self.document["outputs"])

    @property
    def has_named_parameters(self) -> bool:
        """Whether the models of the outputs have named parameters in place of terms."""
        return bool(self.model["kind"] == CoupledLatentModel.kind)

    @property
    def units(self) -> list[tuple[str, str]]:
        """Names of the columns that have a unit, with it."""
        units, (inputs, outputs) = self.record["units"], self.columns
        pairs = zip((*outputs, *inputs), (*units["outputs"], *units["inputs"]), strict=True)
        return [(name, unit) for name, unit in pairs if unit]

    @property
    def simulates(self) -> bool:
        """Whether the common free run follows every output."""
        return all(output.simulates for output in self.outputs)

    @property
    def diverges(self) -> bool:
        """Whether the common free run on the validation data diverges."""
        return any(output.diverges for output in self.outputs)

    @property
    def predicts(self) -> bool:
        """Whether the prediction one step ahead follows every output."""
        return all(output.predicts for output in self.outputs)

    @property
    def generalises_poorly(self) -> bool:
        """Whether the error of an output is much larger on the validation data."""
        return any(output.generalises_poorly for output in self.outputs)

    @property
    def is_unrelated(self) -> bool:
        """Whether nothing predicts any of the outputs."""
        return all(output.is_unrelated for output in self.outputs)

    @property
    def may_grow(self) -> bool:
        """False: the terms of all outputs are counted together."""
        return False


def make_facts(document: Document) -> ResultFacts:
    """Return the facts of a ``result.json`` of one or several outputs."""
    return (OutputsFacts if "outputs" in document else ResultFacts)(document)


def _name_statement(name: str, line: str) -> str:
    """Return a statement after the name of the output that it is about: ``y1, error: RMSE 2 um``."""
    is_labelled = _LABEL.match(line)
    return f"{name}, {line[0].lower()}{line[1:]}" if is_labelled else f"{name}: {line}"


def exceeds_limit(share: float | None) -> bool:
    """Return whether more than the limit of a residual is predictable, or the share is unknown."""
    return share is None or share > LARGEST_SHARE


def round_ratio(ratio: float) -> float:
    """Round a ratio to the digits that are written, so that a limit decides as the written value does."""
    return float(f"{ratio:.3g}")


def list_insignificant(terms: Iterable[Document]) -> list[str]:
    """Return the terms whose parameters are within two standard errors of zero."""
    return [
        term["term"]
        for term in terms
        if term["standard_error"] is not None
        and abs(term["parameter"]) < SIGNIFICANT * term["standard_error"]
    ]


def is_refitted(entry: Document) -> bool:
    """Return whether the parameters of a model are others than those that its errors belong to.

    Parameters
    ----------
    entry : mapping
        Entry of the model in ``result.json``.
    """
    refit = entry.get("refit")  # an entry of several outputs has none
    return bool(refit and not refit["discarded"])


def find_dry_friction(terms: Iterable[Mapping[str, Any]], unit: str) -> DryFriction | None:
    """Find dry friction: terms in the sign of the output that oppose the motion.

    Parameters
    ----------
    terms : iterable of mapping
        Terms of a model, with ``regressor``, ``parameter`` and ``standard_error``.
    unit : str
        Unit of the output.

    Returns
    -------
    DryFriction or None
        None if the unit is not that of a velocity, or if no significant term opposes the motion.

    Notes
    -----
    With ``y(k) = a y(k-1) + b u(k-1) - c sign(y(k-1))``, the friction changes the velocity by `c` in each
    sample, and the input ``c / b`` balances it.
    """
    listed = list(terms)
    if not _VELOCITY.fullmatch(unit):
        return None
    friction = _sum_terms(listed, _OPPOSING)
    if friction is None or friction > 0:
        return None
    reads_input = [term for term in listed if re.search(r"\bu\d*\(", term["regressor"])]
    linear = all(_DRIVING.fullmatch(term["regressor"]) for term in reads_input)
    gain = _sum_terms(reads_input, _DRIVING) if linear else None
    return DryFriction(-friction, None if gain is None else abs(friction / gain))


def _sum_terms(terms: Iterable[Mapping[str, Any]], kind: re.Pattern[str]) -> float | None:
    """Return the sum of the parameters of a kind of terms; None if it does not differ from zero."""
    found = [term for term in terms if kind.fullmatch(term["regressor"])]
    total = sum(float(term["parameter"]) for term in found)
    # The sum of the standard errors is not less than the standard error of the sum.
    limit = _SIGNIFICANT_FRICTION * sum(term["standard_error"] or 0.0 for term in found)
    return total if found and abs(total) > limit else None
