"""The web service: a FastAPI application over the store. Read `app` first."""
