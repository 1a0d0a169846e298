"""Facts about a diagnosis: quantities and decisions that sentences state, from ``discrepancy.json`` alone.

The limits of all sentences about diagnoses are here; the templates have none. Facts about the gain are those
of the held-out data, which may disagree with the samples used for estimation.
"""

import re
from functools import cached_property
from itertools import accumulate
from math import ceil, floor, log10, sqrt
from typing import Final

from islands.records.channel_names import TEMPERATURES
from islands.report.text.facts import FAR_RATIO, NOISE_RATIO, Document, round_ratio
from islands.rounding import RESOLUTION
from islands.sentences import write_amount

#: Held-out share of the misfit above which the effects explain it, and above which they explain most of it.
_WHOLE, _MOST = 0.9, 0.5

#: Confidence below which other causes together are more probable.
_CERTAIN = 0.5

#: Confidence below which a cause is called probable.
_SURE = 0.9

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

#: Effect of a channel that acts where the input does.
_SECOND_INPUT = "second-input"

#: Pattern of the names of initial states.
_INITIAL: Final = r"initial |state \d"

#: Simulations in which forces act on the output, and those to whose output forces of the input are added.
_ON_OUTPUT, _ON_INPUT = ("second-order", "rigid-axis"), ("bouc-wen-piezo", "linear", "column")

#: Effect of a wrong form of an identified model.
_FORM = "core-shape"

