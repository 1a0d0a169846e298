"""Tables of the store. A change needs a migration; a test compares the tables with the migrations."""

import zlib
from base64 import b64decode, b64encode
from typing import Any

from sqlalchemy import (
    BigInteger,
    Boolean,
    Column,
    Float,
    ForeignKey,
    Index,
    Integer,
    MetaData,
    String,
    Table,
    Text,
    UniqueConstraint,
    false,
    text,
)
from sqlalchemy.types import TypeDecorator

from islands_service.domain.owner import DEFAULT_WEIGHT, QUOTA_NAMES

#: Beginning of a compressed text. No JSON document begins like this.
_MARK = "zlib:"

#: Characters of a text that is not worth the time.
_SHORT = 500


class CompressedText(TypeDecorator[str]):
    """JSON document as text, compressed if that makes it shorter. The database cannot search in it."""

    impl = Text
    cache_ok = True

    def process_bind_param(self, value: str | None, _dialect: Any) -> str | None:
        """Return the text as it is stored."""
        if value is None or len(value) < _SHORT:
            return value
        packed = _MARK + b64encode(zlib.compress(value.encode())).decode()
        return min(value, packed, key=len)

    def process_result_value(self, value: str | None, _dialect: Any) -> str | None:
        """Return the text as it was given."""
        if value is None or not value.startswith(_MARK):
            return value
        return zlib.decompress(b64decode(value[len(_MARK) :])).decode()


#: Constraints are named, because a migration cannot change an unnamed one.
metadata = MetaData(
    naming_convention={
        "ix": "ix_%(table_name)s_%(column_0_N_name)s",
        "uq": "uq_%(table_name)s_%(column_0_N_name)s",
        "fk": "fk_%(table_name)s_%(column_0_name)s",
        "pk": "pk_%(table_name)s",
    }
)


def _job() -> Column[str]:
    """Return a foreign key to a job. The row is deleted with its job."""
    return Column("job_id", String(32), ForeignKey("jobs.id", ondelete="CASCADE"), primary_key=True)


jobs = Table(
    "jobs",
    metadata,
    Column("id", String(32), primary_key=True),
    Column("owner", String(64), nullable=False),
    Column("kind", String(32), nullable=False),
    Column("name", String(200), nullable=False),
    Column("spec", Text, nullable=False),
    Column("request_sha256", String(64), nullable=False),
    Column("idempotency_key", String(255)),
    Column("priority", Integer, nullable=False),
    Column("state", String(16), nullable=False),
    Column("version", BigInteger, nullable=False, default=1),
    Column("attempt", Integer, nullable=False, default=0),
    # Attempts since the last checkpoint.
    Column("stalled", Integer, nullable=False, default=0),
    Column("lease_owner", String(128)),
    Column("lease_epoch", BigInteger, nullable=False, default=0),
    Column("lease_until", Float, nullable=False, default=0.0),
    Column("cancel_requested", Boolean, nullable=False, default=False),
    Column("stop_requested", Boolean, nullable=False, server_default=false()),
    Column("progress", Text),
    Column("checkpoint", String(64)),
    Column("summary", Text),
    Column("problem", Text),
    Column("created", Float, nullable=False),
    Column("updated", Float, nullable=False),
    Column("started", Float),
    Column("finished", Float),
    # Versions of islands that accepted the job, and wrote its checkpoint and its result.
    Column("islands_version", String(64)),
    Column("checkpoint_version", String(64)),
    Column("result_version", String(64)),
    # Earliest time of the next claim.
    Column("not_before", Float, nullable=False, server_default=text("0")),
    # Versions of islands that cannot read the job, each in commas.
    Column("declined", Text, nullable=False, server_default=""),
    # Seconds for which coordinators have run the job since its submission or its resume.
    Column("run_seconds", Float, nullable=False, server_default=text("0")),
    # Limit of these seconds, a copy of the quota of the owner; null is the default of the settings.
    Column("max_run_seconds", BigInteger),
    # Islands of the search; 1 for a diagnosis.
    Column("islands", Integer, nullable=False, server_default=text("1")),
    # Monitor whose record the job analyses, and the number of the record in the order of submission. The jobs
    # of a deleted monitor are kept.
    Column("monitor_id", String(32)),
    Column("record_number", BigInteger),
    # Tags, each in commas.
    Column("tags", Text, nullable=False, server_default=""),
    # Name of the data set at the submission.
    Column("dataset_name", String(255)),
    # Text that a search reads, folded by `job_search`: of the labels, and of the result.
    Column("search_labels", Text, nullable=False, server_default=""),
    Column("search_result", Text, nullable=False, server_default=""),
    # Mean absolute error of the recommended model, in per cent of the range of its output.
    Column("model_error", Float),
    UniqueConstraint("owner", "idempotency_key"),
    Index(None, "owner", "created", "id"),
    Index(None, "owner", "state", "created", "id"),
)

