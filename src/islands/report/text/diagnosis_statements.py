"""Statements about a diagnosis, from ``discrepancy.json`` alone.

Each has a predicate on the document: a run, its
folder, the REST service, the page, the report and a notebook state the same. Statements about the gain are
those of the held-out data, which may disagree with the samples used for estimation.
"""

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import accumulate
from math import ceil, floor, log10, sqrt
from typing import Final, Generic, TypeVar

from islands.progress import Failure, attempt
from islands.records.channel_names import TEMPERATURES
from islands.report.text.facts import Document, round_ratio, write_amount
from islands.report.text.statements import describe_not_computed
from islands.rounding import RESOLUTION

F = TypeVar("F")
F_contra = TypeVar("F_contra", contravariant=True)


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


#: Held-out share of the misfit above which the effects explain it, and above which they explain most of it.
_WHOLE, _MOST = 0.9, 0.5

#: Confidence below which other causes together are more probable.
_CERTAIN = 0.5

#: Confidence below which a cause is called probable.
_SURE = 0.9

#: Ratio of an error and the noise floor up to which the error is that of the noise.
_NOISE_RATIO = 1.2

#: Ratio of an error and the noise floor from which on noise does not explain the error.
_FAR_RATIO = 3.0

#: Error as a fraction of the standard deviation of the output above which white and coloured noise are large.
_LARGE_NOISE, _LARGE_COLOURED_NOISE = 0.3, 0.1

#: Correlation time of the residual in samples from which on it is stated.
_CORRELATED = 10

#: Relative change of the error by the calibration that is stated.
_CALIBRATED = 0.05

#: Digits of the widest value. A narrower interval is that of exact data, or of a value without a response.
_MOST_DIGITS = 8

#: Confidence whose two digits are 1.00, although no cause is certain.
_ALMOST_CERTAIN = 0.995

#: Score of an effect that is written as more than zero.
_LEAST_SCORE = 0.05

#: Ratio of two errors from which on it is written as a factor, and not in per cent.
_TIMES = 1.5

#: Number of effects that are listed as the nearest ones.
_NEAREST = 3

#: Families of causes: wrong gains and parameters, terms that were found, gross errors of the record.
_SCALE, _TERM, _GROSS = "scale", "discovered", "gross"

#: Delay of the input, and its largest ratio to the sampling time for which the recording may be its cause.
_DELAY, _SMALL_DELAY = "delay", 1.5

#: Effects that limit the input and its rate.
_SATURATION, _RATE_LIMIT = "input-saturation", "rate-limit"

#: Ratio of the errors on the held-out data and in the samples used for estimation that noise does not have.
_GROWTH = 1.5

#: Effects with a frequency that changes, and what to look for.
_SWEEPS: Final = {
    "swept-disturbance": "a machine nearby that runs {} at that time, and the parts that transmit its force",
    "swept-interference": "a drive that runs {} at that time, whose cables or vibration reach the sensor",
}

#: Effect of a channel that acts where the input does.
_SECOND_INPUT = "second-input"

#: Pattern of the names of initial states.
_INITIAL: Final = r"initial |state \d"

#: Simulations in which forces act on the output, and those to whose output forces of the input are added.
_ON_OUTPUT, _ON_INPUT = ("second-order", "rigid-axis"), ("bouc-wen-piezo", "linear", "column")

#: Names of the coefficients of coloured noise in a sentence.
_COEFFICIENTS: Final = {
    "pole": "largest pole",
    "order": "order of the autoregression",
    "difference order": "order of the long memory",
}

#: Name of the statement of the extended simulation.
EXTENDED: Final = "extended-simulation"

#: Effect of a wrong form of an identified model.
_FORM = "core-shape"


