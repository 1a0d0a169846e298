"""Requests of the service to hosts that its clients name. Read `checked_client` first."""
