"""Picture of the guide to plans: strengths from which causes of a motor's errors are separable.

``python docs/_scripts/separability.py`` draws ``docs/pictures/separability.svg`` again.
"""

from pathlib import Path

import numpy as np

import islands
from islands.report.figures.separability import draw_separability
from islands.report.figures.style import save
from islands.systems.signals import sine

ROOT = Path(__file__).parents[2]

PICTURE = ROOT / "docs" / "pictures" / "separability.svg"


def draw() -> None:
    """Plan with a slow sine, and save the matrix."""
    u = sine(0.004, 8.0, 6.0, 0.5)
    record = islands.Dataset(u, np.full(u.size, np.nan), 0.004, ("u_V",), "omega_rad_s")
    simulation = f"ode:{ROOT / 'examples' / 'simulations' / 'dc-motor.toml'}"
    plan = islands.plan_experiment(record, simulation, noise_std=0.5, separate=("delay", "sensor-lag"))
    save(draw_separability(plan.isolability), PICTURE)
    print(plan.decisive)


if __name__ == "__main__":
    draw()
