"""The Bouc-Wen piezoelectric actuator of the paper's equation (11), with places for effects."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from islands.discrepancy.core import Forces, add_forces
from islands.discrepancy.effect import Scene, Signal, Site
from islands.discrepancy.effects.changes import after
from islands.discrepancy.parameter import Parameter
from islands.kernels.hysteresis import bouc_wen
from islands.systems.bouc_wen import BoucWenPiezo


@dataclass(frozen=True, slots=True)
class BoucWenPiezoCore:
    """``y = dp x - h + forces``, ``h' = A x' - beta |x'| h - gamma x' |h|``; the coordinate is the voltage.

    Attributes
    ----------
    piezo : BoucWenPiezo
        Nominal parameters; by default the paper's.
    """

    piezo: BoucWenPiezo = field(default_factory=BoucWenPiezo)
    name: str = "bouc-wen-piezo"
    sites: frozenset[Site] = frozenset(Site)
    understood: frozenset[str] = frozenset(
        ("relaxation", "rate-dependent-loop", "loop-asymmetry", "gain-step", "ageing")
    )

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """A, beta, gamma, dp: a fifth to five times what they are nominally."""
        return tuple(
            Parameter(name, unit, nominal, part * abs(nominal), *sorted((0.2 * nominal, 5.0 * nominal)))
            for name, unit, nominal, part in (
                ("A", "um/V", self.piezo.A, 0.01),
                ("beta", "1/V", self.piezo.beta, 0.03),
                ("gamma", "1/V", self.piezo.gamma, 0.03),
                ("dp", "um/V", self.piezo.dp, 0.005),
            )
        )

    def simulate(
        self, values: Signal, x: Signal, scene: Scene, own: Mapping[str, float], forces: Forces
    ) -> Signal:
        """See `islands.discrepancy.core.Core`."""
        A, beta, gamma, dp = values
        h = np.empty_like(x)
        bouc_wen(
            np.ascontiguousarray(x),
            *(scene.dt, A, beta, gamma),
            *(
                own.get("relaxation", 0.0),
                own.get("rate-dependent-loop", 0.0),
                own.get("loop-asymmetry", 0.0),
            ),
            *(0.0, h),
        )
        gain = dp
        if "gain-step" in own:
            gain = gain * (1.0 + own["gain-step"] * after(scene, own["gain-step instant"]))
        if "ageing" in own:
            gain = gain * (1.0 + own["ageing"] * scene.time / scene.duration)
        return add_forces(gain * x - h, x, scene, forces)
