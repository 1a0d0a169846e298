"""``islands bench``: measured quantities and written files.

The measured times are not tested, because they depend on the load of the machine.
"""

import json
import shutil

from support.command_line import succeed

KINDS = {"poly", "general", "gp"}


def test_quick_benchmark_measures_all_sides(tmp_path):
    written, figures = tmp_path / "new" / "bench.json", tmp_path / "figures"
    shown = succeed("bench", "--quick", "--json", written, "--out", figures)
    found = json.loads(written.read_text(encoding="utf-8"))
    assert found["quick"] is True
    assert found["case1_wall_s"] is None
    assert found["samples"] == 100_000
    assert len(found["workload_sha256"]) == 64
    for name in ("numpy_ms", "uncached_ms", "amortised_ms"):
        assert set(found[name]) == KINDS
        assert all(time > 0.0 for time in found[name].values())
    # Compiled kernels are faster than plain numpy on any machine.
    assert found["evaluation_ratio_numpy_uncached"] > 2.0
    assert found["evaluation_ratio_numpy_amortised"] > 2.0
    rates = found["evaluations_per_second_per_core"]
    assert set(rates) == {"n100000", "n10000"}
    assert 0.0 < rates["n100000"] < rates["n10000"]
    assert found["parallel_efficiency_2"] > 0.0
    compiled = ("simulation_fraction_of_c", "gram_fraction_of_peak")
    if shutil.which("cc") is None:
        assert all(found[name] is None for name in compiled)
    else:
        assert all(0.0 < found[name] < 2.0 for name in compiled)
    assert {path.stem for path in figures.glob("*.svg")} == set(found["scaling"])
    assert set(found["scaling"]) == {"samples", "terms", "tree_size", "islands"}
    assert found["workload_sha256"][:12] in shown