#: Order of the jobs with a model by its error.
Index(
    "ix_jobs_model_error",
    jobs.c.owner,
    jobs.c.model_error,
    jobs.c.id,
    sqlite_where=jobs.c.model_error.is_not(None),
    postgresql_where=jobs.c.model_error.is_not(None),
)

#: Owners with queued jobs, and the order of the jobs of each. The islands of running jobs are summed in it.
Index(
    "ix_jobs_queue",
    jobs.c.state,
    jobs.c.owner,
    jobs.c.priority.desc(),
    jobs.c.created,
    jobs.c.id,
    jobs.c.islands,
)

#: Order of the records of each monitor. Other jobs are not in it.
Index(
    "ix_jobs_monitor",
    jobs.c.monitor_id,
    jobs.c.state,
    jobs.c.record_number,
    sqlite_where=jobs.c.monitor_id.is_not(None),
    postgresql_where=jobs.c.monitor_id.is_not(None),
)

#: Events of jobs. The number is the version of the job: without gaps, in the order of the commits.
events = Table(
    "events",
    metadata,
    _job(),
    Column("number", BigInteger, primary_key=True),
    Column("kind", String(16), nullable=False),
    Column("data", CompressedText, nullable=False),
    Column("at", Float, nullable=False),
)

#: History of a search, in a separate table so that a list of jobs does not read it.
points = Table(
    "points",
    metadata,
    _job(),
    Column("generation", Integer, primary_key=True),
    Column("evaluations", BigInteger, nullable=False),
    Column("best", Text, nullable=False),
    Column("islands", Text, nullable=False),
)

results = Table("results", metadata, _job(), Column("document", CompressedText, nullable=False))

models = Table(
    "models",
    metadata,
    _job(),
    Column("rank", Integer, primary_key=True),
    Column("document", CompressedText, nullable=False),
    Column("file", CompressedText, nullable=False),
)

#: Blobs derived from a result, such as figures, by name.
artefacts = Table(
    "artefacts",
    metadata,
    _job(),
    Column("name", String(64), primary_key=True),
    Column("blob", String(64), nullable=False),
)

datasets = Table(
    "datasets",
    metadata,
    Column("owner", String(64), primary_key=True),
    Column("id", String(48), primary_key=True),
    Column("name", String(255), nullable=False),
    Column("suffix", String(16), nullable=False),
    Column("blob", String(64), nullable=False),
    Column("bytes", BigInteger, nullable=False),
    Column("preview", Text, nullable=False),
    Column("created", Float, nullable=False),
    # The preview without its columns, for lists.
    Column("summary", Text),
    # URL of the download, without its query; null for an upload.
    Column("source", Text),
    # Time at which a sweep found that no job names the data set; null if one does, or no sweep looked yet.
    Column("idle_since", Float),
    # Time of the deletion by the owner, or by a sweep. The row is kept while a job names the data set.
    Column("deleted", Float),
)

#: Idempotency keys of deleted jobs, kept as long as the job would have been.
retired_keys = Table(
    "retired_keys",
    metadata,
    Column("owner", String(64), primary_key=True),
    Column("idempotency_key", String(255), primary_key=True),
    Column("job_id", String(32), nullable=False),
    Column("request_sha256", String(64), nullable=False),
    Column("finished", Float, nullable=False),
)

keys = Table(
    "keys",
    metadata,
    Column("id", String(16), primary_key=True),
    Column("owner", String(64), nullable=False),
    Column("name", String(200), nullable=False),
    Column("secret_sha256", String(64), nullable=False, unique=True),
    Column("scopes", Text, nullable=False),
    Column("created", Float, nullable=False),
    Column("expires", Float),
    Column("revoked", Float),
)