class DiagnosisFacts:
    """Quantities of a ``discrepancy.json`` that the statements read. Earlier versions lack some of them.

    Parameters
    ----------
    document : mapping
        Content of ``discrepancy.json``.
    """

    def __init__(self, document: Document) -> None:
        self.document = document
        self.verdict: str = document["verdict"]
        self.gain: Document | None = document["gain"]
        self.discovered: Document | None = document.get("discovered")
        self.floor: float = document["noise_floor_rmse"]
        self.remainder: Document = document.get("remainder", {})

    def label(self, name: str, term: str = "", place: str = "") -> str:
        """Name a cause: its plain name, and that of the program in brackets, if it has both."""
        title = self.document.get("titles", {}).get(f"{name}:{place}" if place else name)
        if title is None:
            return " ".join(filter(None, (name, term, f"of {place}" if place else "")))
        return f"{title} {term} (`{name}`)" if term else f"{title} (`{name}`)"

    def label_effect(self, effect: Document) -> str:
        """Name an effect with its term, or with the state or the parameter that it acts on."""
        return self.label(effect["name"], effect.get("term", ""), effect.get("place", ""))

    def write_error(self, value: float) -> str:
        """Write an error with the unit of the output."""
        return write_amount(value, self.document["record"]["units"]["output"])

    @cached_property
    def causes(self) -> list[Document]:
        """The causes, those that are not claimed as well."""
        return [each for each in self.document["effects"] if each["eta"] is not None]

    @property
    def noise(self) -> list[Document]:
        """Properties of sampling and noise."""
        return [each for each in self.document["effects"] if each["eta"] is None]

    @cached_property
    def claimed(self) -> list[Document]:
        """The causes that are claimed."""
        return [each for each in self.causes if each.get("claimed", True)]

    @property
    def terms(self) -> list[Document]:
        """The discovered terms."""
        return [each for each in self.causes if each["family"] == _TERM]

    @property
    def second_inputs(self) -> list[str]:
        """Names of the channels that may be the second input, if that is claimed; the first one is."""
        if not any(each["name"] == _SECOND_INPUT for each in self.claimed):
            return []
        record = self.document["record"]
        channels = zip(record["names"]["inputs"][1:], record["units"]["inputs"][1:], strict=True)
        return [name for name, unit in channels if unit not in TEMPERATURES]

    @property
    def has_several_comparisons(self) -> bool:
        """Whether several errors without a cause are stated. The terms have one in common."""
        shares = sum(each["family"] not in (_TERM, _GROSS) for each in self.causes)
        return shares + bool(shares and self.terms) > 1

    @property
    def extended(self) -> Document | None:
        """The extension, if its equations are known."""
        extension: Document | None = self.document.get("extension")
        return extension if extension and extension.get("equations") else None

    @property
    def input_limits(self) -> list[tuple[str, float]]:
        """Name of each claimed cause that limits the first input or its rate, and the limit."""
        ranges = (self.document.get("extension") or {}).get("ranges")
        found = []
        for each in self.claimed:
            values = each["parameters"]
            if each["name"] == _SATURATION and ranges:
                peak = max(abs(ranges[0]["low"]), abs(ranges[0]["high"]))
                found.append((_SATURATION, peak * (1.0 - values["cut"]["value"])))
            if each["name"] == _RATE_LIMIT and values["inverse_rate"]["value"] > 0.0:
                found.append((_RATE_LIMIT, 1.0 / values["inverse_rate"]["value"]))
        return found

    @property
    def sweeps(self) -> list[tuple[str, float, float]]:
        """Name of each claimed disturbance that sweeps, and its frequencies at start and end in Hz."""
        record, found = self.document["record"], [each for each in self.claimed if each["name"] in _SWEEPS]
        sweeps = []
        for each in found:
            frequency, rate = (each["parameters"][name]["value"] for name in ("frequency", "rate"))
            sweeps.append((each["name"], frequency, frequency + record["samples"] * record["dt"] * rate))
        return sweeps

    @property
    def small_delay(self) -> float:
        """A claimed delay of about a sampling time or less, in seconds; zero if there is none."""
        found = [each["parameters"]["tau"]["value"] for each in self.claimed if each["name"] == _DELAY]
        longest = _SMALL_DELAY * self.document["record"]["dt"]
        return float(found[0]) if found and abs(found[0]) < longest else 0.0

    @property
    def held_out_recordings(self) -> tuple[list[str], list[str]] | None:
        """Names of the fitted and of the held-out recordings; None if one recording has both parts."""
        record = self.document["record"]
        names, segments = record.get("recordings", ()), record.get("segments", ())
        bounds = list(accumulate(segments))
        if not all(names) or self.document.get("estimation_samples") not in bounds[:-1]:
            return None
        count = bounds.index(self.document["estimation_samples"]) + 1
        return list(names[:count]), list(names[count:])

    @property
    def is_worse_calibrated(self) -> bool:
        """Whether the calibration without effects makes the error of the held-out data larger."""
        given = self.document.get("as_given_rmse")
        if (
            self.gain is None
            or given is None
            or self.calibrated_rmse is None
            or not self.document.get("calibrated")
        ):
            return False
        return bool(given < (1.0 - _CALIBRATED) * self.calibrated_rmse)

    @property
    def separated_pairs(self) -> list[str]:
        """Pairs of causes with similar scores that the record would separate if one of them were right."""
        pairs = (self.document.get("next_experiment") or {}).get("pairs", ())
        return [
            " or ".join(map(self.label, each["causes"]))
            for each in pairs
            if each["recorded"] is not None and each["recorded"]["is_sufficient"]
        ]

    @property
    def grows(self) -> bool:
        """Whether an error that may be noise is larger on the held-out data than in the samples before."""
        if self.noise_claim is None or self.error is None:
            return False
        is_larger = self.error > _GROWTH * float(self.noise_claim["rms"])
        return self.verdict == "noise" and not self.is_far and is_larger

    @property
    def has_others(self) -> bool:
        """Whether effects that are not claimed extend the simulation as well."""
        return len(self.claimed) < len(self.causes)

    @property
    def is_exact(self) -> bool:
        """Whether the error of the held-out data is a rounding error."""
        return self.relative_error is not None and self.relative_error < RESOLUTION

    @property
    def free_forms(self) -> list[str]:
        """Names of the causes without an assumed shape."""
        return [self.label_effect(each) for each in self.claimed if each.get("free_form")]

    @property
    def is_certain(self) -> bool:
        """Whether every claimed cause is more probable than all others together, as it is written."""
        return all(round(each["confidence"], 2) >= _CERTAIN for each in self.claimed)

    @property
    def is_sure(self) -> bool:
        """Whether all other causes together are improbable next to each claimed one, as it is written."""
        return all(round(each["confidence"], 2) >= _SURE for each in self.claimed)

    @property
    def has_gain(self) -> bool:
        """Whether the effects reduce the error of the held-out data, with 95 % confidence."""
        return self.gain is not None and self.gain["ci95"][0] > 0.0

    @property
    def share(self) -> float | None:
        """Share of the misfit above the noise floor that disappears on the held-out data.

        It is None if the error without the effects is not above the noise floor.
        """
        assert self.gain is not None
        before, after, noise = (each**2 for each in (*self.errors, self.floor))
        return (before - after) / (before - noise) if before > noise else None

    @property
    def errors(self) -> tuple[float, float]:
        """Errors of the held-out data without and with the effects."""
        assert self.gain is not None
        return self.gain["before"]["rmse"], self.gain["after"]["rmse"]

    @property
    def calibrated_rmse(self) -> float | None:
        """Error of the calibrated simulation without effects on the held-out data; None if it is unknown."""
        found: float | None = self.document.get("calibrated_rmse")
        return found

    @property
    def coordinate(self) -> str:
        """What x is in the formulas of the claimed effects; empty if they have none, or if it is unknown."""
        kind = re.split("[: ]", self.document.get("simulation", ""))[0]
        formulas = [each.get("summary", "") for each in self.claimed if each["family"] != _TERM]
        if not any(re.search(r"\bx('|\b)", each) for each in formulas):
            return ""
        names = self.document["record"]["names"]
        if kind in _ON_OUTPUT:
            return f"x is the output, {names['output']}, and x' its rate"
        return f"x is the input, {names['inputs'][0]}, and x' its rate" if kind in _ON_INPUT else ""

    @property
    def calibrated(self) -> str:
        """Values of the parameters of the extended simulation.

        The initial states are those of the record, and the coefficients of terms are stated with them.
        """
        if values := self.document.get("values"):
            return ", ".join(f"{each['name']} = {write_value(each, self.is_exact)}" for each in values)
        coefficients = {name for term in self.terms for name in term["parameters"]}
        return ", ".join(
            f"{name} = {value:.4g}"
            for name, value in (self.document.get("calibrated") or {}).items()
            if name not in coefficients and not re.match(_INITIAL, name)
        )

    @property
    def error(self) -> float | None:
        """Error of the best simulation on the held-out data; None if it is unknown."""
        return self.calibrated_rmse if self.gain is None else self.errors[1]

    @property
    def relative_error(self) -> float | None:
        """That error as a fraction of the standard deviation of the output; None if it is unknown."""
        deviation = self.document.get("output_std")
        return self.error / deviation if self.error is not None and deviation else None

    @property
    def noise_ratio(self) -> float | None:
        """That error divided by the noise floor, as written; None if it is unknown, or a rounding error."""
        if self.error is None or not self.floor or self.is_exact:
            return None
        return round_ratio(self.error / self.floor)

    @property
    def is_far(self) -> bool:
        """Whether the error of the held-out data is far above the noise floor."""
        return (self.noise_ratio or 0.0) >= _FAR_RATIO

    @property
    def is_noise(self) -> bool:
        """Whether the error of the held-out data is at most that of the noise."""
        return self.noise_ratio is not None and self.noise_ratio <= _NOISE_RATIO

    @property
    def is_correlated(self) -> bool:
        """Whether the noise is coloured over more than a few samples."""
        least = _CORRELATED * float(self.document["record"].get("dt", 0.0))
        return self.is_coloured and (self.noise_claim or {}).get("correlation_time", 0.0) > least

    @property
    def is_coloured(self) -> bool:
        """Whether the noise is coloured."""
        return any(each["name"] == "coloured-noise" for each in self.noise)

    @property
    def has_large_noise(self) -> bool:
        """Whether an error that counts as noise is a large part of the output."""
        if self.verdict not in ("nothing", "noise", "named", "family", "discovered") or self.is_far:
            return False
        return (self.relative_error or 0.0) > (_LARGE_COLOURED_NOISE if self.is_coloured else _LARGE_NOISE)

    @property
    def is_measured(self) -> bool:
        """Whether the noise floor is measured from repeated periods."""
        return bool(self.document["noise_floor_is"] != "an upper bound")

    @property
    def noise_claim(self) -> Document | None:
        """Size and correlation time of the residual; None in documents of earlier versions."""
        found: Document | None = self.document.get("noise_claim")
        return found

    @property
    def stated_noise(self) -> float:
        """Standard deviation of the noise that the user stated; zero if it is unknown."""
        return (self.noise_claim or {}).get("noise_level") or 0.0

    @property
    def is_above_stated_noise(self) -> bool:
        """Whether a finding compares the residual with the stated noise."""
        findings = self.document.get("record_findings", ())
        return any(each["name"] == "above-noise-level" for each in findings)

    @property
    def is_gross(self) -> bool:
        """Whether the record has a gross error, so that no effect was searched for."""
        return self.verdict == "gross error"

    @property
    def removes_error(self) -> bool:
        """Whether the correction of a gross error reduces the error, which a calibration may hide."""
        findings = self.document.get("record_findings", ())
        errors = findings[0]["errors"] if self.is_gross and findings else None
        return errors is not None and errors["after"] < errors["before"]

    @property
    def held_out_part(self) -> str:
        """Name of the held-out data."""
        found: str = self.document.get("held_out_part", "the held-out data")
        return found

    @property
    def functions_of_time(self) -> list[Document]:
        """The causes that are functions of the time."""
        return [each for each in self.causes if each.get("depends_on_time")]

    @property
    def time_dependent(self) -> list[str]:
        """Names of the causes that are functions of the time, or their terms."""
        found = self.functions_of_time
        return list(dict.fromkeys(each.get("term") or self.label_effect(each) for each in found))

    @property
    def is_one_record(self) -> bool:
        """Whether the held-out data are the end of the recording that the causes were found on."""
        return self.held_out_part == "the last quarter of the record"

    @property
    def nearest(self) -> list[Document]:
        """The best screened effects that improve the fit."""
        return [each for each in self.document["candidates"][:_NEAREST] if each["score"] > _LEAST_SCORE]


