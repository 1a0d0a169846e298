"""Picture of the guide to diagnoses: an oscillator with five hidden differences, and what is said of each.

``python docs/_scripts/verdicts.py`` draws ``docs/pictures/verdicts.svg`` again.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

import islands
from islands.report.figures.style import (
    FRAME,
    MEASURED,
    RESIDUAL,
    SHADE,
    SIMULATED,
    SIMULATED_WIDTH,
    blank,
    finish,
    house_style,
    save,
)
from islands.simulators.ode.system import OdeParameter
from islands.simulators.specification.equations import OdeSpec

PICTURE = Path(__file__).parents[1] / "pictures" / "verdicts.svg"

#: Sampling time in seconds, samples of the records, standard deviation of the noise in m.
DT, SAMPLES, NOISE = 0.01, 3000, 0.002

#: Samples that are shown.
SHOWN = slice(900, 1300)

OSCILLATOR = OdeSpec.model_validate(
    {
        "kind": "ode",
        "name": "oscillator",
        "input": "F",
        "output": "x",
        "equations": "dx/dt = v\ndv/dt = (F - c*v - k*x - force)/m\n",
        "parameters": {
            "m": {"value": 1.0, "unit": "kg"},
            "c": {"value": 2.0, "unit": "N s/m"},
            "k": {"value": 100.0, "unit": "N/m"},
        },
        "states": {"x": {"unit": "m", "initial": 0.0}, "v": {"unit": "m/s", "initial": 0.0}},
        "force": {"coordinate": "x", "rate": "v"},
    }
)


def make_input() -> np.ndarray:
    """Return a multisine from 0.2 to 3 Hz that starts from rest, in N."""
    rng = np.random.default_rng(7)
    time = DT * np.arange(SAMPLES)
    phases = 2 * np.pi * np.outer(time, rng.uniform(0.2, 3.0, 12)) + rng.uniform(0.0, 6.3, 12)
    return np.minimum(1.0, time) * 12.0 * np.sin(phases).sum(axis=1)


def simulate(u: np.ndarray, term: str = "", value: float = 0.0) -> np.ndarray:
    """Simulate the oscillator, with a further term in its acceleration."""
    system = OSCILLATOR.make_system()
    if term:
        system = system.with_term("v", f"hidden*({term})", [OdeParameter("hidden", value)])
    record = islands.Dataset(
        u, np.zeros(SAMPLES), DT, ("F_N",), output_name="x_m", input_units=("N",), output_unit="m"
    )
    return islands.simulate(OdeSpec.from_system(system), record).y


def shift(u: np.ndarray, seconds: float) -> np.ndarray:
    """Delay a signal."""
    time = DT * np.arange(SAMPLES)
    return np.interp(time - seconds, time, u)


def shape(y: np.ndarray) -> np.ndarray:
    """Return the error of a sensor with an irregular characteristic, in m."""
    place = y / np.max(np.abs(y))
    return 0.015 * np.cos(np.pi * place / 2) ** 8 * np.sign(place + 0.3) + 0.01 * np.sin(2 * np.pi * place)


#: Hidden differences: the measured output without noise, of the input.
HIDDEN: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "nothing hidden": simulate,
    "hidden: a delay of 20 ms": lambda u: simulate(shift(u, 0.02)),
    "hidden: damping that grows with x^2": lambda u: simulate(u, "x**2*v", -40.0),
    "hidden: an irregular sensor": lambda u: simulate(u) + shape(simulate(u)),
    "hidden: a random force": lambda u: simulate(u + 0.5 * np.random.default_rng(3).standard_normal(SAMPLES)),
}


def draw(axes: Axes, hidden: str) -> None:
    """Diagnose a record, and draw the residuals before and after."""
    u = make_input()
    y = HIDDEN[hidden](u) + NOISE * np.random.default_rng(1).standard_normal(SAMPLES)
    record = islands.Dataset(u, y, DT, ("F_N",), output_name="x_m", input_units=("N",), output_unit="m")
    found = islands.diagnose(record, OSCILLATOR)
    names = ", ".join(each.name for each in found.effects if each.explained_fraction is not None)
    if found.discovery is not None:
        names = found.discovery.equations.rpartition(" + ")[2]
    time = record.time[SHOWN]
    axes.axhspan(-2e3 * NOISE, 2e3 * NOISE, color=SHADE, zorder=0.5)
    axes.plot(
        time, 1e3 * (record.y - found.base.output)[SHOWN], color=SIMULATED, lw=SIMULATED_WIDTH, label="before"
    )
    if found.best is not found.base:
        axes.plot(
            time,
            1e3 * (record.y - found.best.output)[SHOWN],
            color=RESIDUAL,
            lw=SIMULATED_WIDTH,
            label="after",
        )
    axes.set_title(
        f"{hidden}; verdict: {found.verdict}" + (f", {names}" if names else ""), fontsize=8.0, color=MEASURED
    )
    axes.set_xlim(float(time[0]), float(time[-1]))
    axes.axhline(0.0, color=FRAME, lw=0.6, zorder=1)
    print(hidden, found.verdict, names, found.gain, sep="; ")


@house_style()
def draw_verdicts() -> None:
    """Draw and save the picture."""
    figure = blank(7.2, "")
    panels = figure.subplots(len(HIDDEN), 1, sharex=True)
    for axes, hidden in zip(panels, HIDDEN, strict=True):
        draw(axes, hidden)
    panels[2].set_ylabel("residual (mm); grey: two standard deviations of the noise")
    panels[1].legend(loc="upper right", ncols=2, fontsize=7.0)
    panels[-1].set_xlabel("time (s)")
    save(finish(figure), PICTURE)


if __name__ == "__main__":
    draw_verdicts()
