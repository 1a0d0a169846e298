"""Description of the recommended model in sentences."""

from collections.abc import Iterator
from math import floor, isfinite

import numpy as np

from islands.data.split import describe_extrapolation
from islands.estimation.constraints.checks import ConstraintCheck
from islands.evolution.search_result import SearchResult
from islands.models.equations import (
    named_signals,
    named_statement,
    signal_names,
)
from islands.models.narx import require_narx
from islands.models.signal_statement import describe_values
from islands.validation.assessment import Assessment
from islands.validation.predictable_residual import ADEQUATE, LARGEST_SHARE, ResidualStructure
from islands.validation.prediction_bands import LEVEL

#: Smallest R2 of a simulation that counts as good.
_GOOD_R2 = 0.9

#: Ratio of the errors on validation data and estimation data above which a model does not generalise.
_LARGE_RATIO = 2.0

#: RMSE as a fraction of the output range that is a rounding error: its ratio to another one says nothing.
_ROUNDING = 1e-6

#: Least fraction of the validation samples inside a band of 90 %: two standard errors of 20 independent ones.
_LEAST_COVERAGE = 0.75

#: Standard errors below which a parameter is not significant.
_SIGNIFICANT = 2.0

#: Inclusion probability from which a term is certain.
_CERTAIN = 0.9

#: Inclusion probability below which most of the weight is on models without the term.
_UNLIKELY = 0.5

#: Closure of a loop, in per cent of the output range, above which the loop is open.
_OPEN_PERCENT = 5.0

#: Where to look for missing terms, by correlation test.
_HINTS = {
    "xi_xi": "terms in past outputs (larger lags, other powers), or a model of coloured noise",
    "u_xi": "linear or odd terms in {input}, also at other lags",
    "xi_xiu": "products of past outputs and {input}",
    "u2_xi": "even terms in {input}, such as squares or absolute values",
    "u2_xi2": "terms that grow with {input}, because the size of the residual depends on it",
}


def describe(found: SearchResult) -> list[str]:
    """Describe the recommended model in sentences: equation, error, uses, failures and next steps.

    Every statement is about a quantity of the assessment. The equation and the units are indented.
    """
    return [
        describe_choice(found),
        f"    {found.recommended.model.equation().named}",
        f"    {describe_units(found)}",
        *describe_findings(found),
    ]


def describe_choice(found: SearchResult) -> str:
    """State which model is recommended, and the first reason."""
    recommendation, size = found.recommendation, found.recommended.model.size
    return (
        f"Recommended: model {recommendation.rank} of {len(found.models)}, size {size}: "
        f"{recommendation.reasons[0]}."
    )


def describe_units(found: SearchResult) -> str:
    """State the units of the columns, the signals that the equation reads and direct feedthrough."""
    record = found.record
    columns = zip(
        signal_names(found.recommended.model), (record.output_unit, *record.input_units), strict=True
    )
    units = ", ".join(f"{name} in {unit}" for name, unit in columns if unit)
    reading = "".join(f" Reading: {step}." for step in record.reading)
    return f"{f'{units}; ' if units else ''}{_describe_rate(found)}.{_describe_feedthrough(found)}{reading}"


def describe_findings(found: SearchResult) -> list[str]:
    """Describe errors, uncertainty, uses, failures and next steps of the recommended model."""
    entry = found.recommended
    physics = (*found.recommendation.reasons, "")[1]
    failures = list(_list_failures(found, entry))
    bad = [*([physics] if physics.startswith("no model") else []), *failures]
    uses = _list_uses(entry, bool(bad))
    good = [*uses, *([physics] if physics and not physics.startswith("no model") else [])]
    return [
        _describe_error(found, entry),
        *_describe_recordings(found, entry),
        *_describe_uncertainty(found, entry),
        *_describe_constraints(entry),
        *_describe_preset(found),
        _describe_verdict(entry, bool(bad)),
        f"Good for: {'; '.join(good) or 'no use that the checks confirm'}.",
        f"Fails at: {'; '.join(bad) or 'none of the checks'}.",
        f"Next: {'; '.join(_list_next_steps(found, entry))}.",
    ]


