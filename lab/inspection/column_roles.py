"""Choice of inputs and outputs by `islands inspect`: how often it is right, and how true its probability is.

    python -m lab.inspection.column_roles [--count N] [--first SEED] [--fit]

Columns have random order and names that say nothing. The weights of
`islands.records.inspection.column_direction` are estimated on the systems "calibration"; "test" has other
systems of the same kinds with other seeds, "loggers" files with many columns, and "portfolio" the records
and laws that test `--library auto`. With
ISLANDS_MEASURED_DIR, "measured" has measured records. A choice is right if the output and all inputs are. The
expected calibration error is the mean difference of the stated probability and the frequency of right choices
in ten classes of probability. With ``--fit`` the
weights are estimated and printed.
"""

import argparse
import csv
import os
from collections import defaultdict
from collections.abc import Iterator, Sequence
from itertools import chain
from pathlib import Path

for library in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(library, "1")

import numpy as np  # noqa: E402 - after the environment is set
from scipy.optimize import minimize  # noqa: E402

from islands.records.dataset import Dataset  # noqa: E402
from islands.records.inspection import column_roles  # noqa: E402
from islands.records.inspection.column_direction import WEIGHTS, estimate_direction, measure_properties  # noqa: E402
from support.laws import LAWS  # noqa: E402
from support.portfolio_records import KINDS  # noqa: E402
from support.role_records import RoleRecord, Roles, make_logs, make_records, rename, roles  # noqa: E402

#: Classes of probability of the expected calibration error.
CLASSES = 10

#: Penalty of the squared weights, relative to the mean loss, in standard deviations of the properties.
PENALTY = 3e-3


def calibration_error(probabilities: Sequence[float], right: Sequence[bool]) -> float:
    """Return the expected calibration error."""
    stated, is_right = np.array(probabilities), np.array(right, dtype=float)
    place = np.minimum((CLASSES * stated).astype(int), CLASSES - 1)
    classes = [place == each for each in range(CLASSES) if (place == each).any()]
    return float(sum(abs(stated[each].sum() - is_right[each].sum()) for each in classes) / stated.size)


def rename_dataset(kind: str, record: Dataset, seed: int) -> RoleRecord:
    """Return a record of a data set without its names."""
    columns = {name: record.u[:, place] for place, name in enumerate(record.input_names)}
    answer = roles(record.output_name, " ".join(record.input_names))
    return rename(kind, columns | {record.output_name: record.y}, (answer,), np.random.default_rng(seed))


def make_portfolio(count: int, first: int) -> Iterator[RoleRecord]:
    """Return the records of the portfolio and of the laws."""
    for seed in range(first, first + count):
        for name, kind in KINDS.items():
            yield rename_dataset(f"portfolio: {name}", kind.record(seed)[0], seed)
        for name, law in LAWS.items():
            yield rename_dataset(f"law: {name}", law.record(1500, 0.02, seed), seed)


def read_columns(file: Path) -> dict[str, np.ndarray]:
    """Return the columns of numbers of a file, without the time."""
    with file.open(newline="") as lines:
        names, *rows = csv.reader(lines)
    found = {}
    for place, name in enumerate(names):
        try:
            values = np.array([float(row[place]) for row in rows])
        except ValueError:
            continue
        if name != "t_s":
            found[name] = values
    return found


def read_measured(folder: Path) -> Iterator[RoleRecord]:
    """Return the measured records of a folder."""

    def make(kind: str, columns: dict[str, np.ndarray], *answers: Roles) -> RoleRecord:
        return rename(kind, columns, answers, np.random.default_rng(len(columns)))

    tanks = read_columns(folder / "cascaded_tanks.csv")
    pair = (roles("y_est_V", "u_est_V"), roles("y_val_V", "u_val_V"))
    yield make("two tanks", tanks, *pair)
    for part, answer in zip(("est", "val"), pair, strict=True):
        yield make(f"tanks {part}", {name: tanks[name] for name in tanks if part in name}, answer)
    for kind, file, answer in (
        ("converter", "buck_converter.csv", roles("y_V", "u_V")),
        ("hair dryer", "daisy_hairdryer.csv", roles("y_temp", "u_V")),
        ("gas furnace", "gas_furnace.csv", roles("y_CO2_pct", "u_gasrate_ft3min")),
        ("damper", "mrdamper_labcontrol.csv", roles("force_N", "vel_mmps", "dist_mm volt_V")),
        ("cantilever", "piezo_micromanipulator_150V_1Hz.csv", roles("y_um", "u_V")),
        ("piezo loops", "piezo_pnzt_loops.csv", roles("D_nm", "V")),
        ("shape memory", "sma_wing_hysteresis.csv", roles("y", "v_V")),
    ):
        yield make(kind, read_columns(folder / file), answer)
    for kind, file, u, y in (
        ("silverbox", "silverbox.npz", "u", "y"),
        ("silverbox multisine", "silverbox.npz", "u_schroeder", "y_schroeder"),
        ("filter and diode", "wh2009.npz", "u", "y"),
        ("hysteresis", "boucwen_benchmark.npz", "u_train_N", "y_train_m"),
        ("hysteresis sweep", "boucwen_benchmark.npz", "u_test_sinesweep_N", "y_test_sinesweep_m"),
    ):
        with np.load(folder / file) as arrays:
            yield make(kind, {"u": arrays[u], "y": arrays[y]}, roles("y", "u"))
    with np.load(folder / "fsm_piezo.npz") as arrays:
        for level in (100, 200, 300):
            u, y = (arrays[f"{name}_{level}mV_train"][:, :, 0] for name in ("u", "y_um"))
            channels = {
                f"{name}{place}": x[:, place].T.ravel()
                for name, x in (("u", u), ("y", y))
                for place in range(3)
            }
            yield make(
                f"mirror {level} mV, one channel",
                {name: channels[name] for name in ("u0", "y0")},
                roles("y0", "u0"),
            )
            answers = (roles(f"y{place}", f"u{place}", "u0 u1 u2") for place in range(3))
            yield make(f"mirror {level} mV", channels, *answers)


