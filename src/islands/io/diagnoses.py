"""A diagnosis as a document: ``discrepancy.json``, and the extended simulation."""

import json
from dataclasses import asdict
from typing import Any

from islands.discrepancy.decision import Finding
from islands.discrepancy.diagnosis import Diagnosis
from islands.io.results import record_document

SCHEMA = "islands.discrepancy/1"

EXTENDED_SCHEMA = "islands.extended/1"


def diagnosis_document(diagnosis: Diagnosis, wall_s: float | None = None) -> dict[str, Any]:
    """Describe a diagnosis.

    Parameters
    ----------
    wall_s : float, optional
        Seconds that it took; the core knows no clock.
    """
    return {
        "schema": SCHEMA,
        "record": record_document(diagnosis.record),
        "simulation": diagnosis.base.simulation.core.name,
        "verdict": str(diagnosis.verdict),
        "effects": [_effect(finding) for finding in diagnosis.effects],
        "gain": None if diagnosis.gain is None else asdict(diagnosis.gain),
        "decisive_experiment": diagnosis.decisive_experiment or None,
        "candidates": [asdict(candidate) for candidate in diagnosis.candidates],
        "remainder": dict(diagnosis.remainder),
        "as_given_rmse": diagnosis.as_given,
        "noise_floor_rmse": diagnosis.noise_floor,
        "calibrated": _values(diagnosis),
        "detection_limits": {},
        "false_alarm_rate": None,
        "extended_model": None if diagnosis.gain is None else "extended.json",
        "wall_s": wall_s,
    }


def diagnosis_json(diagnosis: Diagnosis, wall_s: float | None = None) -> str:
    """Write ``discrepancy.json``."""
    return json.dumps(diagnosis_document(diagnosis, wall_s), indent=2, allow_nan=False) + "\n"


def extended_json(diagnosis: Diagnosis) -> str:
    """Write the extended simulation: its core, its effects and the values of both."""
    fit = diagnosis.best
    simulation = fit.simulation
    document = {
        "schema": EXTENDED_SCHEMA,
        "core": simulation.core.name,
        "parameters": _values(diagnosis),
        "effects": [
            {
                "name": effect.name,
                "site": str(effect.site),
                "parameters": {
                    parameter.name: {"value": float(value), "unit": parameter.unit}
                    for parameter, value in zip(
                        simulation.parameters[simulation.part(effect)],
                        fit.values[simulation.part(effect)],
                        strict=True,
                    )
                },
            }
            for effect in simulation.effects
        ],
        "scales": {
            "dt": simulation.scene.dt,
            "input_peak": simulation.scene.input_peak,
            "output_peak": simulation.scene.output_peak,
            "fitted_s": simulation.scene.fitted,
            "duration_s": simulation.scene.duration,
        },
    }
    return json.dumps(document, indent=2, allow_nan=False) + "\n"


def _values(diagnosis: Diagnosis) -> dict[str, float]:
    fit = diagnosis.best
    own = fit.simulation.core.parameters
    return {parameter.name: float(value) for parameter, value in zip(own, fit.values, strict=False)}


def _effect(finding: Finding) -> dict[str, Any]:
    return {
        **asdict(finding),
        "equivalents": list(finding.equivalents),
        "parameters": {
            name: {
                "value": each.value,
                "unit": each.unit,
                "ci95": None if each.ci95 is None else list(each.ci95),
            }
            for name, each in finding.parameters.items()
        },
    }
