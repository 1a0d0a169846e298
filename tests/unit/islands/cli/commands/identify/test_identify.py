"""``islands identify`` in this process: files of a run, test data, and options."""

import json
import shutil

import pytest

from islands.records.writer import write_record
from support.identify_runs import COLUMNS, DEEPEST, SMALL, record, refused

# Files of a run.


# Test data.


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--test", "500:700"), "--test 500:700: give --rows"),
        (("--rows", "0:600", "--test", "500:700"), "--test 500:700: give --rows"),
        (
            ("--rows", "0:400", "--validation", "400:600", "--test", "500:700"),
            "samples that are used for estimation or validation",
        ),
        (("--rows", "0:400", "--validation", "300:600"), "--validation 300:600: give --rows"),
        (("--validation", "r.csv"), "the validation data has samples that are used for estimation"),
        (("--rows", "0:400", "--validation", "copy.csv"), "samples that are used for estimation"),
        (("--test", "r.csv"), "samples that are used for estimation or validation"),
        (("--rows", "100:700", "--test", "r.csv"), "samples that are used for estimation or validation"),
        (("--test", "nowhere.csv"), "--test nowhere.csv: give a file that exists"),
        (("--test", "1.5"), "lies between 0 and 1, got 1.5"),
        (("--test", "slow.csv"), "time of 0.01 s, the test data of 0.05 s: resample"),
        (
            ("--rows", "0:660", "--test", "660:700", "--set", "max_height=12"),
            f"the test data has 40 samples, and the largest lag is {DEEPEST}: give more samples",
        ),
    ],
)
def test_overlapping_or_unsuitable_test_data_is_rejected(run, tmp_path, options, message):
    write_record(record(dt=0.05), "slow.csv")
    shutil.copyfile("r.csv", "copy.csv")
    assert message in refused(run("r.csv", *COLUMNS, *SMALL, "--out", "out", *options))
    assert not (tmp_path / "out").exists()


# Options.


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--set", "population=0"), "population is an integer of at least 1, got '0'"),
        (("--generations", "-1"), "generations is an integer of at least 0, got '-1'"),
        (("--max-terms", "0"), "max_terms is an integer of at least 1, got '0'"),
        (("--set", "max_height=-2"), "max_height is an integer of at least 0, got '-2'"),
        (("--set", "shooting=0"), "shooting is an integer of at least 1, got '0'"),
        (("--preset", "quick"), "unknown preset 'quick': take one of auto, paper-case1"),
        (("--set", "primitives=mul,gamma"), "unknown primitive 'gamma': take one of mul"),
        (("--constraints", "physics"), "unknown constraints 'physics': take one of none, hysteresis"),
        (("--validation", "nowhere.csv"), "--validation nowhere.csv: give a file that exists"),
        (("--input", "u_mV"), "u_mV"),
        (("--islands", "0"), "islands is an integer from 1 to 10000, got '0'"),
        (("--set", "topology=mesh"), "unknown topology 'mesh': take one of isolated, ring"),
        (
            ("--set", "topology=ring:"),
            "topology 'ring:': a degree from 1 to 99 goes with random-regular alone",
        ),
        (("--islands", "2", "--set", "topology=1234567890>1"), "cannot read the edge '1234567890>1'"),
        (("--set", "migrate_every=1234567890"), "cannot read migrate_every '1234567890'"),
        (("--set", "migrate_every=5,"), "cannot read migrate_every '5,'"),
        (("--set", "migrants=-1"), "cannot read migrants '-1'"),
        (("--islands", "2", "--set", "migrants=301"), "301 individuals would arrive on an island of 200"),
        (("--set", "emigrants=worst"), "emigrants is one of best, random, front, got 'worst'"),
        (("--set", "replaced=best"), "replaced is one of worst, random, got 'best'"),
        (("--set", "characters=plain,lazy"), "unknown character 'lazy': take one of plain"),
        (("--set", "max_evaluations=-1"), "max_evaluations is an integer of at least 0, got '-1'"),
        (("--set", "target_error=-0.1"), "target_error is a number of at least 0, got '-0.1'"),
        (("--set", "target_error=nan"), "target_error is a number of at least 0, got 'nan'"),
    ],
)
def test_invalid_option_is_rejected_by_name_without_a_folder(run, tmp_path, options, message):
    assert message in refused(run("r.csv", *COLUMNS, "--out", "out", *options))
    assert not (tmp_path / "out").exists()


@pytest.mark.ci
def test_options_of_islands_reach_the_settings(run, tmp_path):
    own = (
        *("--islands", "3", "--set", "topology=random-regular:2", "--set", "migrate_every=1,2:5"),
        *("--set", "migrants=2", "--set", "emigrants=front", "--set", "replaced=random"),
        *("--set", "characters=explorer,pruner"),
        *("--set", "max_evaluations=1000", "--set", "target_error=1e-9"),
    )
    assert run("r.csv", *COLUMNS, *SMALL, *own, "--engine", "serial", "--out", "out")[0] == 0
    document = json.loads((tmp_path / "out/result.json").read_text())
    assert (
        document["settings"].items()
        >= {
            "islands": 3,
            "topology": "random-regular:2",
            "migrate_every": "1,2:5",
            "migrants": "2",
            "emigrants": "front",
            "replaced": "random",
            "characters": ["explorer", "pruner"],
            "max_evaluations": 1000,
            "target_error": 1e-9,
        }.items()
    )
    assert document["search"]["evaluations"] == 3 * 40
    # Schedules and profiles are read back from the checkpoint unchanged.
    assert run("--resume", "out", "--engine", "serial")[0] == 0
    assert json.loads((tmp_path / "out/result.json").read_text())["settings"] == document["settings"]