def _describe_preset(found: SearchResult) -> Iterator[str]:
    """Yield the choice of the preset auto and its reasons."""
    if reasons := found.settings.get("choice", {}).get("reasons"):
        yield " ".join(reasons)


def _describe_feedthrough(found: SearchResult) -> str:
    if not found.direct_inputs:
        return ""
    inputs = ", ".join(found.direct_inputs)
    return f" Direct feedthrough: the output responds to {inputs} within the sample, so models read it at k."


def _describe_rate(found: SearchResult) -> str:
    model, record = found.recommended.model, found.record
    statement, done = named_signals(model), record.preprocessing
    if not describe_values(model):
        return "; ".join(filter(None, [statement, f"k counts samples of {found.split.estimation.dt:g} s"]))
    dt = record.dt if done is None else done.dt
    return f"{statement}, and simulate prepares a record of {dt:g} s in the same way"


def _describe_error(found: SearchResult, entry: Assessment) -> str:
    free, one = (entry.metrics["validation"][mode] for mode in ("free_run", "one_step_ahead"))
    if not isfinite(free.rmse):
        error = "the free run on the validation data diverges"
    else:
        error = f"free run on the validation data, from the inputs alone, RMSE {_unit(found, free.rmse)}"
        # Both are undefined for a constant output.
        error += f", mean absolute error {free.mape:.3g} % of the output range" if isfinite(free.mape) else ""
        error += f", R2 {free.r2:.5f}" if isfinite(free.r2) else ""
    return f"Error: {error}; one step ahead RMSE {_unit(found, one.rmse)}."


def _describe_recordings(found: SearchResult, entry: Assessment) -> Iterator[str]:
    errors = entry.recordings.get("validation", {})
    if errors:
        listed = ", ".join(f"{name} {_unit(found, each.rmse)}" for name, each in errors.items())
        yield f"RMSE of the free run by recording: {listed}."
    missing = int(np.isnan(found.record.y).sum())
    if missing:
        yield (
            f"Missing outputs: {missing} of {found.record.samples} samples are skipped, and every simulation "
            "is started again after them."
        )


def _describe_uncertainty(found: SearchResult, entry: Assessment) -> Iterator[str]:
    if entry.bands is None or found.ensemble is None:
        return
    doubtful = [f"{term} {_round_down(share)}" for term, share in _list_doubtful(found, entry)]
    text = f"the {100 * LEVEL:g} % prediction band of the free run has a median half-width of "
    text += f"{_unit(found, entry.bands.typical_half_width())}; "
    terms = f"doubtful terms, with the probability of their inclusion: {', '.join(doubtful)}"
    certain = f"every term has an inclusion probability of {_CERTAIN:g} or more"
    yield f"Uncertainty: {text}{terms if doubtful else certain}."


def _round_down(share: float) -> str:
    # A term below a limit never shows the limit.
    return f"{floor(100 * share) / 100:.2f}"


def _list_doubtful(found: SearchResult, entry: Assessment) -> list[tuple[str, float]]:
    """Return the terms that are not certain, each with the probability of its inclusion."""
    if found.ensemble is None:
        return []
    inclusion = map(found.ensemble.inclusion, entry.model.parameter_names)
    return [
        (term, share)
        for term, share in zip(entry.model.equation().terms, inclusion, strict=True)
        if share < _CERTAIN
    ]


def _describe_constraints(entry: Assessment) -> Iterator[str]:
    met = [
        named_statement(check.text, require_narx(entry.model))
        for check in _list_statements(entry)
        if check.met
    ]
    if met:
        yield f"Constraints that the model meets: {'; '.join(met)}."


def _list_statements(entry: Assessment) -> list[ConstraintCheck]:
    """Return the constraints of the user; the physics checks state whether Property 1 holds."""
    return [check for check in entry.constraints if check.text != "hysteresis"]


def _unit(found: SearchResult, value: float) -> str:
    return f"{value:.4g} {found.record.output_unit}".rstrip()


