"""Routes of the REST interface, one file for each resource. Read `jobs` first.

To add a file, add its router to `ROUTERS`.
"""

from fastapi import APIRouter

from islands_api.web.routes import (
    administered_jobs,
    caller,
    comparisons,
    datasets,
    diagnoses,
    events,
    figures,
    fmus,
    jobs,
    keys,
    model_simulations,
    models,
    monitors,
    owners,
    page,
    presets,
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
    model_simulations.router,
    comparisons.router,
    monitors.router,
    keys.router,
    owners.router,
    administered_jobs.router,
    webhooks.router,
    presets.router,
    caller.router,
    service.router,
    page.router,
)
