"""What every test may use: the generators of `strategies.py`, and one hypothesis profile.

In importlib mode pytest puts no test folder on the path, so the generators' folder is put there here.
"""

import sys
from pathlib import Path

from hypothesis import HealthCheck, settings

sys.path.insert(0, str(Path(__file__).parent))

# A kernel compiles in its first example, and the machine may be busy: neither is a failure of a law.
settings.register_profile(
    "house", deadline=None, max_examples=80, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("house")
