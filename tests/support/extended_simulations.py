"""Extended simulations with chosen effects."""

from collections.abc import Mapping
from typing import Any

from islands.simulators.specification.table import LocalExtendedSpec
from support.simulated_records import DT

Document = Mapping[str, Any]


def extended(core: Document, effects: Mapping[str, Document], **further: Any) -> LocalExtendedSpec:
    """Return a simulation ``core`` with effects, given as the values of their parameters by name."""
    frame = {
        "unit": "V",
        "peak": 1,
        "rate": 1,
        "force_unit": "um",
        "force": 1,
        "sense": 1,
        "dissipates": True,
    }
    scales = {"dt": DT, "input_peak": 2.0, "output_peak": 5.0, "fitted_s": 4.5, "duration_s": 6.0}
    return LocalExtendedSpec.model_validate(
        {
            "inputs": ["u_V"],
            "output": "y_um",
            "core": core,
            "effects": [
                {"name": name, "parameters": {key: {"value": value} for key, value in values.items()}}
                for name, values in effects.items()
            ],
            "scales": {**scales, "frame": {**frame, "sharp": 1}},
            **further,
        }
    )
