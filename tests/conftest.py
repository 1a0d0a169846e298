"""What every test may use: the generators of `strategies.py`, one hypothesis profile, compiled kernels.

In importlib mode pytest puts no test folder on the path, so the generators' folder is put there here.
"""

import sys
from pathlib import Path

from hypothesis import HealthCheck, settings

from islands.warm_up import warm_up

sys.path.insert(0, str(Path(__file__).parent))

# A kernel compiles in its first example, and the machine may be busy: neither is a failure of a law.
settings.register_profile(
    "house", deadline=None, max_examples=80, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("house")


def pytest_configure(config):
    # Before the workers start: each of them would compile all kernels for itself.
    if not hasattr(config, "workerinput"):
        warm_up()