def describe_diagnosis(document: Document) -> list[str]:
    """Describe a diagnosis in sentences: verdict, causes, findings, errors and next steps.

    The causes are indented.

    Parameters
    ----------
    document : mapping
        Content of ``discrepancy.json``.
    """
    causes = (f"  {cause}" for cause in describe_causes(document))
    return [describe_verdict(document), *causes, *describe_details(document)]


def describe_headline(document: Document) -> list[str]:
    """Describe a diagnosis in its most important sentences: verdict, causes, and errors or correction.

    They are sentences of `describe_diagnosis`, without indents.
    """
    facts = DiagnosisFacts(document)
    names = ("record",) if facts.is_gross else ("gain", "error")
    texts = write_statements((each for each in DETAILS if each.name in names), facts)
    lines = (line for text in texts for line in text.splitlines())
    return [describe_verdict(document), *describe_causes(document), *lines]


def describe_verdict(document: Document) -> str:
    """State the verdict."""
    return " ".join(write_statements(VERDICTS, DiagnosisFacts(document)))


def describe_causes(document: Document) -> list[str]:
    """Describe each cause: values, confidence, share of the misfit, and equivalent causes."""
    facts = DiagnosisFacts(document)
    return [_describe_cause(facts, cause) for cause in facts.causes]


def describe_details(document: Document, without: Sequence[str] = ()) -> list[str]:
    """Describe noise, record, errors, and next steps, without the statements of these names."""
    chosen = (each for each in DETAILS if each.name not in without)
    texts = write_statements(chosen, DiagnosisFacts(document))
    return [line for text in texts for line in text.splitlines()]


