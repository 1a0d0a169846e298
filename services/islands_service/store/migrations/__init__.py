"""Alembic migrations of the store, one file for each release that changes the schema."""
