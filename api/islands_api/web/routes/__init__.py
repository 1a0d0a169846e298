"""The routes: one file for each thing of the interface. A newcomer's endpoints join `ROUTERS`."""

from fastapi import APIRouter

from islands_api.web.routes import datasets, diagnoses, events, figures, jobs, models, page, service

#: All of the interface.
ROUTERS: tuple[APIRouter, ...] = (
    datasets.router,
    jobs.router,
    diagnoses.router,
    events.router,
    models.router,
    figures.router,
    service.router,
    page.router,
)