def _describe_extent(facts: DiagnosisFacts, whole: str = "the discrepancy") -> str:
    """State how much of the discrepancy disappears on the held-out data."""
    if not facts.has_gain:
        return f"{whole} in the samples used for estimation alone"
    share = facts.share
    is_rest = bool(facts.remainder) or facts.is_far or facts.verdict == "named with remainder"
    if not is_rest and (facts.is_noise or share is None):
        return whole
    if not is_rest and share is not None and share >= _WHOLE:
        return whole if facts.noise_ratio is None else f"nearly all of {whole}"
    return f"most of {whole}" if share is None or share >= _MOST else f"a part of {whole}"


def _describe_agreement(facts: DiagnosisFacts) -> str:
    level = facts.noise_claim["noise_level"] if facts.noise_claim else None
    noise = f"{'coloured' if facts.is_coloured else 'the'} noise"
    if level is not None:
        noise = f"the stated noise of {facts.write_error(level)}"
    return f"No significant discrepancy: the simulation agrees with the record within {noise}."


def _describe_noise_claim(facts: DiagnosisFacts) -> str:
    assert facts.noise_claim is not None
    # A user judges the size of noise, not its third digit.
    rms, seconds = (float(f"{facts.noise_claim[name]:.2g}") for name in ("rms", "correlation_time"))
    return (
        "No cause is found, and the residual is not white: the simulation is correct if noise of "
        f"{facts.write_error(rms)} with a correlation time of {write_amount(seconds, 's')} is plausible for "
        "your sensor."
    )


def _describe_named(facts: DiagnosisFacts) -> str:
    extent = f"{_describe_extent(facts)}{_describe_rest(facts)}"
    probably = "" if facts.is_sure else "probably "
    names = _list_names([facts.label_effect(each) for each in facts.claimed])
    if all(each["name"] == _FORM for each in facts.claimed):
        return f"The form of the model is {probably}wrong, which explains {extent}."
    if all(each["family"] == _SCALE for each in facts.claimed):
        return (
            f"A gain or a parameter of the simulation is {probably}wrong ({names}), which explains {extent}."
        )
    if len(facts.claimed) == 1:
        others = ", with those that are not claimed," if facts.has_others else ""
        return f"The simulation {probably}lacks a known effect, {names}, which{others} explains {extent}."
    known = "" if facts.free_forms else "known "
    return f"The simulation {probably}lacks {known}effects, {names}, which explain {extent}."


def _describe_rest(facts: DiagnosisFacts) -> str:
    return "; significant structure remains" if facts.verdict == "named with remainder" else ""


def _describe_uncertain(facts: DiagnosisFacts) -> str:
    extent = f"{_describe_extent(facts, 'it')}{_describe_rest(facts)}"
    if len(facts.claimed) > 1:
        return f"There is a discrepancy, whose causes are uncertain: the most probable ones explain {extent}."
    form = " is a free form, and" if facts.free_forms else ""
    return f"There is a discrepancy, whose cause is uncertain: the most probable one{form} explains {extent}."


def _describe_family(facts: DiagnosisFacts) -> str:
    forms = " and ".join(facts.free_forms)
    named = f" ({forms})" if forms else ""
    return (
        f"The discrepancy has the place and the family of a free form{named}, and the shape of no known "
        f"effect. The causes explain {_describe_extent(facts)}."
    )


def _describe_discovered(facts: DiagnosisFacts) -> str:
    is_better = facts.discovered is not None and facts.discovered["worse_by"] > 0.0
    alone = " Known effects alone explain less." if is_better else ""
    known = " and the known effects" if any(each["family"] != _TERM for each in facts.causes) else ""
    extent = _describe_extent(facts)
    return f"The simulation lacks terms; those that were found{known} explain {extent}.{alone}"


def _describe_cause(facts: DiagnosisFacts, cause: Document) -> str:
    parts = [f"{_describe_confidence(cause)}{_describe_share(facts, cause)}"]
    if cause["equivalents"]:
        parts.append(
            f"this record does not distinguish it from {', '.join(map(facts.label, cause['equivalents']))}"
        )
    if not cause.get("claimed", True):
        parts.append("improves the fit, but is not claimed as a cause")
    return f"{_name_values(facts, cause)}; {'; '.join(parts)}{_explain_cause(cause)}"


def _explain_cause(cause: Document) -> str:
    """State what a claimed cause is, what distinguishes it, and which parts of machines have it."""
    if not (cause.get("summary") and cause["claimed"]):
        return ""
    parts = ["", cause["summary"]]
    if cause["distinguished_by"] and cause["family"] != _SCALE:
        parts.append(f"Distinguished by: {cause['distinguished_by']}")
    if cause["occurs_in"]:
        parts.append(f"Occurs in: {cause['occurs_in']}")
    return f"{'. '.join(parts)}."


def _describe_confidence(effect: Document) -> str:
    confidence = effect["confidence"]
    if confidence >= _ALMOST_CERTAIN:
        return "confidence above 0.99"
    return "confidence below 0.01" if confidence < 1.0 - _ALMOST_CERTAIN else f"confidence {confidence:.2f}"


def _describe_share(facts: DiagnosisFacts, cause: Document) -> str:
    """State how much larger the error is without a cause."""
    share = f", {floor(100 * cause['eta'])} %"
    if cause["family"] == _GROSS:
        return f"{share} of the mean squared error" if facts.removes_error else ""
    if cause.get("error_share") is None:  # a document of an earlier version
        together = " by all terms and effects" if cause["family"] == _TERM else ""
        return f"{share} of the misfit above the noise floor{together}"
    return "" if cause["family"] == _TERM else f"; without it, the RMSE is {_compare_errors(cause)}"


def _compare_errors(cause: Document) -> str:
    """Compare the error without a cause, after another calibration, with that of the extended simulation."""
    left = 1.0 - cause["error_share"]
    if left <= 0.0 or cause["error_share"] <= 0.0:
        return "much larger" if left <= 0.0 else "not larger"
    ratio = sqrt(1.0 / left)
    return f"{ratio:.3g} times as large" if ratio >= _TIMES else f"{100 * (ratio - 1.0):.2g} % larger"


