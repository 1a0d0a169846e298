"""Whether awkward record files lead to the right law by defaults, and whether the rest is announced.

    python -m lab.searches.awkward_records [--seed 0] [--records "spikes" ...]

Each file holds a measurement of a known law. `islands fit` reads it by defaults, and as the command says
that `islands inspect` suggests if that has other options. A result is right if the RMSE of its free run, on a
test record that is sampled correctly and has no fault, is at most 1.2 times that of the true structure, whose
parameters minimise the error of the free run on the record without faults. Otherwise it is announced if the
file is refused with a remedy, the verdict on the use as a simulation is not "good", or the output is stated
to be perhaps saturated, and silently wrong if not. Exit status 1 if a result is silently wrong.
"""

import argparse
import sys
import tempfile
from collections import Counter
from pathlib import Path
from time import process_time

from support.awkward_outcomes import RIGHT, SILENT, assess
from support.awkward_records import AWKWARD_RECORDS


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seed", type=int, default=0)
    titles = [each.title for each in AWKWARD_RECORDS]
    parser.add_argument("--records", nargs="+", default=titles, choices=titles, metavar="TITLE")
    asked = parser.parse_args()
    counts: tuple[Counter[str], Counter[str]] = (Counter(), Counter())
    for record in AWKWARD_RECORDS:
        if record.title not in asked.records:
            continue
        started = process_time()
        with tempfile.TemporaryDirectory() as folder:
            outcomes = assess(record, asked.seed, Path(folder))
        for count, outcome in zip(counts, outcomes, strict=True):
            count[outcome.kind] += 1
        both = "  ".join(f"{each.kind:14} {each.ratio:6.3f}" for each in outcomes)
        print(f"{record.title:33} {record.law:13} {both}  ({process_time() - started:.1f} s)", flush=True)
        for place, each in enumerate(outcomes):
            if each.words and (place == 0 or each is not outcomes[0]):
                print(f"      {('default', 'suggested')[place]}: {each.words[:400]}", flush=True)
    for name, count in zip(("by defaults", "as suggested by inspect"), counts, strict=True):
        total = count.total()
        listed = ", ".join(f"{kind} {number}" for kind, number in count.most_common())
        print(f"{name}: {total} records, {listed}; right {100 * count[RIGHT] / total:.0f} %")
    return 1 if any(count[SILENT] for count in counts) else 0


if __name__ == "__main__":
    sys.exit(main())
