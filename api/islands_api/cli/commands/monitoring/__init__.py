"""Command that follows a simulation from record to record."""