def _list_names(names: Sequence[str]) -> str:
    """Write names as a list: ``A, B and C``."""
    names = list(dict.fromkeys(names))
    return " and ".join(filter(None, (", ".join(names[:-1]), *names[-1:])))


def _name_values(facts: DiagnosisFacts, effect: Document) -> str:
    prefix = f"{effect['name']}:{effect.get('place')}"
    named = [
        (name.removeprefix(prefix).lstrip(), write_value(each, facts.is_exact))
        for name, each in effect["parameters"].items()
    ]
    values = ", ".join(f"{name} = {value}" if name else value for name, value in named)
    name = facts.label_effect(effect)
    if law := effect.get("resembles"):
        article = "an" if law["law"].startswith("a") else "a"
        return f"{name}, which resembles {article} {law['law']}: {law['formula']}; {values}"
    return f"{name}: {values}" if values else name


def write_value(given: Document, is_exact: bool = False) -> str:
    """Write a value with its unit and interval, with as many digits as the width of the interval needs.

    Parameters
    ----------
    given : mapping
        ``value``, ``unit`` and ``ci95``.
    is_exact : bool
        Whether the data have no noise. Otherwise a value with an interval of rounding has no response.
    """
    value, interval = given["value"] + 0.0, given["ci95"]  # -0.0 is 0.0
    unit = f" {given['unit']}" if given["unit"] not in ("", "1") else ""
    if interval is None:
        return f"{value:.4g}{unit}"
    low, high = interval
    digits = 4
    if value and low < high:
        digits = max(4, ceil(log10(abs(value) / (high - low))) + 2)
    if digits > _MOST_DIGITS:
        width = f"+/- {(high - low) / 2:.1g}" if is_exact else "not determined by the record"
        return f"{value:.4g}{unit} ({width})"
    return f"{value:.{digits}g}{unit} ({low:.{digits}g} to {high:.{digits}g})"


def _describe_input_limits(facts: DiagnosisFacts) -> str:
    """State the limits of the first input in its unit: `cut` is relative to a peak, and a rate is inverse."""
    name, unit = (facts.document["record"][key]["inputs"][0] for key in ("names", "units"))
    texts = []
    for cause, value in facts.input_limits:
        of, per = ("", unit) if cause == _SATURATION else ("the rate of ", f"{unit or '1'}/s")
        texts.append(f"{facts.label(cause)} limits {of}{name} to {write_amount(float(f'{value:.4g}'), per)}")
    return f"Limits of the input: {'; '.join(texts)}."


def _describe_growth(facts: DiagnosisFacts) -> str:
    assert facts.noise_claim is not None
    assert facts.error is not None
    rms = facts.noise_claim["rms"]
    return (
        f"The RMSE there is {facts.error / rms:.2g} times the residual in the samples used for estimation, "
        f"{facts.write_error(float(f'{rms:.2g}'))}. Noise of constant size does not explain this: look for "
        "an input that is not recorded, such as a disturbance or a temperature, or for steps of the actuator."
    )


def _describe_small_delay(facts: DiagnosisFacts) -> str:
    dt = facts.document["record"]["dt"]
    return (
        f"The delay is {facts.small_delay / dt:.2g} times the sampling time of {write_amount(dt, 's')}: time "
        "stamps, the order in which input and output are recorded, or the course of the input between two "
        "samples may be its cause, rather than a dead time of the machine."
    )


def _describe_correlation(facts: DiagnosisFacts) -> str:
    assert facts.noise_claim is not None
    seconds = write_amount(float(f"{facts.noise_claim['correlation_time']:.2g}"), "s")
    return (
        f"What remains is correlated over {seconds}. If the sensor has no such noise, look for a "
        "disturbance, an input that is not recorded, or dynamics that the simulation lacks."
    )


def _describe_recordings(facts: DiagnosisFacts) -> str:
    assert facts.held_out_recordings is not None
    record, (fitted, held_out) = facts.document["record"], facts.held_out_recordings
    begin = write_amount(record["start"] + facts.document["estimation_samples"] * record["dt"], "s")
    return (
        f"Fitted to {_list_names(fitted)}; {facts.held_out_part}: {_list_names(held_out)}, in the figures "
        f"from {begin} on."
    )


def _describe_second_input(facts: DiagnosisFacts) -> str:
    name, first = facts.second_inputs[0], facts.document["record"]["names"]["inputs"][0]
    return f"The input {name} acts on the system where {first} does, and the simulation does not read it."


def _describe_sweeps(facts: DiagnosisFacts) -> str:
    texts = []
    for name, first, last in facts.sweeps:
        source = _SWEEPS[name].format("up" if last > first else "down")
        texts.append(f"{name} sweeps from {first:.3g} to {last:.3g} Hz within the record: look for {source}.")
    return "\n".join(texts)


def _describe_noise(facts: DiagnosisFacts) -> str:
    named = map(_name_coefficients, facts.noise)
    listed = (f"{_name_values(facts, each)}, {_describe_confidence(each)}" for each in named)
    return f"Sampling and noise: {'; '.join(listed)}."


def _name_coefficients(effect: Document) -> Document:
    """Return an effect with names for the coefficients of coloured noise, without an order of zero."""
    parameters = {
        _COEFFICIENTS.get(name, name): each
        for name, each in effect["parameters"].items()
        if name != "difference order" or each["value"]
    }
    return {**effect, "parameters": parameters}


def _describe_record(facts: DiagnosisFacts) -> str:
    findings = facts.document["record_findings"]
    return "\n".join(f"Record: {each['description']} {each['advice']}" for each in findings)


def _describe_equations(facts: DiagnosisFacts) -> str:
    assert facts.discovered is not None
    equations = facts.discovered["equations"]
    if facts.verdict == "discovered":
        return f"Equations: {equations}"
    names = " and ".join(map(facts.label, facts.discovered["effects"]))
    return f"Equations that explain the record as well{f', with {names}' if names else ''}: {equations}"