def show(title: str, records: Sequence[RoleRecord]) -> tuple[list[float], list[bool]]:
    """Print the table of a set of records; return the stated probabilities, and which choices are right."""
    by_kind, stated, right = defaultdict(list), [], []
    for record in records:
        choice = column_roles.choose_columns(record.columns)
        is_right = record.is_right(choice)
        by_kind[record.kind].append((is_right, choice.confidence))
        if choice.confidence is not None:
            stated.append(choice.confidence)
            right.append(is_right)
    print(f"{title:40}{'right':>9}{'stated':>9}")
    for kind, found in by_kind.items():
        known = [confidence for _, confidence in found if confidence is not None]
        mean = f"{np.mean(known):9.2f}" if known else f"{'none':>9}"
        print(f"  {kind:38}{sum(each for each, _ in found):5}/{len(found):<3}{mean}")
    whole = [each for found in by_kind.values() for each, _ in found]
    print(
        f"  {len(whole)} records: {100 * np.mean(whole):.1f} % right; {len(stated)} proposed, "
        f"{100 * np.mean(right):.1f} % right, stated {100 * np.mean(stated):.1f} %, "
        f"expected calibration error {calibration_error(stated, right):.3f}",
        flush=True,
    )
    return stated, right


def fit(records: Sequence[RoleRecord]) -> None:
    """Print the weights that are most likely, with a penalty of their squares."""
    properties, is_input, weights = [], [], []
    for record in records:
        names = [
            name
            for name, x in record.columns.items()
            if not column_roles.is_counter(name, x) and not column_roles.is_numbering(name, x)
        ]
        signals = np.array([record.columns[name] for name in names])
        found = estimate_direction(signals)
        table = measure_properties(signals, found.influence)
        places = np.argwhere((found.influence.visible > 0.0) & ~found.derived)
        for source, target in places:
            properties.append(table[source, target])
            is_input.append(
                any(
                    names[target] == each.output and names[source] in each.inputs | each.others
                    for each in record.answers
                )
            )
            weights.append(len(places) ** -0.5)
    x, right, weight = np.array(properties), np.array(is_input), np.array(weights)
    size = x.std(axis=0)

    def loss(parameters: np.ndarray) -> float:
        odds = x / size @ parameters[:-1] + parameters[-1]
        errors = weight * (np.logaddexp(0.0, odds) - right * odds)
        return float(errors.sum() / weight.sum() + PENALTY * parameters[:-1] @ parameters[:-1])

    found = minimize(loss, np.zeros(len(WEIGHTS) + 1)).x
    for name, value in zip(WEIGHTS, found[:-1] / size, strict=True):
        print(f'    "{name}": {value:.2f},')
    print(f"constant {found[-1]:.2f}, {len(x)} pairs")


def main() -> None:
    """Print the tables, or the weights."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=10, help="records of each kind")
    parser.add_argument("--first", type=int, default=0, help="first seed of the calibration")
    parser.add_argument("--fit", action="store_true", help="estimate the weights on the calibration records")
    asked = parser.parse_args()
    calibration = make_records(asked.count, False, asked.first)
    if asked.fit:
        fit(calibration)
        return
    show("calibration", calibration)
    sets = [
        show("test", make_records(asked.count, True, asked.first + 1000)),
        show("loggers", make_logs(asked.count, asked.first)),
        show("portfolio", list(make_portfolio(max(1, asked.count // 5), asked.first + 1))),
    ]
    folder = os.environ.get("ISLANDS_MEASURED_DIR")
    if folder:
        sets.append(show("measured", list(read_measured(Path(folder)))))
    stated, right = (list(chain(*parts)) for parts in zip(*sets, strict=True))
    print(f"all but calibration: expected calibration error {calibration_error(stated, right):.3f}")


if __name__ == "__main__":
    main()
