"""Islands on Ray: the only package that imports it. It sets Ray's environment variables before the import.

Read `ray_engine` first, then `epochs_in_flight`, `actor_pool` and `epoch_scheduler`, and `regions` last.
"""

import os
import sys

from islands.errors import EngineError

# Send no usage statistics.
os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
# A connecting driver does not detect that the cluster requires a token. If Ray is imported already, the mode
# of this process is fixed, and processes started from it must have the same mode.
if "ray" not in sys.modules:
    os.environ.setdefault("RAY_AUTH_MODE", "token")
# A driver whose head is lost would exit only after a minute, and could do nothing before that.
os.environ.setdefault("RAY_gcs_rpc_server_reconnect_timeout_s", "5")
# Ray prints pages to standard output when a process is lost. The engine reports it in one line instead.
os.environ.setdefault("RAY_DEDUP_LOGS_SKIP_REGEX", ".")
# Ray's default of 15 leaves islands three per cent of a core that other programs use as well.
os.environ.setdefault("RAY_worker_niceness", "0")
# A frozen process keeps its CPU until Ray kills it, by default after five seconds.
os.environ.setdefault("RAY_kill_worker_timeout_milliseconds", "500")


class ClusterError(EngineError):
    """No usable Ray cluster. The message says what to do."""
