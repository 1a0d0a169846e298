"""A diagnosis as a document: ``discrepancy.json``, and the extended simulation."""

import json
from dataclasses import asdict
from typing import Any

from islands.discrepancy.detectability import SelfTest
from islands.discrepancy.diagnosis import Candidate, Diagnosis, ResidualFormula
from islands.discrepancy.inference.verdict import Finding
from islands.io.result_folder import record_document

SCHEMA = "islands.discrepancy/1"


def diagnosis_document(
    diagnosis: Diagnosis,
    wall_s: float | None = None,
    tested: SelfTest | None = None,
    proposal: ResidualFormula | None = None,
) -> dict[str, Any]:
    """Describe a diagnosis.

    Parameters
    ----------
    wall_s : float, optional
        Seconds that it took; the core knows no clock.
    tested : SelfTest, optional
        What the analysis can do on this record.
    proposal : ResidualFormula, optional
        A formula for what has no name.
    """
    return {
        "schema": SCHEMA,
        "record": record_document(diagnosis.record),
        "simulation": diagnosis.base.simulation.simulator.name,
        "verdict": str(diagnosis.verdict),
        "effects": [_effect(finding) for finding in diagnosis.effects],
        "gain": None if diagnosis.gain is None else asdict(diagnosis.gain),
        "decisive_experiment": diagnosis.suggested_experiment or None,
        "candidates": [_candidate(each) for each in diagnosis.candidates],
        "remainder": dict(diagnosis.residual_structure),
        "proposal": None if proposal is None else asdict(proposal),
        "as_given_rmse": diagnosis.nominal_rmse,
        "noise_floor_rmse": diagnosis.noise_floor,
        "noise_floor_is": "measured by repeated periods"
        if diagnosis.is_noise_floor_measured
        else "an upper bound",
        "calibrated": _values(diagnosis),
        **_self_test(tested),
        "extended_model": None if diagnosis.gain is None else "extended.json",
        "wall_s": wall_s,
    }


def as_json(document: dict[str, Any]) -> str:
    """Write ``discrepancy.json``."""
    return json.dumps(document, indent=2, allow_nan=False) + "\n"


def _values(diagnosis: Diagnosis) -> dict[str, float]:
    fit = diagnosis.best
    own = fit.simulation.simulator.parameters
    return {parameter.name: float(value) for parameter, value in zip(own, fit.values, strict=False)}


def _self_test(tested: SelfTest | None) -> dict[str, Any]:
    """Describe a self-test; without one its names are there, and nothing in them."""
    if tested is None:
        return dict.fromkeys(("detection_limits", "false_alarm_rate", "p_value", "confusion"))
    alarms = tested.false_alarm_rate
    return {
        "detection_limits": {
            name: None
            if limit is None
            else {"strength": limit.strength, "unit": limit.unit, "misfit_sigma": limit.misfit}
            for name, limit in tested.detection_limits.items()
        },
        "false_alarm_rate": {"value": alarms.value, "ci95": list(alarms.ci95), "of": alarms.trials},
        "p_value": tested.p_value,
        "confusion": [
            {"hidden": hidden, "called": called, "times": times}
            for (hidden, called), times in tested.confusion.items()
        ],
    }


def _effect(finding: Finding) -> dict[str, Any]:
    return {
        "name": finding.name,
        "family": finding.family,
        "confidence": finding.confidence,
        "equivalents": list(finding.equivalents),
        "parameters": {
            name: {
                "value": each.value,
                "unit": each.unit,
                "ci95": None if each.ci95 is None else list(each.ci95),
            }
            for name, each in finding.parameters.items()
        },
        "score": finding.score,
        "eta": finding.explained_fraction,
    }


def _candidate(candidate: Candidate) -> dict[str, Any]:
    return {"name": candidate.name, "score": candidate.score, "eta": candidate.explained_fraction}
