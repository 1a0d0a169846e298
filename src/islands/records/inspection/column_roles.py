"""Choice of inputs and output among the columns of a file, by their names and by which responds to which."""

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from islands.records.channel_names import parse_channel_name
from islands.records.inspection.column_direction import estimate_direction
from islands.records.inspection.column_influence import (
    LEAST_SAMPLES,
    MOST_SAMPLES,
    ColumnInfluence,
    average_middle,
)
from islands.records.inspection.column_shape import describe_copy, is_label, is_product, is_total
from islands.records.inspection.gross_errors import find_gross_errors
from islands.sentences import write, write_one

#: Names that say that a column is an input or an output, by the first word of the name.
_SURE = {
    "input": re.compile(r"u\d*|in|inp|input|cmd|command"),
    "output": re.compile(r"y\d*|out|outp|output|response"),
}

#: Names that suggest it.
_LIKELY = {
    "input": re.compile(r"v|volt.*|current|drive.*|valve.*|pump.*|heat.*|power|pwm|duty|force|torque|ctrl.*"),
    "output": re.compile(
        r"temp.*|level|height|h|pos.*|disp.*|speed|vel.*|omega|acc.*|flow|press.*|strain|meas.*"
    ),
}

#: Units that suggest it, whatever the name is: a magnetic field H and the flux density B that it causes.
_UNITS = {"A/m": "input", "kA/m": "input", "T": "output", "mT": "output"}

#: Logarithm of the odds that a role is right by a sure name, and by a likely one or a unit.
_SURE_NAME, _LIKELY_NAME = 3.0, 0.85

#: Logarithm of the odds by the signals, at most.
_MOST_BY_SIGNALS = 4.0

#: Logarithm of the odds of an input that is visible only if others are known, and by its shape, at least.
_BY_INDEPENDENCE, _LEAST_INDEPENDENT = 2.0, -1.0

#: Gain of an input that no column predicts and whose shape is that of a response, at least.
_CLEAR_GAIN = 0.1

#: Weight of the unlimited odds by the signals between pairs with equal odds.
_TIE = 1e-2

#: Probability of a choice, at least and at most.
_LEAST_PROBABILITY, _MOST_PROBABILITY = 0.05, 0.98

#: Probability of a choice by names, at most, if no response is visible.
_BY_NAME_ALONE = 0.5

#: Columns that are compared, at most.
_MOST_COLUMNS = 12

#: Levels of a column that numbers the parts of a file, at most, and samples of a part, at least.
_MOST_PARTS, _LEAST_PART = 100, 20

#: Range of a column relative to its values that counts as none.
_ROUNDING = 1e-13

#: Range of a column whose squares are numbers.
_USUAL = (1e-100, 1e100)

#: Part of the samples in which a measured signal moves, at least.
_MOVING = 0.5

#: Part of a column that has values, at least, to be compared without being named.
_LEAST_KNOWN = 0.5


@dataclass(frozen=True, slots=True)
class ColumnChoice:
    """Inputs and output of a record.

    Attributes
    ----------
    inputs : tuple of str
    output : str
        Empty, like the inputs, if no column visibly responds to another one.
    confidence : float or None
        Probability that the choice is right; None if the user made it.
    finding : str
        Why the choice was made: a statement of the template ``record``.
    details : mapping
        Quantities and decisions that the reason states.
    """

    inputs: tuple[str, ...]
    output: str
    confidence: float | None
    finding: str
    details: Mapping[str, Any] = field(default_factory=dict)

    @property
    def reason(self) -> str:
        """The reason in one sentence, with remarks on other columns."""
        parts = [write_one("record", self.finding, choice=self, **self.details)]
        parts += write("record", "remark", **{**_NO_REMARKS, **self.details})
        return "; ".join(parts) + "."

    def as_document(self) -> dict[str, Any]:
        """Return the choice as a JSON document."""
        return {name: getattr(self, name) for name in ("inputs", "output", "confidence", "reason")}


#: Remarks on columns, which a choice without further columns does not have.
_NO_REMARKS: Mapping[str, Any] = MappingProxyType(
    {"labels": (), "copies": (), "products": (), "compared": None}
)


