"""Choice of inputs and output among the columns of a file, by their names and by which predicts which."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from islands.data.channel_names import parse_channel_name

#: Names that say that a column is an input or an output, by the first word of the name.
_SURE = {
    "input": re.compile(r"u\d*|in|inp|input|cmd|command|setpoint|sp"),
    "output": re.compile(r"y\d*|out|outp|output|response"),
}

#: Names that suggest it.
_LIKELY = {
    "input": re.compile(
        r"v|volt.*|current|drive.*|valve.*|pump.*|heat.*|power|pwm|duty|force|torque|ref.*|ctrl.*"
    ),
    "output": re.compile(
        r"temp.*|level|height|h|pos.*|disp.*|speed|vel.*|omega|acc.*|flow|press.*|strain|meas.*"
    ),
}

#: Probability that a role is right by a sure name, by a likely name, and by prediction only.
_BY_SURE_NAME, _BY_LIKELY_NAME, _BY_PREDICTION = 0.95, 0.7, 0.5

#: Probability that is added if the prediction agrees with the names.
_AGREES = 0.04

#: Part of the prediction error of an output that an input removes, at least.
_LEAST_INFLUENCE = 0.02

#: Columns whose mutual prediction is measured, lags, and samples, at most.
_MOST_COLUMNS, _LAGS, _SAMPLES = 12, 8, 4000

#: Levels of a column that numbers the parts of a file, at most, and samples of a part, at least.
_MOST_PARTS, _LEAST_PART = 100, 20


@dataclass(frozen=True, slots=True)
class ColumnChoice:
    """Inputs and output of a record.

    Attributes
    ----------
    inputs : tuple of str
    output : str
        Empty, like the inputs, if no two columns can be chosen.
    confidence : float or None
        Probability that the choice is right; None if the user made it.
    reason : str
        One sentence.
    """

    inputs: tuple[str, ...]
    output: str
    confidence: float | None
    reason: str


def choose_columns(
    columns: Mapping[str, NDArray[np.float64]], inputs: Sequence[str] = (), output: str | None = None
) -> ColumnChoice:
    """Choose inputs and output.

    Parameters
    ----------
    columns : mapping of str to ndarray, shape (samples,)
        Columns that may be used, without the time. Samples with a missing value are left out.
    inputs, output
        Choice of the user, completed if one of them is missing.
    """
    if inputs and output is not None:
        return ColumnChoice(tuple(inputs), output, None, "Inputs and output are as given.")
    signals = {name: values for name, values in columns.items() if not _is_counter(name, values)}
    signals |= {name: columns[name] for name in (*inputs, *([output] if output else [])) if name in columns}
    if len(signals) < 2:
        return ColumnChoice((), "", None, "Fewer than two columns are signals: name inputs and output.")
    names = list(signals)[:_MOST_COLUMNS]
    influence = _measure_influences([signals[name] for name in names])
    if output is None:
        output = max(
            (name for name in names if name not in inputs),
            key=lambda name: _rate_output(name, names, influence),
        )
    target = names.index(output) if output in names else 0
    chosen = tuple(inputs) or _choose_inputs(names, target, influence)
    return _explain(names, chosen, output, influence)


def _first_word(name: str) -> str:
    stem = parse_channel_name(name).stem.rpartition(".")[2]
    return re.split(r"[_\s\-.]", stem.strip().lower(), maxsplit=1)[0]


def find_role(name: str) -> tuple[str, float]:
    """Return the role that a column's name suggests, empty if none, and the probability that it is right."""
    word = _first_word(name)
    for table, probability in ((_SURE, _BY_SURE_NAME), (_LIKELY, _BY_LIKELY_NAME)):
        for role, pattern in table.items():
            if pattern.fullmatch(word):
                return role, probability
    return "", 0.0


def _rate_output(name: str, names: Sequence[str], influence: NDArray[np.float64]) -> float:
    """Return a score: names count more than prediction, and the first of equals wins."""
    role, probability = find_role(name)
    place = names.index(name)
    by_name = {"output": probability, "input": -probability, "": 0.0}[role]
    causal = float(np.max(influence[:, place]) - np.max(influence[place]))
    return 2.0 * by_name + 0.5 * causal - 1e-3 * place


