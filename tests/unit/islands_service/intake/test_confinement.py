"""A confined process of root is another user with the right to read what root can read."""

import json
import os
import subprocess
import sys

import pytest

pytestmark = pytest.mark.ci

#: Confines itself, then prints the content of a file of root, its user, and its capabilities.
SCRIPT = """
import json, os, sys
from pathlib import Path
import zoneinfo
from islands_service.intake.confinement import confine
gaps = confine([Path(sys.argv[1])])
import h5py, numpy, openpyxl, pyarrow.parquet, nptdms
zoneinfo.ZoneInfo("Europe/Berlin")
os.listdir(os.path.dirname(os.__file__))
status = dict(line.split(":", 1) for line in open("/proc/self/status"))
print(json.dumps([gaps, open(sys.argv[1]).read(), [os.getuid(), os.geteuid()], int(status["CapPrm"], 16)]))
"""


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can become another user")
def test_a_confined_process_of_root_keeps_the_right_to_read_and_no_other(tmp_path):
    given = tmp_path / "given.csv"
    given.write_text("1")
    given.chmod(0o600)
    tmp_path.chmod(0o700)
    command = [sys.executable, "-P", "-c", SCRIPT, given]
    # Libraries that start threads are not in the environment of a reader.
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    found = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
    gaps, text, users, capabilities = json.loads(found.stdout)
    assert (gaps, text) == ([], "1")
    assert 0 not in users
    assert capabilities == 1 << 2, "CAP_DAC_READ_SEARCH"