def choose_columns(
    columns: Mapping[str, NDArray[np.float64]], inputs: Sequence[str] = (), output: str | None = None
) -> ColumnChoice:
    """Choose inputs and output.

    Columns are proposed only if a response of the output to them is visible, or if their names are sure.

    Parameters
    ----------
    columns : mapping of str to ndarray, shape (samples,)
        Columns that may be used, without the time. Samples with a missing value are left out.
    inputs, output
        Choice of the user, completed if one of them is missing.
    """
    if inputs and output is not None:
        return ColumnChoice(tuple(inputs), output, None, "choice_given")
    given = {*inputs, *([] if output is None else [output])}
    # Differences of very large numbers overflow.
    with np.errstate(over="ignore", invalid="ignore"):
        signals = {
            name: values
            for name, values in columns.items()
            if np.isfinite(values).mean() >= _LEAST_KNOWN * (name not in given)
            and (name in given or not is_counter(name, values))
        }
        numberings = {name: values for name, values in signals.items() if is_numbering(name, values)}
        signals = {
            name: values for name, values in signals.items() if name in given or name not in numberings
        }
        if numberings and len(signals) < 2:
            signals, numberings = signals | numberings, {}
        signals = {
            name: values
            for name, values in signals.items()
            if name in given or not any(_adds_up(values, other) for other in signals.values())
        }
        labels = _find_labels(signals, given)
        signals = {name: values for name, values in signals.items() if name not in labels}
        if len(signals) < 2:
            return ColumnChoice((), "", None, "choice_too_few", {"signal": next(iter(signals), "")})
        copies = _find_copies(signals, given)
        kept = {name: values for name, values in signals.items() if name not in copies}
        products = _find_products(kept, given)
        kept = {name: values for name, values in kept.items() if name not in products}
        choice = _choose(kept, given, tuple(inputs), output) if len(kept) > 1 else None
        if choice is None or ((products or copies) and not choice.output):
            # The product of independent columns, or a multiple of the only one, may be a response.
            kept, products, copies = signals, {}, {}
            choice = _choose(kept, given, tuple(inputs), output)
    remarks = {
        "labels": tuple(labels.items()),
        "copies": tuple((name, *found) for name, found in copies.items()),
        "products": tuple((name, *found) for name, found in products.items()),
        "compared": (len(kept), _MOST_COLUMNS) if len(kept) > _MOST_COLUMNS else None,
    }
    return replace(choice, details={**choice.details, **remarks})


def _choose(
    signals: Mapping[str, NDArray[np.float64]],
    given: set[str],
    inputs: tuple[str, ...],
    output: str | None,
) -> ColumnChoice:
    """Choose among the first columns and those that are given."""
    names = [*given & signals.keys(), *(name for name in signals if name not in given)][:_MOST_COLUMNS]
    names = [name for name in signals if name in names]
    return _compare(names, [signals[name] for name in names]).choose(inputs, output)


def _adds_up(values: NDArray[np.float64], other: NDArray[np.float64]) -> bool:
    """Return whether a column counts the values of another one of one sign, such as a charge."""
    known = _both_known(values, other)
    return bool(known.any()) and is_total(values[known], other[known])


def _find_labels(signals: Mapping[str, NDArray[np.float64]], given: Collection[str]) -> dict[str, str]:
    """Return the columns that number groups of values of another one, with its name."""
    found = {}
    for name, values in signals.items():
        for source, other in signals.items():
            known = _both_known(values, other)
            if name not in given and name != source and known.any() and is_label(values[known], other[known]):
                found[name] = source
                break
    return found


def _find_copies(
    signals: Mapping[str, NDArray[np.float64]], given: Collection[str]
) -> dict[str, tuple[str, str]]:
    """Return the columns that are another one, or a linear function of it, with kind and name."""
    found: dict[str, tuple[str, str]] = {}
    ordered = sorted(signals, key=lambda name: name not in given)
    for place, name in enumerate(ordered):
        for source in ordered[:place]:
            known = _both_known(signals[name], signals[source])
            if name in given or source in found or not known.any():
                continue
            kind = describe_copy(signals[name][known], signals[source][known])
            if kind:
                found[name] = kind, source
                break
    return found


def _find_products(
    signals: Mapping[str, NDArray[np.float64]], given: Collection[str]
) -> dict[str, tuple[str, str]]:
    """Return the columns that are the product of two others, with their names."""
    found: dict[str, tuple[str, str]] = {}
    if len({len(values) for values in signals.values()}) != 1 or len(signals) > _MOST_COLUMNS:
        return found
    known = np.all([np.isfinite(values) for values in signals.values()], axis=0)
    for name in signals:
        if name in given or not known.any():
            continue
        others = combinations([each for each in signals if each != name and each not in found], 2)
        pair = next(
            (each for each in others if is_product(*(signals[column][known] for column in (name, *each)))),
            None,
        )
        if pair is not None:
            found[name] = pair
    return found