#: Effects with a frequency that changes.
_SWEEPS: Final = ("swept-disturbance", "swept-interference")


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

    def amount(self, value: float) -> str:
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
    def extension(self) -> Document:
        """The extension of the simulation. Empty if there is none."""
        return self.document.get("extension") or {}

    @property
    def extended(self) -> Document | None:
        """The extension, if its equations are known."""
        return self.extension if self.extension.get("equations") else None

    @property
    def input_limits(self) -> list[tuple[str, float, str]]:
        """Name of each claimed cause that limits the first input or its rate, the limit, and its unit."""
        # `cut` is relative to a peak, and a rate is inverse.
        ranges, unit, found = self.extension.get("ranges"), self.record["units"]["inputs"][0], []
        for each in self.claimed:
            values = each["parameters"]
            if each["name"] == _SATURATION and ranges:
                peak = max(abs(ranges[0]["low"]), abs(ranges[0]["high"]))
                found.append((_SATURATION, peak * (1.0 - values["cut"]["value"]), unit))
            if each["name"] == _RATE_LIMIT and values["inverse_rate"]["value"] > 0.0:
                found.append((_RATE_LIMIT, 1.0 / values["inverse_rate"]["value"], f"{unit or '1'}/s"))
        return found

    @property
    def sweeps(self) -> list[tuple[str, str, float, float]]:
        """Name and direction of each claimed sweep, and its frequencies at start and end in Hz."""
        record, found = self.document["record"], [each for each in self.claimed if each["name"] in _SWEEPS]
        sweeps = []
        for each in found:
            frequency, rate = (each["parameters"][name]["value"] for name in ("frequency", "rate"))
            direction = "up" if rate > 0.0 else "down"
            last = frequency + record["samples"] * record["dt"] * rate
            sweeps.append((each["name"], direction, frequency, last))
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
    def held_out_start(self) -> float:
        """Time at which the held-out data begin, in seconds."""
        return float(self.record["start"] + self.document["estimation_samples"] * self.record["dt"])

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
    def growth(self) -> float:
        """Error of the held-out data, divided by the residual in the samples used for estimation."""
        assert self.noise_claim is not None
        assert self.error is not None
        return float(self.error / self.noise_claim["rms"])

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
        return self.gain is not None and self.is_reduced(self.gain)

    def is_reduced(self, gain: Document) -> bool:
        """Return whether an error is reduced, with 95 % confidence."""
        return bool(gain["ci95"][0] > 0.0)

    @property
    def share(self) -> float | None:
        """Share of the misfit above the noise floor that disappears on the held-out data.

        It is None if the error without the effects is not above the noise floor.
        """
        assert self.gain is not None
        before, after, noise = (each**2 for each in (*self.errors, self.floor))
        return (before - after) / (before - noise) if before > noise else None

    @property
    def extent(self) -> str:
        """How much of the discrepancy disappears on the held-out data: nothing, part, most, nearly or all."""
        if not self.has_gain:
            return "nothing"
        share = self.share
        is_rest = bool(self.remainder) or self.is_far or self.verdict == "named with remainder"
        if not is_rest and (self.is_noise or share is None):
            return "all"
        if not is_rest and share is not None and share >= _WHOLE:
            return "all" if self.noise_ratio is None else "nearly"
        return "most" if share is None or share >= _MOST else "part"

    @property
    def has_one_cause(self) -> bool:
        """Whether one cause is claimed."""
        return len(self.claimed) == 1

    @property
    def is_form(self) -> bool:
        """Whether the form of an identified model is wrong."""
        return all(each["name"] == _FORM for each in self.claimed)

    @property
    def is_scale(self) -> bool:
        """Whether gains or parameters are wrong."""
        return all(each["family"] == _SCALE for each in self.claimed)

    @property
    def is_better_with_terms(self) -> bool:
        """Whether known effects explain less than the terms that were found."""
        return self.discovered is not None and self.discovered["worse_by"] > 0.0

    @property
    def has_known(self) -> bool:
        """Whether a cause is a known effect, and no term."""
        return any(each["family"] != _TERM for each in self.causes)

    def is_term(self, cause: Document) -> bool:
        """Return whether a cause is a term that was found."""
        return bool(cause["family"] == _TERM)

    def confidence(self, effect: Document) -> str:
        """Write a confidence: no cause is certain or impossible."""
        confidence = effect["confidence"]
        if confidence >= _ALMOST_CERTAIN:
            return "above 0.99"
        return "below 0.01" if confidence < 1.0 - _ALMOST_CERTAIN else f"{confidence:.2f}"

    def whole_percent(self, share: float) -> int:
        """Return a share in whole per cent; one below a limit never reaches it."""
        return floor(100 * share)

    def explains(self, cause: Document) -> bool:
        """Return whether it is stated what a cause is, and which parts of machines have it."""
        return bool(cause.get("summary") and cause["claimed"])

    def is_distinguished(self, cause: Document) -> bool:
        """Return whether something in a record distinguishes a cause: gains and parameters look alike."""
        return bool(cause["distinguished_by"] and cause["family"] != _SCALE)

    def is_correction(self, cause: Document) -> bool:
        """Return whether a cause is a gross error of the record."""
        return bool(cause["family"] == _GROSS)

    def growth_without(self, cause: Document) -> tuple[str, float]:
        """Return the error without a cause, after another calibration, relative to the extended simulation.

        The word tells how to write it: much, none, times or percent.
        """
        left = 1.0 - cause["error_share"]
        if left <= 0.0 or cause["error_share"] <= 0.0:
            return ("much" if left <= 0.0 else "none"), 0.0
        ratio = sqrt(1.0 / left)
        return ("times", ratio) if ratio >= _TIMES else ("percent", 100 * (ratio - 1.0))

    def values(self, effect: Document) -> list[tuple[str, str]]:
        """Return names and values of the parameters of an effect, without an order of zero."""
        prefix = f"{effect['name']}:{effect.get('place')}"
        return [
            (name.removeprefix(prefix).lstrip(), write_value(each, self.is_exact))
            for name, each in effect["parameters"].items()
            if name != "difference order" or each["value"]
        ]

    @property
    def has_intervals(self) -> bool:
        """Whether a value of a cause has a confidence interval."""
        return any(each["ci95"] for cause in self.causes for each in cause["parameters"].values())

    @property
    def is_explained(self) -> bool:
        """Whether causes are named."""
        return self.verdict in ("named", "named with remainder", "discovered", "family")

    @property
    def record(self) -> Document:
        """The record of the diagnosis."""
        record: Document = self.document["record"]
        return record

    @property
    def findings(self) -> list[Document]:
        """Findings about the record. Empty in documents of earlier versions."""
        return self.document.get("record_findings") or []

    @property
    def extended_values(self) -> str:
        """Values in the equations of the extended simulation."""
        assert self.extended is not None
        own = [each for term in self.terms for each in term["parameters"].items()]
        own += [(each["name"], each) for each in self.extended["values"]]
        listed = [self.calibrated, *(f"{name} = {write_value(each, self.is_exact)}" for name, each in own)]
        return ", ".join(filter(None, listed))

    @property
    def is_calibrated_reference(self) -> bool:
        """Whether the extended simulation is compared with the calibrated one, and not with that as given.

        A calibration absorbs wrong gains and parameters, so that they are compared with the simulation as
        given.
        """
        is_same = self.gain is None or self.calibrated_rmse in (None, self.errors[0])
        return is_same and self.document.get("calibrated") != {}

    @property
    def changes_by_calibration(self) -> bool:
        """Whether the calibration changes the error of the held-out data."""
        assert self.error is not None
        return bool(abs(self.document["as_given_rmse"] - self.error) > _CALIBRATED * self.error)

    @property
    def relative_percent(self) -> str:
        """Error of the held-out data in per cent of the standard deviation of the output."""
        percent = 100 * (self.relative_error or 0.0)
        return f"{percent:.0f}" if percent >= 10.0 else f"{percent:.2g}"

    @property
    def is_below_floor(self) -> bool:
        """Whether the error of the held-out data is below the noise floor."""
        return self.noise_ratio is not None and self.noise_ratio < 1.0 / NOISE_RATIO

    @property
    def is_noise_compared(self) -> bool:
        """Whether findings or verdict do not compare the stated noise with the error already."""
        is_stated = self.is_gross or self.is_above_stated_noise or self.verdict == "nothing"
        return bool(self.stated_noise) and self.error is not None and not is_stated

    @property
    def different(self) -> list[Document]:
        """Values that differ between the data used for estimation and the held-out data."""
        return [each for each in self.document["exchange"]["values"] if not each["agrees"]]

    @property
    def are_different_in_time(self) -> bool:
        """Whether all values that differ belong to functions of the time."""
        # The values of an effect have its name, those of a term are parameters of the equations.
        names = {
            name
            for each in self.functions_of_time
            for name in (each["parameters"] if each.get("term") else [each["name"]])
        }
        return all(each["name"].split()[0] in names for each in self.different)

    @property
    def is_least_p_value(self) -> bool:
        """Whether no surrogate record has a better candidate: their number bounds the p-value from below."""
        return bool(self.document["p_value"] * (self.document["false_alarm_rate"]["of"] + 1) < 1.5)

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
        return "output" if kind in _ON_OUTPUT else "input" if kind in _ON_INPUT else ""

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
        return (self.noise_ratio or 0.0) >= FAR_RATIO

    @property
    def is_noise(self) -> bool:
        """Whether the error of the held-out data is at most that of the noise."""
        return self.noise_ratio is not None and self.noise_ratio <= NOISE_RATIO

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
        return any(each["name"] == "above-noise-level" for each in self.findings)

    @property
    def is_gross(self) -> bool:
        """Whether the record has a gross error, so that no effect was searched for."""
        return self.verdict == "gross error"

    @property
    def removes_error(self) -> bool:
        """Whether the correction of a gross error reduces the error, which a calibration may hide."""
        errors = self.correction_errors
        return self.is_gross and errors is not None and errors["after"] < errors["before"]

    @property
    def correction_errors(self) -> Document | None:
        """Errors before and after the correction of a gross error; None if they are unknown."""
        errors: Document | None = self.findings[0]["errors"] if self.findings else None
        return errors

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
