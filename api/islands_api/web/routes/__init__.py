"""Routes of the REST interface, one file for each resource. Read `jobs` first.

To add a file, add its router to `ROUTERS`.
"""

from fastapi import APIRouter

from islands_api.web.routes import (
    administration,
    datasets,
    diagnoses,
    events,
    figures,
    fmus,
    jobs,
    linear_systems,
    models,
    monitors,
    page,
    scenarios,
    service,
    simulations,
    webhooks,
)

#: All routers of the application, the most used one first: requests are matched against the routes in order.
ROUTERS: tuple[APIRouter, ...] = (
    jobs.router,
    datasets.router,
    datasets.fetching,
    diagnoses.router,
    simulations.router,
    fmus.router,
    events.router,
    models.router,
    figures.router,
    linear_systems.router,
    models.simulation_router,
    scenarios.router,
    figures.comparison_router,
    monitors.router,
    administration.router,
    webhooks.router,
    service.strict_router,
    service.router,
    page.router,
)