def _both_known(values: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.bool_]:
    return (
        np.isfinite(values) & np.isfinite(other) if len(values) == len(other) else np.zeros(len(values), bool)
    )


def _first_word(name: str) -> str:
    stem = parse_channel_name(name).stem.rpartition(".")[2]
    return re.split(r"[_\s\-.]", stem.strip().lower(), maxsplit=1)[0]


def find_role(name: str) -> tuple[str, float]:
    """Return the role that a column's name or unit suggests, empty if none, and the logarithm of its odds."""
    word = _first_word(name)
    if sure := _match(_SURE, word):
        return sure, _SURE_NAME
    likely = _UNITS.get(parse_channel_name(name).unit, "") or _match(_LIKELY, word)
    return likely, _LIKELY_NAME if likely else 0.0


def _match(table: Mapping[str, re.Pattern[str]], word: str) -> str:
    return next((role for role, pattern in table.items() if pattern.fullmatch(word)), "")


def _rate_name(name: str, role: str) -> float:
    """Return the logarithm of the odds that a column has a role by its name."""
    found, odds = find_role(name)
    return odds if found == role else -odds


def _is_sure(name: str, role: str) -> bool:
    return find_role(name) == (role, _SURE_NAME)


@dataclass(frozen=True, slots=True, eq=False)
class _Comparison:
    """Columns, and which are inputs of which: row the input, column the output.

    Attributes
    ----------
    names : list of str
    odds : ndarray, shape (columns, columns)
        Logarithm of the odds that one column is an input of the other.
    unlimited : ndarray, shape (columns, columns)
        Logarithm of the odds by the signals, without a limit.
    gains : ndarray, shape (columns, columns)
        Visible gain of each pair, zero if no response is visible.
    derived : ndarray of bool, shape (columns, columns)
        Whether one column is a derivative of the other.
    allowed : ndarray of bool, shape (columns, columns)
        Whether the pair may be chosen.
    manipulated : ndarray, shape (columns, columns)
        As in `ColumnDirection`.
    influence : ColumnInfluence or None
        None for a record that is too short to measure it.
    places : mapping of int to int
        Place of a column in the influence.
    """

    names: list[str]
    odds: NDArray[np.float64]
    unlimited: NDArray[np.float64]
    gains: NDArray[np.float64]
    derived: NDArray[np.bool_]
    allowed: NDArray[np.bool_]
    manipulated: NDArray[np.float64]
    influence: ColumnInfluence | None
    places: Mapping[int, int]

    def choose(self, inputs: tuple[str, ...], output: str | None) -> ColumnChoice:
        known = [self.names.index(name) for name in inputs if name in self.names]
        allowed = self.allowed.copy()
        if output is not None:
            allowed &= np.array(self.names) == output
        if inputs:
            allowed &= np.isin(np.arange(len(self.names)), known)[:, None]
            allowed[:, known] = False
        if not allowed.any():
            return self._deny(inputs, output)
        best = np.argmax(np.where(allowed, self.odds + _TIE * self.unlimited, -np.inf))
        source, target = (int(place) for place in np.unravel_index(best, self.odds.shape))
        chosen = known or self._add_inputs(source, target)
        return self._explain(inputs or tuple(self.names[place] for place in chosen), chosen, target)

    def _deny(self, inputs: tuple[str, ...], output: str | None) -> ColumnChoice:
        """Return the choice of no column, with what the user has to name."""
        finding = "choice_no_response"
        if self.influence is None:
            finding = "choice_too_short"
        elif output is not None:
            finding = "choice_no_input"
        elif inputs:
            finding = "choice_no_output"
        # The names that the reason states are those that were given.
        details = {"inputs": inputs, "output": output, "least": LEAST_SAMPLES}
        return ColumnChoice((), "", None, finding, details)

    def _add_inputs(self, source: int, target: int) -> list[int]:
        """Return the best input and all others that improve the prediction of the output."""
        chosen = [source]
        if self.influence is None or target not in self.places:
            return chosen
        others = [int(place) for place in np.argsort(-self.odds[:, target], kind="stable")]
        # Some inputs show only when others are known, so that all are tried again after each.
        while (
            added := next((each for each in others if self._is_input(each, chosen, target)), None)
        ) is not None:
            chosen.append(added)
        # An input that was better than nothing may be no better than all others.
        for place in chosen[:0:-1]:
            known = [each for each in chosen if each != place]
            if self._measure_gain(target, known, place) == 0.0:
                chosen = known
        return sorted(chosen)

    def _is_input(self, place: int, chosen: Sequence[int], target: int) -> bool:
        """Return whether a column may be a further input: neither a response nor what controls an input."""
        name = self.names[place]
        if place in (*chosen, target) or place not in self.places or _is_sure(name, "output"):
            return False
        if _is_sure(name, "input"):
            return self._measure_gain(target, chosen, place) > 0.0
        if self._rate_input(place, target) <= 0.0 or self.derived[place, target]:
            return False
        if any(self.manipulated[place, each] < 0.0 for each in chosen):
            return False
        # The derivative of a response is one, too, although it is rougher than the input.
        is_response = any(
            self.gains[each, place] > 0.0 and (self.odds[each, place] > 0.0 or self.derived[place].any())
            for each in chosen
        )
        if is_response and self.manipulated[place, target] <= 0.0:
            return False
        is_shaped = self.gains[place, target] > 0.0 or self.odds[place, target] > _LEAST_INDEPENDENT
        return self._measure_gain(target, chosen, place) > (0.0 if is_shaped else _CLEAR_GAIN)

    def _rate_input(self, place: int, target: int) -> float:
        """Return the logarithm of the odds that a column is an input of the output.

        The response to a weak input, or to one that modulates others, shows only if these are known. Such a
        column is independent of the others, so that it is not a response itself. A slow disturbance, such as
        the temperature of a room, has the shape of a response, but no column predicts it.
        """
        if self.influence is None or self.gains[place, target] > 0.0:
            return float(self.odds[place, target])
        if self.gains[target, place] > 0.0:
            return float(self.odds[place, target] - self.odds[target, place])
        is_unpredicted = not self.gains[:, place].any()
        is_independent = is_unpredicted or self.odds[place, target] > _LEAST_INDEPENDENT
        return _BY_INDEPENDENCE if is_independent else -_BY_INDEPENDENCE

    def _measure_gain(self, target: int, known: Sequence[int], added: int) -> float:
        """Return what an input adds to the known ones, alone or by its products with them."""
        if self.influence is None:
            return 0.0
        at, source = [self.places[each] for each in known if each in self.places], self.places[added]
        gain = self.influence.measure_gain(self.places[target], at, [source])
        return gain or self.influence.measure_modulation(self.places[target], at, source)

    def _explain(self, inputs: tuple[str, ...], chosen: Sequence[int], target: int) -> ColumnChoice:
        output = self.names[target]
        rated = [self._rate_input(place, target) for place in chosen]
        confidence = float(np.prod(1.0 / (1.0 + np.exp(-np.array(rated)))))
        confidence = min(max(confidence, _LEAST_PROBABILITY), _MOST_PROBABILITY)
        named = _is_named(output, "output") and all(_is_named(name, "input") for name in inputs)
        share, is_invisible = None, False
        seen = [place for place in chosen if self.gains[place, target] > 0.0]
        if seen and self.influence is not None:
            known = [self.places[each] for each in chosen if each in self.places]
            gain = self.influence.measure_gain(self.places[target], [], known)
            share = 1.0 - float(np.exp(-2.0 * max(gain, *self.gains[seen, target])))
        elif self.influence is not None:
            confidence, is_invisible = min(confidence, _BY_NAME_ALONE), True
        # A column that responds to the same inputs is another output.
        also = [
            name
            for place, name in enumerate(self.names)
            if place not in (*chosen, target)
            and any(self.gains[each, place] > 0.0 and self.odds[each, place] > 0.0 for each in chosen)
        ]
        # The direction is open if both columns predict each other, as with a response within the sample.
        together = [
            name
            for place, name in enumerate(self.names)
            if place not in (*chosen, target)
            and name not in also
            and any(min(self.gains[each, place], self.gains[place, each]) > 0.0 for each in chosen)
        ]
        details = {
            "is_named": named,
            "share": share,
            "is_invisible": is_invisible,
            "also": also,
            "together": together,
        }
        return ColumnChoice(inputs, output, confidence, "choice_found", details)


