"""Documents of diagnoses with chosen quantities."""

from typing import Any

#: A cause of a discrepancy.
CAUSE = {
    "name": "delay",
    "family": "timing",
    "confidence": 0.98,
    "equivalents": [],
    "parameters": {"tau": {"value": 0.03, "unit": "s", "ci95": [0.02, 0.04]}},
    "score": 40.0,
    "eta": 0.995,
    "claimed": True,
    "free_form": False,
}

#: Errors of held-out data with and without a cause.
GAIN = {
    "before": {"rmse": 0.2, "mape": 12.0},
    "after": {"rmse": 0.011, "mape": 0.8},
    "noise_floor": {"rmse": 0.01, "mape": 0.7},
    "reduction_percent": 94.5,
    "ci95": [93.0, 96.0],
}


def make_document(verdict: str, **changes: Any) -> dict[str, Any]:
    """Return a ``discrepancy.json`` with a verdict and other entries."""
    names = {"inputs": ["force_N"], "output": "travel_um"}
    terms = {"equations": "output = y_sim + a1*u", "effects": [], "nearest": ["jump"], "worse_by": 30.0}
    return {
        "record": {"names": names, "units": {"inputs": ["N"], "output": "um"}, "dt": 0.01, "reading": []},
        "verdict": verdict,
        "discovered": terms if verdict == "discovered" else None,
        "effects": [],
        "gain": None if verdict in ("nothing", "noise", "unknown", "stopped", "gross error") else GAIN,
        "decisive_experiment": None,
        "candidates": [],
        "remainder": {},
        "proposal": None,
        "held_out_part": "the last quarter of the record",
        "output_std": 1.0,
        "as_given_rmse": 0.2,
        "calibrated_rmse": GAIN["before"]["rmse"] if verdict in ("named", "family") else 0.011,
        "noise_floor_rmse": 0.01,
        "noise_floor_is": "an upper bound",
        "noise_claim": {"rms": 0.0123, "correlation_time": 0.318, "noise_level": None},
        "record_findings": [],
        "left_out": [],
        **changes,
    }