def _simulates(entry: Assessment) -> bool:
    """Return whether the free run on the validation data is finite and follows the output."""
    free = entry.metrics["validation"]["free_run"]
    # R2 is undefined for a constant output.
    return isfinite(free.rmse) and not free.r2 < _GOOD_R2


def _describe_verdict(entry: Assessment, has_limits: bool) -> str:
    """State the verdict on the use as a simulation, from the free run, and one step ahead as a detail."""
    word = "unsuitable" if not _simulates(entry) else "usable, with limits" if has_limits else "good"
    structure, bands = entry.residual_structure, entry.bands
    parts = []
    if isfinite(structure.free_run_share):
        parts.append(f"{100 * structure.free_run_share:.0f} % of the residual of the free run is predictable")
    if bands is not None and bands.coverage is not None:
        parts.append(
            f"{100 * bands.coverage:.0f} % of the validation samples are in the {100 * LEVEL:g} % band"
        )
    if isfinite(structure.one_step_share):
        parts.append(f"one step ahead, {100 * structure.one_step_share:.0f} % is predictable")
    measured = "; ".join(parts)
    return f"As a simulation: {word} ({measured})." if parts else f"As a simulation: {word}."


def _list_uses(entry: Assessment, has_limits: bool) -> Iterator[str]:
    one = entry.metrics["validation"]["one_step_ahead"]
    if _simulates(entry):
        yield "simulation from the inputs alone" + (", within the limits below" if has_limits else "")
    elif one.r2 >= _GOOD_R2:
        yield "prediction one step ahead"
    if entry.residual_structure.verdict == ADEQUATE:
        yield _describe_adequate_residual(entry.residual_structure)


def _describe_adequate_residual(structure: ResidualStructure) -> str:
    if not structure.free_run_share <= LARGEST_SHARE:
        return "the residual is a rounding error"
    return (
        f"no structure is left in the free-run residual (at most {100 * LARGEST_SHARE:.0f} % is predictable)"
    )


def _list_failures(found: SearchResult, entry: Assessment) -> Iterator[str]:
    errors = {part: entry.metrics[part]["free_run"] for part in ("estimation", "validation")}
    for check in _list_statements(entry):
        if not check.met:
            value = f"{check.value:.6g}" if isfinite(check.value) else "undefined"
            yield f"the constraint {named_statement(check.text, require_narx(entry.model))} (value {value})"
    if not isfinite(errors["validation"].rmse):
        yield "simulation from the inputs alone: the free run diverges"
    elif not _simulates(entry):
        yield f"simulation from the inputs alone: R2 {errors['validation'].r2:.3f}"
    yield from _list_physical_failures(found, entry)
    structure = entry.residual_structure
    if structure.verdict != ADEQUATE and isfinite(structure.percent):
        yield (
            f"{100 * structure.free_run_share:.0f} % of the free-run residual is predictable "
            f"(RMS {structure.percent:.2g} % of the output range)"
        )
    coverage = 1.0 if entry.bands is None or entry.bands.coverage is None else entry.bands.coverage
    if coverage < _LEAST_COVERAGE:
        yield (
            f"the {100 * LEVEL:g} % prediction band contains {100 * coverage:.0f} % of the validation samples"
        )
    if _generalises_poorly(found, entry):
        ratio = errors["validation"].rmse / errors["estimation"].rmse
        yield f"the free-run error on the validation data is {ratio:.2g} times that on the estimation data"
    for statement in describe_extrapolation(found.split):
        yield f"extrapolation: {statement}"


def _generalises_poorly(found: SearchResult, entry: Assessment) -> bool:
    """Return whether the error on the validation data is much larger than that on the estimation data."""
    estimation, validation = (entry.metrics[part]["free_run"].rmse for part in ("estimation", "validation"))
    visible = validation > _ROUNDING * found.record.output_range
    return visible and validation > _LARGE_RATIO * estimation > 0.0