def _is_named(name: str, role: str) -> bool:
    return find_role(name)[0] == role


def _compare(names: list[str], columns: Sequence[NDArray[np.float64]]) -> _Comparison:
    signals = _prepare(columns)
    count = len(names)
    by_name = np.array(
        [[_rate_name(one, "input") + _rate_name(other, "output") for other in names] for one in names]
    )
    unlimited, gains, manipulated = np.zeros((3, count, count))
    derived = np.zeros((count, count), dtype=bool)
    if signals.shape[1] < LEAST_SAMPLES:
        allowed = (by_name > 0.0) & ~np.eye(count, dtype=bool)
        return _Comparison(names, 0.5 * by_name, unlimited, gains, derived, allowed, manipulated, None, {})
    middle = average_middle(signals, 1)
    # A smaller range is that of rounding errors.
    moving = np.flatnonzero(np.ptp(middle, axis=1) > _ROUNDING * np.abs(middle).max(axis=1))
    found, at = estimate_direction(signals[moving]), np.ix_(moving, moving)
    unlimited[at], gains[at], derived[at] = found.logits, found.influence.visible, found.derived
    manipulated[at] = found.manipulated
    # Names show the roles of columns without a visible response only if they are sure.
    odds = by_name - _MOST_BY_SIGNALS
    odds[at] += np.clip(found.logits, -_MOST_BY_SIGNALS, _MOST_BY_SIGNALS) + _MOST_BY_SIGNALS
    visible = gains > 0.0
    # The integral of a column that responds to no other one is a counter, such as a charge, and no output. If
    # nothing else is visible, one of two columns is the integral of the other as its response.
    is_response = (unlimited > 0.0) | ~visible.T
    responds = np.any(visible & ~derived & ~derived.T & is_response, axis=0, keepdims=True)
    counters = np.any(derived & ~responds.T, axis=0)
    candidates = (visible & ~derived & ~counters, visible & ~derived, visible)
    allowed = next((each for each in candidates if each.any()), visible)
    allowed |= by_name > _MOST_BY_SIGNALS
    places = {int(place): at for at, place in enumerate(moving)}
    return _Comparison(names, odds, unlimited, gains, derived, allowed, manipulated, found.influence, places)


