"""Diagnosis as a JSON document: ``discrepancy.json``."""

import json
from dataclasses import asdict
from typing import Any

import numpy as np

from islands.diagnosis.detectability import STRENGTHS, SelfTest
from islands.diagnosis.discovery.effect_shape import EffectShape
from islands.diagnosis.discovery.missing_terms import MISSING_TERM
from islands.diagnosis.findings import ResidualFormula
from islands.diagnosis.inference.exchanged_parts import ExchangedParts
from islands.diagnosis.inference.extension_trial import ExtensionTrial
from islands.diagnosis.inference.finding import Finding, Value, list_free_forms
from islands.diagnosis.inference.holdout import compute_rmse
from islands.diagnosis.planning.next_experiment import NextExperiment
from islands.diagnosis.result import CalibratedValue, Candidate, Diagnosis
from islands.effects.catalogue import find_entry, get_title
from islands.report.documents.extension import list_contradictions, write_extended_equations
from islands.report.documents.plan_json import describe_next_experiment, write_advice
from islands.report.documents.result_folder import list_failures, measure_left_out, record_document

#: Plain name of a missing term.
TERM_TITLE = "missing term"

SCHEMA = "islands.discrepancy/1"


def diagnosis_document(
    diagnosis: Diagnosis,
    wall_s: float | None = None,
    tested: SelfTest | None = None,
    proposal: ResidualFormula | None = None,
) -> dict[str, Any]:
    """Return a diagnosis as a JSON document.

    Parameters
    ----------
    wall_s : float, optional
        Wall-clock time of the diagnosis in seconds, measured by the caller.
    tested : SelfTest, optional
        Detection limits and false-alarm rate on this record.
    proposal : ResidualFormula, optional
        Formula of the unexplained residual.
    """
    return {
        "schema": SCHEMA,
        "record": record_document(diagnosis.record),
        "data": {"left_out": measure_left_out(diagnosis.record, lambda: diagnosis.best.output)},
        "simulation": diagnosis.base.simulation.simulator.name,
        "verdict": str(diagnosis.verdict),
        "discovered": None if diagnosis.discovery is None else asdict(diagnosis.discovery),
        "effects": [_describe_finding(finding) for finding in diagnosis.effects],
        "shape": None if diagnosis.shape is None else _describe_shape(diagnosis.shape),
        "gain": None if diagnosis.gain is None else asdict(diagnosis.gain),
        **_describe_experiment(diagnosis.next_experiment),
        "candidates": [_describe_candidate(each) for each in diagnosis.candidates],
        "titles": _list_titles(diagnosis, tested),
        "remainder": dict(diagnosis.residual_structure),
        "proposal": None if proposal is None else asdict(proposal),
        "estimation_samples": diagnosis.estimation_samples,
        "held_out_part": diagnosis.held_out_part,
        "is_time_left_out": diagnosis.is_time_left_out,
        "output_std": _measure_output(diagnosis),
        "as_given_rmse": diagnosis.nominal_rmse,
        "calibrated_rmse": _compute_calibrated_rmse(diagnosis),
        "noise_floor_rmse": diagnosis.noise_floor,
        "noise_floor_is": "measured by repeated periods"
        if diagnosis.is_noise_floor_measured
        else "an upper bound",
        "noise_claim": None if diagnosis.noise_claim is None else asdict(diagnosis.noise_claim),
        "calibrated": _get_calibrated_values(diagnosis),
        "values": [_describe_value(each) for each in diagnosis.values],
        "equations": diagnosis.best.simulation.simulator.equations,
        **_describe_self_test(tested),
        "extended_model": None if diagnosis.gain is None or diagnosis.refusal else "extended.json",
        "extension": None if diagnosis.trial is None else _describe_extension(diagnosis, diagnosis.trial),
        "exchange": None if diagnosis.exchange is None else _describe_exchange(diagnosis.exchange),
        "record_findings": [each.as_document() for each in diagnosis.record_findings],
        "left_out": list(diagnosis.left_out),
        "not_computed": list_failures(diagnosis.not_computed),
        "wall_s": wall_s,
    }


def as_json(document: dict[str, Any]) -> str:
    """Return the text of ``discrepancy.json``."""
    return json.dumps(document, indent=2, allow_nan=False) + "\n"


def _describe_experiment(experiment: NextExperiment | None) -> dict[str, Any]:
    if experiment is None:
        return {"decisive_experiment": None, "next_experiment": None}
    return {
        "decisive_experiment": write_advice(experiment) or None,
        "next_experiment": describe_next_experiment(experiment),
    }