def _list_physical_failures(found: SearchResult, entry: Assessment) -> Iterator[str]:
    """Yield what a model does at large or constant inputs, and whether its loops close."""
    physics = entry.physics
    diverging = [f"{test.name}" for test in physics.excursions if not test.bounded]
    if diverging:
        yield f"diverges at {', '.join(diverging)}"
    held = sum(not hold.bounded for hold in physics.holds)
    if held:
        yield f"diverges in {held} of {len(physics.holds)} holds of the inputs"
    for test in physics.extremes:
        if not test.plausible:
            inputs = _describe_level(found, entry, test.level)
            effect = (
                "diverges" if not test.bounded else f"leaves its recorded range by {test.ranges:.3g} ranges"
            )
            yield f"the output {effect} at {inputs} ({abs(test.level):g} of the recorded amplitude)"
    if found.requires_property_1 and not physics.property_1 and isfinite(physics.hold_drift_percent):
        yield f"the output drifts by {physics.hold_drift_percent:.3g} % of its range at constant input"
    opened = [test for test in physics.excursions if test.bounded and test.closure_percent > _OPEN_PERCENT]
    if found.claims_hysteresis and opened:
        worst = max(opened, key=lambda test: test.closure_percent)
        yield f"loops do not close at {worst.name}: {worst.closure_percent:.3g} % of the output range"


def _describe_level(found: SearchResult, entry: Assessment, level: float) -> str:
    """Return the values of the inputs at a level of the physics checks: ``u = -1 V, valve = 3``."""
    record = found.split.estimation
    low, high = record.u.min(axis=0), record.u.max(axis=0)
    values = (low + high) / 2 + level * (high - low) / 2
    parts = zip(signal_names(entry.model)[1:], values, record.input_units, strict=True)
    return ", ".join(f"{name} = {value:.4g} {unit}".rstrip() for name, value, unit in parts)


def _list_insignificant(entry: Assessment) -> list[str]:
    model = entry.model
    if model.standard_errors is None:
        return []
    values = zip(model.parameters, model.standard_errors, strict=True)
    return [
        term
        for term, (theta, error) in zip(model.equation().terms, values, strict=True)
        if abs(theta) < _SIGNIFICANT * error
    ]


def _list_next_steps(found: SearchResult, entry: Assessment) -> list[str]:
    steps = []
    structure = entry.residual_structure
    if structure.verdict != ADEQUATE:
        largest = max(found.models, key=lambda other: other.model.size).model.size
        if entry.model.size == largest and "max_terms" in found.settings:
            steps.append(f"allow more than {largest} terms")
        steps.append(_suggest_remedy(entry))
    if _generalises_poorly(found, entry) or describe_extrapolation(found.split):
        steps.append("estimate from a record that covers the amplitudes and rates of the validation data")
    weak = _list_insignificant(entry)
    if weak:
        more = f" (and of {len(weak) - 1} more)" if len(weak) > 1 else ""
        steps.append(
            f"try a longer record or a smaller model, since the parameter of {weak[0]}{more} is within "
            "two standard errors of zero"
        )
    unlikely = min(_list_doubtful(found, entry), key=lambda each: each[1], default=("", 1.0))
    if unlikely[1] < _UNLIKELY and not weak:
        steps.append(
            f"try a longer record, since models without {unlikely[0]} are about as good (probability of its "
            f"inclusion {_round_down(unlikely[1])})"
        )
    steps.append("check the model on a record that was not used (islands simulate)")
    return steps


def _suggest_remedy(entry: Assessment) -> str:
    if entry.residual_structure.one_step_share <= LARGEST_SHARE:
        return (
            "try an estimate that minimises the error of the free run (--estimator free-run), or measure the "
            "disturbance: one step ahead, no structure is left"
        )
    return f"try {_suggest_terms(entry)}"


def _suggest_terms(entry: Assessment) -> str:
    """Return the hint of the test with an input that exceeds its limit by most, or of the one without."""
    past, *tests = entry.residual_tests.tests
    # The residual of a slow record is correlated in time whatever term is missing.
    excess = [float(np.abs(test.values).max()) / test.limit for test in tests]
    worst = tests[int(np.argmax(excess))] if max(excess) > 1.0 else past
    name = "" if worst.input is None else signal_names(entry.model)[1 + worst.input]
    return _HINTS[worst.name].format(input=name)