def _choose_inputs(names: Sequence[str], target: int, influence: NDArray[np.float64]) -> tuple[str, ...]:
    """Return columns with the name of an input that predict the output, or the one that predicts best."""
    others = [place for place in range(len(names)) if place != target]
    sure = [
        place
        for place in others
        if find_role(names[place])[0] == "input" and influence[place, target] >= _LEAST_INFLUENCE
    ]
    named = [place for place in others if find_role(names[place])[0] == "input"]
    best = max(others, key=lambda place: (influence[place, target], -place))
    return tuple(names[place] for place in sure or named[:1] or [best])


def _explain(
    names: Sequence[str], inputs: tuple[str, ...], output: str, influence: NDArray[np.float64]
) -> ColumnChoice:
    by_name = [
        find_role(name) if find_role(name)[0] == role else ("", 0.0)
        for name, role in ((output, "output"), *((name, "input") for name in inputs))
    ]
    named = all(role for role, _ in by_name)
    confidence = min(probability for _, probability in by_name) if named else _BY_PREDICTION
    known = [name for name in (*inputs, output) if name in names]
    part = 0.0
    if len(known) == len(inputs) + 1:
        target = names.index(output)
        part = max(influence[names.index(name), target] for name in inputs)
        back = max(influence[target, names.index(name)] for name in inputs)
        confidence += _AGREES if part > back else -2.0 * _AGREES
    listed = ", ".join(inputs)
    ground = "by their names" if named else "because they predict each other best"
    predicts = "predict" if len(inputs) > 1 else "predicts"
    reason = f"{listed} and {output} are chosen {ground}"
    if part >= _LEAST_INFLUENCE:
        reason += f"; {listed} {predicts} {100 * part:.0f} % of the changes of {output} that its past leaves"
    reason += "."
    return ColumnChoice(inputs, output, min(confidence, 0.99), reason)


def _is_counter(name: str, values: NDArray[np.float64]) -> bool:
    """Return whether a column counts samples, or numbers the parts of a file."""
    known = values[np.isfinite(values)]
    if known.size < 2 or np.ptp(known) == 0.0:
        return True
    if find_role(name)[0]:
        return False
    steps = np.diff(known)
    if np.mean(steps == np.median(steps)) > 0.98 and np.median(steps) != 0.0:
        return True
    levels, changes = np.unique(known).size, np.count_nonzero(steps)
    whole = np.all(known == np.round(known)) and np.all(steps >= 0.0)
    return bool(whole and levels <= _MOST_PARTS and changes * _LEAST_PART <= known.size)


def _measure_influences(signals: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Return the part of the prediction error of every column that the past of another one removes.

    Row: the column that predicts. Column: the one that is predicted.
    """
    samples = min(len(values) for values in signals)
    first = max(0, samples - _SAMPLES) // 2
    parts = np.array([values[first : first + _SAMPLES] for values in signals])
    parts = parts[:, np.isfinite(parts).all(axis=0)]
    count = len(signals)
    found = np.zeros((count, count))
    if parts.shape[1] < 8 * _LAGS:
        return found
    sizes = parts.std(axis=1, keepdims=True)
    parts = (parts - parts.mean(axis=1, keepdims=True)) / np.where(sizes > 0.0, sizes, 1.0)
    rows = np.arange(_LAGS, parts.shape[1])
    past = [np.array([part[rows - lag] for lag in range(1, _LAGS + 1)]) for part in parts]
    for target in range(count):
        own = _measure_error(past[target], parts[target, rows])
        for source in range(count):
            if source != target and own > 0.0:
                both = _measure_error(np.concatenate([past[target], past[source]]), parts[target, rows])
                found[source, target] = max(0.0, 1.0 - both / own)
    return found


def _measure_error(columns: NDArray[np.float64], target: NDArray[np.float64]) -> float:
    """Return the mean squared error of the second half of a signal, predicted by that of the first half."""
    half = target.size // 2
    x = columns[:, :half]
    ridge = 1e-8 * half * np.eye(len(columns))
    weights = np.linalg.solve(np.einsum("ir,jr->ij", x, x) + ridge, np.einsum("ir,r->i", x, target[:half]))
    return float(np.mean((target[half:] - np.einsum("ir,i->r", columns[:, half:], weights)) ** 2))
