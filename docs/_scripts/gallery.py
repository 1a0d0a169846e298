"""Picture of the README: the four example records, the equations found in them, and their free runs.

``command_outputs.py`` draws it from the results of the commands of the README.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

import islands
from islands.records.split import split
from islands.report.figures.style import (
    MEASURED,
    MEASURED_WIDTH,
    SIMULATED,
    SIMULATED_WIDTH,
    blank,
    finish,
    house_style,
    label,
    save,
)
from islands.systems.example_records import EXAMPLE_RECORDS

PICTURE = Path(__file__).parents[1] / "pictures" / "gallery.svg"

#: Samples of each record that are shown.
SHOWN = 150


def draw(axes: Axes, name: str, result: islands.Result) -> None:
    """Draw the first part of the validation data, and the free run of the recommended model."""
    record = EXAMPLE_RECORDS[name].make()
    validation = split(record).validation
    best = result.best
    run = best.simulate(validation).y[:SHOWN]
    time, measured = validation.time[:SHOWN], validation.y[:SHOWN]
    axes.plot(time, measured, color=MEASURED, lw=MEASURED_WIDTH, label="measured")
    axes.plot(time, run, color=SIMULATED, lw=2 * SIMULATED_WIDTH, label="simulated")
    error = best.metrics["validation"]["free_run"].mape
    model = best.model
    size = f"{model.size} terms" if isinstance(model, islands.Model) else f"order {best.linearise().order}"
    axes.set_title(f"{name}: {size}, free-run error {error:.2g} % of the range", fontsize=8.0)
    axes.set_ylabel(label(record.output_name, record.output_unit))
    axes.set_xlim(float(np.min(time)), float(np.max(time)))
    axes.set_xlabel("time (s)")


@house_style()
def draw_gallery(results: Mapping[str, islands.Result]) -> None:
    """Draw and save the picture of the results of all example records, by name."""
    figure = blank(4.4, "")
    places = figure.subplots(2, 2)
    for axes, name in zip(places.flat, EXAMPLE_RECORDS, strict=True):
        draw(axes, name, results[name])
    places[0, 0].legend(fontsize=7.0, loc="lower right")
    save(finish(figure), PICTURE)