def _describe_extended_equations(facts: DiagnosisFacts) -> str:
    assert facts.extended is not None
    values, notes = describe_extended_values(facts.document)
    parts = [f"Extended simulation: {'; '.join(facts.extended['equations'])}.", values, notes]
    return " ".join(filter(None, parts))


def describe_extended_values(document: Document) -> tuple[str, str]:
    """State the values in the equations of the extended simulation, and what these contain.

    Returns
    -------
    str, str
        Sentences; empty if there is nothing to state.
    """
    facts = DiagnosisFacts(document)
    assert facts.extended is not None
    own = [each for term in facts.terms for each in term["parameters"].items()]
    own += [(each["name"], each) for each in facts.extended["values"]]
    listed = [facts.calibrated, *(f"{name} = {write_value(each, facts.is_exact)}" for name, each in own)]
    values = ", ".join(filter(None, listed))
    notes = "".join(f"{note}. " for note in facts.extended["notes"]).strip()
    return f"Its values: {values}." if values else "", notes


def _describe_extended_simulation(facts: DiagnosisFacts) -> str:
    names = _list_names([facts.label_effect(each) for each in facts.causes])
    calibrated = f"; {facts.calibrated}" if facts.calibrated else ""
    return f"Extended simulation: {facts.document['equations']}{calibrated}; with {names}."


def _describe_nearest_to_terms(facts: DiagnosisFacts) -> str:
    assert facts.discovered is not None
    others = " and ".join(map(facts.label, facts.discovered["nearest"]))
    worse = f"{facts.discovered['worse_by']:.0f}"
    return f"With {others} instead of the terms, the score is worse by {worse} (BIC; 10 is decisive)."


def _describe_nearest(facts: DiagnosisFacts) -> str:
    listed = ", ".join(f"{facts.label_effect(each)}: {each['score']:.1f}" for each in facts.nearest)
    return f"Nearest effects, none of which is confirmed, with their scores (decrease of the BIC): {listed}."


def _describe_remainder(facts: DiagnosisFacts) -> str:
    listed = "; ".join(f"{name} ({distance:.1f})" for name, distance in facts.remainder.items())
    return f"The remaining residual depends on (standard deviations beyond chance): {listed}."


def _describe_gain(facts: DiagnosisFacts) -> str:
    assert facts.gain is not None
    before, after = map(facts.write_error, facts.errors)
    percent = _write_reduction(facts.gain)
    without = f"{before} ({name_reference(facts.document)})"
    beginning = f"On {facts.held_out_part}, excluded from fitting, the RMSE"
    text = f"{beginning} falls from {without} to {after}, by {percent}"
    if not facts.has_gain:
        text = (
            f"{beginning} does not fall significantly: {without}, {after} with them, a reduction of {percent}"
        )
    if (compared := compare_with_output(facts)) is not None:
        text += f"; what remains is {compared}"
    return f"{text}."


def _write_reduction(gain: Document) -> str:
    """Write the reduction of an error with its confidence interval."""
    low, high = gain["ci95"]
    return f"{gain['reduction_percent']:.1f} % ({low:.1f} to {high:.1f} with 95 % confidence)"


def _describe_exchange(facts: DiagnosisFacts) -> str:
    exchange = facts.document["exchange"]
    gain, values = exchange["gain"], exchange["values"]
    text = f"The reverse: with all values fitted to {facts.held_out_part} alone, "
    if gain is None:
        return f"{text}a simulation diverges on the data that were used for estimation."
    before, after = (facts.write_error(gain[each]["rmse"]) for each in ("before", "after"))
    falls = (
        f"falls from {before} to {after}, by {_write_reduction(gain)}"
        if gain["ci95"][0] > 0.0
        else f"does not fall significantly: {before} without them, {after} with them"
    )
    text += f"the RMSE of the data that were used for estimation {falls}."
    different = [each for each in values if not each["agrees"]]
    listed = "; ".join(
        f"{each['name']} = {each['estimation']:.3g} and {each['validation']:.3g} {each['unit']}".rstrip()
        for each in different or values
    )
    if different:
        # The values of an effect have its name, those of a term are parameters of the equations.
        names = {
            name
            for each in facts.functions_of_time
            for name in (each["parameters"] if each.get("term") else [each["name"]])
        }
        of_time = [each for each in different if each["name"].split()[0] in names]
        reason = (
            "They belong to functions of the time, and are those of one recording."
            if len(of_time) == len(different)
            else "The system differs between them, or the cause is another one."
        )
        return f"{text} Both parts have different values: {listed}. {reason}"
    compared = f" ({listed})" if listed else ""
    return f"{text} Both parts have the same values{compared}, within 10 % or four standard deviations."


def _describe_time_dependence(facts: DiagnosisFacts) -> str:
    text = f"{' and '.join(facts.time_dependent)}: a function of the time of this record"
    if not facts.document.get("is_time_left_out"):
        return f"{text}, which the extended simulation repeats on another one."
    return (
        f"{text}. It contradicts {facts.held_out_part}, where the simulation leaves it out. The extended "
        "simulation repeats it on another record."
    )


def name_reference(document: Document) -> str:
    """Name the simulation with which the extended one is compared.

    A calibration absorbs wrong gains and parameters, so that they are compared with the simulation as given.
    """
    facts = DiagnosisFacts(document)
    is_same = facts.gain is None or facts.calibrated_rmse in (None, facts.errors[0])
    is_calibrated = is_same and document.get("calibrated") != {}
    return "calibrated, without the effects" if is_calibrated else "as given, without the effects"


def _describe_error(facts: DiagnosisFacts) -> str:
    assert facts.error is not None
    given, calibrated = facts.document["as_given_rmse"], facts.error
    text = f"On {facts.held_out_part}, excluded from fitting, the RMSE is {facts.write_error(calibrated)}"
    if (compared := compare_with_output(facts)) is not None:
        text += f", {compared}"
    if abs(given - calibrated) > _CALIBRATED * calibrated:
        text += f"; before the calibration it is {facts.write_error(given)}"
    return f"{text}."


