"""Results of many kinds of records, and every text that states something about them."""

import re
import tempfile
from collections.abc import Callable, Mapping
from functools import partial
from html import unescape
from pathlib import Path

import numpy as np

import islands
from islands.facade.results.complete_diagnosis import DiagnosisResult
from islands.facade.results.notebook_html import render_sentences
from islands.facade.results.saved_simulation import SavedDiagnosis
from islands.records.dataset import Dataset
from islands.report.documents.result_folder import result_document
from islands.report.pages.identification import identification_report
from islands.report.pages.origin import Origin
from support.coupled_systems import PREY, TWO_MASSES, make_coupled_record
from support.diagnosed_records import MEASURED_OUTPUTS, OTHERS, diagnose_difference
from support.laws import LAWS
from support.measured_portfolio import MEASURED
from support.portfolio_records import KINDS

AnyResult = islands.Result | DiagnosisResult

#: Settings of a fit that takes less than a second.
QUICK = {"library": "polynomial", "degree": 2, "lags": 3, "max_terms": 6, "certificate": 0, "average": 1}


#: Noise of the laws, as a fraction of the standard deviation of the output.
LEVELS = (0.0, 0.003, 0.05)


def make_first_order(fault: str, seed: int) -> Dataset:
    """Return a record of y(k) = 0.9 y(k-1) + 0.2 u(k-1) with a fault of the record or of the system."""
    rng = np.random.default_rng(seed)
    samples = {"short": 60, "very short": 40}.get(fault, 1200)
    u, y = rng.uniform(-1.0, 1.0, samples), np.zeros(samples)
    if fault == "slow input":
        u = np.repeat(u, 40)[:samples]
    if fault == "extrapolation":
        u[-samples // 4 :] *= 3.0
    pole = {"integrator": 1.0, "unstable": 1.001, "oscillation": -0.95}.get(fault, 0.9)
    for k in range(1, samples):
        feedback = pole * y[k - 1] * (1.0 - 0.3 * u[k - 1] if fault == "bilinear" else 1.0)
        y[k] = feedback + 0.2 * u[k - 1]
    if fault == "drift":
        y += np.linspace(0.0, 3.0, samples)
    if fault == "jump":
        y[-samples // 5 :] += 1.0
    noise = {"noise alone": 5.0, "much noise": 0.3, "no noise": 0.0}.get(fault, 0.02)
    y += noise * rng.standard_normal(samples)
    if fault in ("sentinels", "spikes"):
        y[[100, 500, 1000]] = -9999.0 if fault == "sentinels" else 12.0
    if fault == "stuck":
        y[300:600] = y[300]
    if fault == "clipped":
        y = np.clip(y, -0.2, 0.4)
    if fault == "coarse":
        y = np.round(y, 1)
    return Dataset(u, y, 0.1, ("valve",), "level_cm", output_unit="cm")


#: Faults of `make_first_order`.
FAULTS = (
    *("none", "sentinels", "spikes", "stuck", "clipped", "coarse", "short", "very short", "extrapolation"),
    *("integrator", "unstable", "oscillation", "bilinear", "drift", "jump", "slow input", "noise alone"),
    *("much noise", "no noise"),
)


def make_cases() -> dict[str, Callable[[], AnyResult]]:
    """Return the functions that make the results, by name."""
    cases: dict[str, Callable[[], AnyResult]] = {}
    for name, kind in KINDS.items():
        cases[f"portfolio, {name}"] = lambda kind=kind: islands.fit(kind.record(0)[0])
        cases[f"diagnosis, portfolio, {name}"] = lambda kind=kind: _diagnose(kind.record(0)[0])
    for name in MEASURED_OUTPUTS:
        for seed in range(2):
            cases[f"diagnosis, column, {name}, seed {seed}"] = partial(diagnose_difference, name, seed)
        cases[f"diagnosis, linear, {name}"] = partial(diagnose_difference, name, 2, "linear:2")
    cases |= {f"diagnosis, {name}": make for name, make in OTHERS.items()}
    for name, law in LAWS.items():
        for level in LEVELS:
            make = partial(law.record, 800, level, 0)
            cases[f"law, {name}, noise {level:g}"] = lambda make=make: islands.fit(make(), **QUICK)
    for fault in FAULTS:
        for seed in range(3):
            record = partial(make_first_order, fault, seed)
            settings = {} if seed == 0 else QUICK
            cases[f"first order, {fault}, seed {seed}"] = lambda record=record, settings=settings: (
                islands.fit(record(), **settings)
            )
    for name, system in {"two masses": TWO_MASSES, "prey": PREY}.items():
        for noise in (0.0, 0.02, 0.2):
            for samples in (120, 400):
                make = partial(make_coupled_record, system, samples, noise)
                cases[f"several outputs, {name}, noise {noise:g}, {samples}"] = lambda make=make: islands.fit(
                    make(), library="polynomial", degree=2, lags=2, certificate=0
                )
    for name, read in MEASURED.items():
        cases[f"measured, {name}"] = lambda read=read: islands.fit(_shorten(read()[0]))
    return cases


def _shorten(record: Dataset) -> Dataset:
    return record[: min(record.samples, 4000)]


def _diagnose(record: Dataset) -> DiagnosisResult:
    return islands.diagnose(record[: min(record.samples, 800)].first_inputs(1), "linear:1")


def list_texts(name: str, result: AnyResult) -> Mapping[str, str]:
    """Return every text about a result, by where a reader meets it."""
    if isinstance(result, DiagnosisResult):
        return _list_texts_of_diagnosis(name, result)
    with tempfile.TemporaryDirectory() as folder:
        result.save(folder, figures=())
        (Path(folder) / "summary.txt").unlink()
        stored = islands.load(folder)
        read, notebook = str(stored), stored._repr_html_()
    if read != str(result):
        raise AssertionError(f"{name}: the folder states something else than the run")
    found = result.search_result
    equation = found.recommended.model.equation().mathml
    report = identification_report(Origin(name), result_document(found), equation, {}).decode()
    return {"summary": read, "notebook": notebook, "report": report}


def _list_texts_of_diagnosis(name: str, result: DiagnosisResult) -> Mapping[str, str]:
    with tempfile.TemporaryDirectory() as folder:
        report = (result.save(folder, name) / "report.html").read_text()
        stored = islands.load(folder)
    if not isinstance(stored, SavedDiagnosis) or stored.summary != result.summary:
        raise AssertionError(f"{name}: the folder states something else than the run")
    shown = unescape(re.sub("</?code>", "`", report))
    # The report has the equations as MathML.
    lines = [line for line in result.summary.splitlines() if not line.startswith("Extended simulation:")]
    if missing := [line for line in lines if line.strip() not in shown]:
        raise AssertionError(f"{name}: the report lacks {missing}")
    notebook = render_sentences(stored.summary.splitlines(), None, "")
    return {"summary": result.summary, "notebook": unescape(notebook), "report": shown}