#: Simulations that follow the records of an owner. A record and its effect on the row are one transaction.
monitors = Table(
    "monitors",
    metadata,
    Column("id", String(32), primary_key=True),
    Column("owner", String(64), nullable=False),
    Column("name", String(200), nullable=False),
    Column("spec", Text, nullable=False),
    Column("priority", Integer, nullable=False),
    # Raised by every analysed or rejected record.
    Column("version", BigInteger, nullable=False),
    # Number of the last submitted record.
    Column("submitted", BigInteger, nullable=False),
    Column("status", String(16), nullable=False),
    Column("records", BigInteger, nullable=False),
    Column("alarms", BigInteger, nullable=False),
    # State without its records, document for clients, first record that the next one is compared with.
    Column("state", Text),
    Column("document", Text),
    Column("start", BigInteger, nullable=False, server_default=text("0")),
    Column("last_alarm", Text),
    Column("created", Float, nullable=False),
    Column("updated", Float, nullable=False),
    Column("islands_version", String(64)),
    Index(None, "owner", "created", "id"),
)

#: Analysed and rejected records of monitors, each numbered from 0. A row never changes.
monitor_records = Table(
    "monitor_records",
    metadata,
    Column("monitor_id", String(32), ForeignKey("monitors.id", ondelete="CASCADE"), primary_key=True),
    Column("is_rejected", Boolean, primary_key=True),
    Column("place", BigInteger, primary_key=True),
    Column("name", Text, nullable=False),
    Column("sha256", String(64), nullable=False),
    Column("state", Text, nullable=False),
    Column("document", Text, nullable=False),
    Index(None, "monitor_id", "sha256"),
)

#: URLs that receive the events of an owner's jobs.
webhooks = Table(
    "webhooks",
    metadata,
    Column("id", String(32), primary_key=True),
    Column("owner", String(64), nullable=False),
    Column("url", Text, nullable=False),
    Column("events", Text, nullable=False),
    # Key of the signatures, which cannot be computed from a hash.
    Column("secret", String(64), nullable=False),
    Column("created", Float, nullable=False),
    # Until this time a process sends to the URL.
    Column("busy_until", Float, nullable=False, server_default=text("0")),
    Index(None, "owner"),
)

#: Outbox of the events of webhooks, and what was sent.
deliveries = Table(
    "deliveries",
    metadata,
    Column("id", String(32), primary_key=True),
    Column("webhook_id", String(32), ForeignKey("webhooks.id", ondelete="CASCADE"), nullable=False),
    Column("event", String(32), nullable=False),
    Column("job_id", String(32), nullable=False),
    Column("body", Text, nullable=False),
    Column("created", Float, nullable=False),
    Column("attempts", Integer, nullable=False),
    # Time of the next attempt; null if the delivery is finished.
    Column("next_at", Float),
    Column("attempted", Float),
    Column("delivered", Float),
    Column("status", Integer),
    Column("error", Text),
    Index(None, "webhook_id", "next_at"),
    Index(None, "webhook_id", "created"),
)

#: Owners with a weight, a quota or a claimed job. All others have the defaults.
owners = Table(
    "owners",
    metadata,
    Column("name", String(64), primary_key=True),
    Column("weight", Integer, nullable=False, default=DEFAULT_WEIGHT),
    # Start tag of the last claim: see `job_rows.fair_queue`.
    Column("virtual_time", BigInteger),
    # Quotas; null is the default of the settings.
    *(Column(name, BigInteger) for name in QUOTA_NAMES),
    Index(None, "virtual_time"),
)

#: Changes that clients and operators have requested.
audit = Table(
    "audit",
    metadata,
    Column("number", BigInteger().with_variant(Integer, "sqlite"), primary_key=True),
    Column("at", Float, nullable=False),
    Column("action", String(32), nullable=False),
    Column("owner", String(64), nullable=False),
    # Id of the job, the data set, the monitor, the key or the webhook, or name of the owner.
    Column("subject", String(64), nullable=False),
    # Key of the request; null without one.
    Column("key_id", String(16)),
    Column("address", String(64), nullable=False),
    # See `AuditEntry.details`.
    Column("details", Text),
    Index(None, "at"),
    Index(None, "owner", "at"),
)