def compare_with_output(facts: DiagnosisFacts) -> str | None:
    """Write the error as a part of the output; None if it is unknown."""
    if facts.relative_error is None:
        return None
    if facts.is_exact:
        return "a rounding error"
    percent = 100 * facts.relative_error
    written = f"{percent:.0f}" if percent >= 10.0 else f"{percent:.2g}"
    return f"{written} % of the standard deviation of the output"


def _describe_noise_floor(facts: DiagnosisFacts) -> str:
    bound = "" if facts.is_measured else "at most "
    origin = (
        ", measured from repeated periods"
        if facts.is_measured
        else " (an input that repeats three times would measure it)"
    )
    return (
        f"The noise floor, the RMSE of the noise alone, is {bound}{facts.write_error(facts.floor)}{origin}"
        f"{_compare_with_floor(facts)}."
    )


def _compare_with_floor(facts: DiagnosisFacts) -> str:
    ratio = facts.noise_ratio
    if ratio is None:
        return ""
    if ratio < 1.0 / _NOISE_RATIO:
        return "; the RMSE is below it"
    times = "at" if ratio <= _NOISE_RATIO else f"{ratio:.3g} times"
    return f"; the RMSE is {times} the floor"


def _describe_stated_noise(facts: DiagnosisFacts) -> str:
    assert facts.error is not None
    level = facts.stated_noise
    return f"The stated noise is {facts.write_error(level)}; the RMSE is {facts.error / level:.3g} times it."


def _describe_large_noise(facts: DiagnosisFacts) -> str:
    if facts.is_coloured:
        return (
            "What remains counts as coloured noise: a cause that is not in the record, such as a missing "
            "input, is not excluded."
        )
    return "The noise is large: a discrepancy that is much smaller is not excluded."


def _describe_left_out(facts: DiagnosisFacts) -> str:
    steps = ", ".join(facts.document["left_out"])
    return f"The diagnosis was stopped, without: {steps}. The complete diagnosis may have another verdict."


def _describe_alarms(facts: DiagnosisFacts) -> str:
    alarms, p_value = facts.document["false_alarm_rate"], facts.document["p_value"]
    low, high = (100 * each for each in alarms["ci95"])
    # The number of records bounds the p-value from below.
    least = "at most " if p_value * (alarms["of"] + 1) < 1.5 else ""
    return (
        f"Of {alarms['of']} surrogate records without an effect, a cause was named in "
        f"{alarms['value'] * alarms['of']:.0f}: {100 * alarms['value']:.1f} % false alarms ({low:.1f} to "
        f"{high:.1f}). A correct simulation yields a candidate as good as the best one of this record with a "
        f"probability of {least}{p_value:.2g}."
    )


def _describe_limits(facts: DiagnosisFacts) -> str:
    limits = facts.document["detection_limits"]
    shown = sum(limit is not None for limit in limits.values())
    text = f"Of {len(limits)} effects, {shown} can be detected on this record"
    strengths = facts.document.get("tested_misfits")
    return f"{text}, up to a misfit of {strengths[-1]:g} times the noise." if strengths else f"{text}."


def _has(*verdicts: str) -> Callable[[DiagnosisFacts], bool]:
    """Return a predicate: whether the verdict is one of these."""
    return lambda facts: facts.verdict in verdicts


#: The verdict; one of them holds.
VERDICTS: Final[tuple[Statement[DiagnosisFacts], ...]] = (
    Statement(
        "nothing",
        lambda facts: facts.verdict == "nothing" and not facts.is_far,
        _describe_agreement,
    ),
    Statement(
        "noise",
        lambda facts: facts.verdict == "noise" and not facts.is_far,
        _describe_noise_claim,
    ),
    Statement(
        "nothing-in-estimation-data",
        lambda facts: _has("nothing", "noise")(facts) and facts.is_far,
        lambda facts: (
            "No significant discrepancy in the samples used for estimation, but the error of "
            f"{facts.held_out_part} is far above the noise floor."
        ),
    ),
    Statement(
        "named",
        lambda facts: _has("named", "named with remainder")(facts) and facts.is_certain,
        _describe_named,
    ),
    Statement(
        "uncertain",
        lambda facts: _has("named", "named with remainder", "family")(facts) and not facts.is_certain,
        _describe_uncertain,
    ),
    Statement("family", lambda facts: facts.verdict == "family" and facts.is_certain, _describe_family),
    Statement("discovered", _has("discovered"), _describe_discovered),
    Statement(
        "unknown",
        _has("unknown"),
        lambda _: "There is a significant discrepancy, and no known effect is confirmed as its cause.",
    ),
    Statement(
        "stopped",
        _has("stopped"),
        lambda _: "The diagnosis was stopped before a verdict: the causes are unknown.",
    ),
    Statement(
        "gross-error",
        _has("gross error"),
        lambda _: "Record and simulation do not match as they are: correct the record first.",
    ),
)

