"""What Alembic runs: the migrations in the transaction that `islands_service.store.schema` has opened."""

from alembic import context

from islands_service.store.tables import metadata

context.configure(
    connection=context.config.attributes["connection"], target_metadata=metadata, render_as_batch=True
)
context.run_migrations()