def _list_titles(diagnosis: Diagnosis, tested: SelfTest | None) -> dict[str, str]:
    """Return the plain name of each cause, by its name, with the state or parameter that it acts on."""
    listed = [(each.name, each.place) for each in diagnosis.effects]
    listed += [(each.name, each.place) for each in diagnosis.candidates]
    names = [f"{name}:{place}" if place else name for name, place in listed]
    names += [name for each in diagnosis.effects for name in each.equivalents]
    if diagnosis.discovery is not None:
        names += [*diagnosis.discovery.effects, *diagnosis.discovery.nearest]
    if diagnosis.next_experiment is not None:
        names += [name for each in diagnosis.next_experiment.pairs for name in each.causes]
    names += [] if tested is None else tested.detection_limits
    titles = {name: TERM_TITLE if name == MISSING_TERM else get_title(name) for name in names}
    return {name: title for name, title in titles.items() if title}


def _describe_extension(diagnosis: Diagnosis, trial: ExtensionTrial) -> dict[str, Any]:
    written = write_extended_equations(diagnosis.best, diagnosis.effects, diagnosis.record)
    contradictions = list(list_contradictions(diagnosis.best))
    return {**asdict(trial), **written.as_document(), "contradictions": contradictions}


def _measure_output(diagnosis: Diagnosis) -> float:
    """Return the standard deviation of the measured output over the hold-out part."""
    return float(np.nanstd(diagnosis.record.y[diagnosis.estimation_samples :]))


def _compute_calibrated_rmse(diagnosis: Diagnosis) -> float:
    """Return the RMSE of the calibrated simulation without effects over the hold-out part."""
    residual = diagnosis.record.y - diagnosis.base.output
    return compute_rmse(residual[diagnosis.estimation_samples :])


def _get_calibrated_values(diagnosis: Diagnosis) -> dict[str, float]:
    fit = diagnosis.best
    part = fit.simulation.simulator_slice
    parameters = fit.simulation.parameters[part]
    return {each.name: float(value) for each, value in zip(parameters, fit.values[part], strict=True)}


def _describe_self_test(tested: SelfTest | None) -> dict[str, Any]:
    """Return the entries of a self-test; without one, all of them are None."""
    if tested is None:
        names = ("detection_limits", "tested_misfits", "false_alarm_rate", "p_value", "confusion")
        return dict.fromkeys(names)
    alarms = tested.false_alarm_rate
    return {
        "detection_limits": {
            name: None
            if limit is None
            else {"strength": limit.strength, "unit": limit.unit, "misfit_sigma": limit.misfit}
            for name, limit in tested.detection_limits.items()
        },
        "tested_misfits": list(STRENGTHS),
        "false_alarm_rate": {"value": alarms.value, "ci95": list(alarms.ci95), "of": alarms.trials},
        "p_value": tested.p_value,
        "confusion": [
            {"hidden": hidden, "called": called, "times": times}
            for (hidden, called), times in tested.confusion.items()
        ],
    }


def _describe_finding(finding: Finding) -> dict[str, Any]:
    entry = find_entry(finding.name)
    return {
        "name": finding.name,
        "place": finding.place,
        "family": finding.family,
        "summary": finding.summary if entry is None else entry.summary,
        "distinguished_by": "" if entry is None else entry.distinguished_by,
        "occurs_in": "" if entry is None else entry.occurs_in,
        "confidence": finding.confidence,
        "equivalents": list(finding.equivalents),
        "parameters": {name: _describe_estimate(each) for name, each in finding.parameters.items()},
        "score": finding.score,
        "eta": finding.explained_fraction,
        "error_share": finding.error_fraction,
        "noise_share": finding.noise_fraction,
        "term": finding.term,
        "depends_on_time": finding.depends_on_time,
        "claimed": finding.is_claimed,
        "free_form": bool(list_free_forms([finding])),
        "resembles": None if finding.resembles is None else asdict(finding.resembles),
    }


def _describe_estimate(estimate: Value) -> dict[str, Any]:
    interval = None if estimate.ci95 is None else list(estimate.ci95)
    return {"value": estimate.value, "unit": estimate.unit, "ci95": interval}


def _describe_value(each: CalibratedValue) -> dict[str, Any]:
    return {
        "name": each.name,
        "before": each.before,
        "alone": each.alone,
        **_describe_estimate(each.estimate),
    }


def _describe_exchange(exchange: ExchangedParts) -> dict[str, Any]:
    values = [{**asdict(each), "agrees": each.agrees} for each in exchange.values]
    return {"gain": None if exchange.gain is None else asdict(exchange.gain), "values": values}


def _describe_shape(shape: EffectShape) -> dict[str, Any]:
    return {
        name: value if isinstance(value, str) else value.tolist() for name, value in asdict(shape).items()
    }


def _describe_candidate(candidate: Candidate) -> dict[str, Any]:
    return {
        "name": candidate.name,
        "place": candidate.place,
        "score": candidate.score,
        "eta": candidate.explained_fraction,
    }
