"""Web service: a FastAPI application on top of the store. Read `app` first, then `routes`."""
