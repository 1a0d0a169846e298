"""Database backends: connections to SQLite and PostgreSQL, and the differences of their SQL."""