def _prepare(columns: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Return the middle of columns without missing values and gross errors."""
    samples = min(len(values) for values in columns)
    first = max(0, samples - MOST_SAMPLES) // 2
    signals = np.array([values[first : min(samples, first + MOST_SAMPLES)] for values in columns])
    known = np.array([_mark_known(x, np.delete(signals, place, 0).T) for place, x in enumerate(signals)])
    signals = signals[:, known.all(axis=0)]
    if signals.shape[1] == 0:
        return signals
    low, high = signals.min(axis=1, keepdims=True), signals.max(axis=1, keepdims=True)
    half, middle = 0.5 * high - 0.5 * low, 0.5 * high + 0.5 * low
    # Squares of very large and very small numbers have no value; other columns keep their units.
    is_usual = (half > _USUAL[0]) & (half < _USUAL[1]) & (np.abs(middle) < _USUAL[1])
    scaled: NDArray[np.float64] = np.where(
        is_usual, signals, (signals - middle) / np.where(half > 0.0, half, 1.0)
    )
    return scaled


def _mark_known(values: NDArray[np.float64], others: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which samples are neither missing nor gross errors, which hide responses."""
    known: NDArray[np.bool_] = np.isfinite(values)
    errors = find_gross_errors(values, others)
    # A column that is held between its spikes is a command with pulses.
    is_measured = np.mean(np.diff(values) != 0.0) > _MOVING
    for places in (*errors.codes.values(), *([errors.spikes] if is_measured else [])):
        known[places] = False
    return known


def is_counter(name: str, values: NDArray[np.float64]) -> bool:
    """Return whether a column is constant or counts samples."""
    known = values[np.isfinite(values)]
    if known.size < 2 or np.ptp(known) == 0.0:
        return True
    if find_role(name)[0]:
        return False
    steps = np.diff(known)
    if np.mean(steps == np.median(steps)) > 0.98 and np.median(steps) != 0.0:
        return True
    # Whole numbers that begin again after each sample count samples.
    return bool(np.all(steps != 0.0)) and _increases_by_one(known)


def is_numbering(name: str, values: NDArray[np.float64]) -> bool:
    """Return whether a column may number the parts of a file; a test with several steps looks the same."""
    known = values[np.isfinite(values)]
    levels, changes = np.unique(known).size, np.count_nonzero(np.diff(known))
    # Two levels are a command: a step, or a switch.
    is_few = 2 < levels <= _MOST_PARTS and changes * _LEAST_PART <= known.size
    return bool(is_few) and not find_role(name)[0] and _increases_by_one(known)


def _increases_by_one(known: NDArray[np.float64]) -> bool:
    """Return whether whole numbers increase by one, and begin again at the least."""
    steps = np.diff(known)
    is_whole = np.all(known == np.round(known)) and np.all(steps[steps > 0.0] == 1.0)
    return bool(is_whole and np.all(known[1:][steps < 0.0] == known.min()))
