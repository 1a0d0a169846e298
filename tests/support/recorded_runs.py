"""Recorded runs of `lab/searches/phase_shares.py`, replayed through the estimate of the time left."""

import json
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

from islands.diagnosis.procedure import LEAST_FRACTION, PHASES
from islands.evolution.archipelago import empty_archipelago
from islands.evolution.presets import AUTO, resolve_settings
from islands.evolution.search_state import HistoryPoint, SearchState
from islands.facade.explain_residual import BEFORE_FORMULA, BEFORE_REPORT, FORMULA
from islands.facade.identification_progress import IdentificationProgress
from islands.progress import MIN_FRACTION, PhasedProgress, TimeLeft, report_part

RECORDED = Path(__file__).parent / "recorded_progress"

#: Number of equal intervals of a run at whose ends it is observed.
MOMENTS = 200


class Moment(NamedTuple):
    """What a bar shows after some seconds: fraction, time left or None; and the true time left."""

    seconds: float
    fraction: float
    left: float | None
    truth: float


def replay(name: str) -> list[Moment]:
    """Return what a bar shows at equally spaced moments of a recorded run."""
    document = json.loads((RECORDED / f"{name}.json").read_text())
    rows = document["rows"]
    began, whole = rows[0][0], rows[-1][0] - rows[0][0]
    bar = (_Diagnosis if document["kind"] == "diagnosis" else _Identification)(document)
    moments = iter([whole * k / MOMENTS for k in range(1, MOMENTS)])
    moment, found = next(moments), []
    for at, *row in rows:
        while moment is not None and moment < at - began:
            found.append(Moment(moment, bar.fraction, bar.left.at(moment), whole - moment))
            moment = next(moments, None)
        bar.now = at - began
        bar.report(*row)
    return found


def find_quarters(moments: list[Moment]) -> list[float]:
    """Return the fractions at the ends of the quarters of a run."""
    return [moments[len(moments) * quarter // 4 - 1].fraction for quarter in (1, 2, 3, 4)]


def find_standstills(moments: list[Moment]) -> list[Moment]:
    """Return the moments whose time left is that of the next one."""
    return [one for one, other in pairwise(moments) if one.left is not None and one.left == other.left]


class _Bar:
    def __init__(self, least: float) -> None:
        self.now, self.fraction, self.left = 0.0, 0.0, TimeLeft(0.0, least)

    def show(self, _message: str, fraction: float | None = None, /) -> None:
        assert fraction is not None
        self.fraction = fraction
        self.left.update(fraction, self.now)


class _Identification(_Bar):
    """The bar of `islands identify`."""

    def __init__(self, document: dict[str, Any]) -> None:
        super().__init__(MIN_FRACTION)
        sizes = {name: document[name] for name in ("population", "islands", "generations")}
        preset, self._settings = document["preset"], resolve_settings("narx", sizes)
        assert preset in (AUTO, "narx")
        about = document["samples"], self._settings, document.get("outputs", ())
        self._progress = IdentificationProgress(self.show, preset, *about)
        self._began = 0.0

    def report(self, name: str, value: float | None) -> None:
        if name == "end":
            return
        if name != "epoch":
            self._progress(name, value)
            return
        self._began = self.now if value == 0 else self._began
        per_generation = self._settings.population * self._settings.islands
        rate = value * per_generation / max(self.now - self._began, 1e-9)
        state = SearchState(empty_archipelago(1, 0), history=(HistoryPoint(int(value), 0, {1: 1.0}, (1.0,)),))
        left = self._progress.report_epoch(state, self._settings, rate)
        if left is not None:
            self.left.expect(left, self.now)


class _Diagnosis(_Bar):
    """The bar of `islands diagnose`."""

    def __init__(self, _document: dict[str, Any]) -> None:
        super().__init__(LEAST_FRACTION * BEFORE_FORMULA)
        self._progress = PhasedProgress(report_part(self.show, 0.0, BEFORE_FORMULA), PHASES)
        self._map = self._progress.count(map)

    def report(self, name: str, _value: float | None) -> None:
        match name:
            case "map":
                list(self._map(abs, [0]))
            case "report":
                self.show(name, BEFORE_REPORT)
            case _ if name == FORMULA:
                self.show(name, BEFORE_FORMULA)
            case "epoch" | "end":
                pass
            case _:
                self._progress(name)


def late(moments: list[Moment]) -> Iterator[Moment]:
    """Yield the moments from a fifth of a run on."""
    return (each for each in moments if each.seconds >= 0.2 * (each.seconds + each.truth))