#: Noise, record, errors, and next steps.
DETAILS: Final[tuple[Statement[DiagnosisFacts], ...]] = (
    Statement(
        "intervals",
        lambda facts: any(each["ci95"] for cause in facts.causes for each in cause["parameters"].values()),
        lambda _: "Values in brackets are 95 % intervals.",
    ),
    Statement(
        "comparisons",
        lambda facts: facts.has_several_comparisons,
        lambda _: "Errors without an effect are those of another calibration, with all others.",
    ),
    Statement(
        "coordinate", lambda facts: facts.coordinate, lambda facts: f"In the formulas, {facts.coordinate}."
    ),
    Statement("small-delay", lambda facts: facts.small_delay, _describe_small_delay),
    Statement("input-limits", lambda facts: facts.input_limits, _describe_input_limits),
    Statement("second-input", lambda facts: facts.second_inputs, _describe_second_input),
    Statement("sweeps", lambda facts: facts.sweeps, _describe_sweeps),
    Statement("noise", lambda facts: facts.noise, _describe_noise),
    Statement(
        "correlation",
        lambda facts: (
            facts.is_correlated and _has("named", "named with remainder", "discovered", "family")(facts)
        ),
        _describe_correlation,
    ),
    Statement("recordings", lambda facts: facts.held_out_recordings, _describe_recordings),
    Statement("record", lambda facts: facts.document.get("record_findings"), _describe_record),
    Statement(
        "reading",
        lambda facts: facts.document["record"].get("reading"),
        lambda facts: "\n".join(f"Reading: {step}." for step in facts.document["record"]["reading"]),
    ),
    Statement(
        "correction",
        lambda facts: facts.is_gross,
        lambda _: "No effect was searched for: diagnose the corrected record.",
    ),
    Statement(
        "without-terms",
        lambda facts: facts.terms and facts.terms[0].get("error_share") is not None,
        lambda facts: f"Without all terms and effects, the RMSE is {_compare_errors(facts.terms[0])}.",
    ),
    Statement(
        "equations",
        lambda facts: facts.discovered is not None and not (facts.verdict == "discovered" and facts.extended),
        _describe_equations,
    ),
    Statement(EXTENDED, lambda facts: facts.extended, _describe_extended_equations),
    Statement(
        "extended-without-effects",  # a document of an earlier version
        lambda facts: (
            facts.gain is not None
            and not facts.extended
            and facts.verdict != "discovered"
            and facts.document.get("equations")
        ),
        _describe_extended_simulation,
    ),
    Statement(
        "calibrated",
        lambda facts: (
            _has("discovered", "nothing", "noise")(facts) and not facts.extended and facts.calibrated
        ),
        lambda facts: f"Calibrated{'' if facts.gain is None else ' with them'}: {facts.calibrated}.",
    ),
    Statement(
        "nearest-to-terms",
        lambda facts: (
            facts.verdict == "discovered" and facts.discovered is not None and facts.discovered["nearest"]
        ),
        _describe_nearest_to_terms,
    ),
    Statement(
        "nearest", lambda facts: _has("unknown", "stopped")(facts) and facts.nearest, _describe_nearest
    ),
    Statement(
        "no-nearest",
        lambda facts: facts.verdict == "unknown" and facts.document["candidates"] and not facts.nearest,
        lambda _: "No effect alone improves the fit by more than the penalty on its parameters.",
    ),
    Statement("remainder", lambda facts: facts.remainder, _describe_remainder),
    Statement(
        "predictable-residual",
        lambda facts: _has("named with remainder", "unknown")(facts) and not facts.remainder,
        lambda _: "A flexible model of the past of input and output predicts a part of the residual.",
    ),
    Statement("gain", lambda facts: facts.gain is not None, _describe_gain),
    Statement("exchange", lambda facts: facts.document.get("exchange"), _describe_exchange),
    Statement(
        "calibration",
        lambda facts: facts.is_worse_calibrated,
        lambda facts: (
            "Before the calibration, the RMSE there is "
            f"{facts.write_error(facts.document['as_given_rmse'])}, less than after it: the values that fit "
            "the other samples best replace what the simulation lacks, and do not carry over."
        ),
    ),
    Statement(
        "time-dependent",
        lambda facts: facts.gain is not None and facts.time_dependent,
        _describe_time_dependence,
    ),
    Statement(
        "one-record",
        lambda facts: facts.has_gain and facts.is_one_record,
        lambda _: (
            "Causes and gain rest on one record. Before you use the extended simulation elsewhere, record "
            "another input and diagnose again with the second record as validation data."
        ),
    ),
    Statement(
        "error",
        lambda facts: facts.gain is None and facts.error is not None and not facts.is_gross,
        _describe_error,
    ),
    Statement("growth", lambda facts: facts.grows, _describe_growth),
    Statement(
        "refusal",
        lambda facts: (facts.document.get("extension") or {}).get("refusal"),
        lambda facts: str(facts.document["extension"]["refusal"]),
    ),
    Statement(
        "contradictions",
        lambda facts: (facts.document.get("extension") or {}).get("contradictions"),
        lambda facts: "\n".join(facts.document["extension"]["contradictions"]),
    ),
    Statement("noise-floor", lambda facts: not facts.is_gross, _describe_noise_floor),
    Statement(
        "stated-noise",
        # The findings and the verdict compare them already, the findings on the samples used for estimation.
        lambda facts: (
            facts.stated_noise
            and facts.error is not None
            and not (facts.is_gross or facts.is_above_stated_noise or facts.verdict == "nothing")
        ),
        _describe_stated_noise,
    ),
    Statement(
        "noise-record",
        lambda facts: facts.verdict == "noise" and not facts.is_far,
        lambda _: (
            "To decide it, record the output at rest and diagnose again with its standard deviation as the "
            "noise level."
        ),
    ),
    Statement("large-noise", lambda facts: facts.has_large_noise, _describe_large_noise),
    Statement(
        "experiment",
        lambda facts: facts.document["decisive_experiment"],
        lambda facts: (
            f"Suggested experiment to separate confounded effects: {facts.document['decisive_experiment']}."
        ),
    ),
    Statement(
        "separated",
        lambda facts: facts.separated_pairs,
        lambda facts: (
            f"If {'; '.join(dict.fromkeys(facts.separated_pairs))} were the cause, this record would tell "
            "them apart: both may imitate another one."
        ),
    ),
    Statement(
        "formula",
        lambda facts: facts.document.get("proposal"),
        lambda facts: (
            f"A formula explains {floor(100 * facts.document['proposal']['explains'])} % of the residual of "
            f"the held-out data: {facts.document['proposal']['formula']}"
        ),
    ),
    Statement("left-out", lambda facts: facts.document.get("left_out"), _describe_left_out),
    Statement(
        "not-computed",
        lambda facts: facts.document.get("not_computed"),
        lambda facts: " ".join(describe_not_computed(facts.document)),
    ),
    Statement("false-alarms", lambda facts: facts.document.get("false_alarm_rate"), _describe_alarms),
    Statement("detection-limits", lambda facts: facts.document.get("detection_limits"), _describe_limits),
)
