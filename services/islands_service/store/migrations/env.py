"""Alembic environment: runs the migrations in the transaction opened by `migrations.upgrade`."""

from alembic import context

from islands_service.store.tables import metadata

context.configure(
    connection=context.config.attributes["connection"], target_metadata=metadata, render_as_batch=True
)
context.run_migrations()
