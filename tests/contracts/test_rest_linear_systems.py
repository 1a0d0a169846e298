"""Linear systems of the models of a job over REST: the numbers of the library, figures, and problems."""

import asyncio
import json

import numpy as np
import pytest

from islands.export.linear_system import write_linear_system
from islands.models.state_space import FORMS
from islands.report.figures.names import LINEAR_FIGURES
from islands_api.client import AsyncClient, Client
from islands_service.domain.fitted_models import read_fitted
from support.service import problem_of

pytestmark = pytest.mark.ci

#: Seconds for a request that draws figures in another process.
PATIENCE = 300.0


def linearise(identified, job, *point):
    (stored,) = identified.store.results.models(job, 1)
    document = identified.store.results.document(job)
    return read_fitted(job, stored.file, stored.document, document).linearise(*point)


def test_the_system_is_that_of_the_library_in_every_notation(identified, job, outputs):
    with Client(identified.url) as client:
        for each in (job, outputs):
            system = linearise(identified, each)
            for form in FORMS:
                for notation in ("json", "matlab", "text"):
                    written = client.export_linear_system(each, 1, form=form, notation=notation)
                    assert written == write_linear_system(system, form, notation)
            found = client.linear_system(each)
            assert np.array_equal(found.A, system.A)
            assert np.array_equal(found.static_gain, system.static_gain)
            assert found.words == system.describe()
            assert found.numerators is None


def test_a_system_is_about_a_given_operating_point(identified, job):
    with Client(identified.url) as client:
        found = client.linear_system(job, at={"u_V": 0.25}, form="transfer-function")
    assert found.operating_inputs == (0.25,)
    expected = linearise(identified, job, {"u_V": 0.25}).transfer_functions()
    assert np.array_equal(found.numerators, expected[0])
    with Client(identified.url) as client:
        found = client.linear_system(job, continuous="tustin")
        written = client.export_linear_system(job, continuous="tustin")
    expected = linearise(identified, job).to_continuous("tustin")
    assert (found.dt, np.array_equal(found.A, expected.A)) == (0.0, True)
    assert written == write_linear_system(expected, "state-space", "matlab")
    answer = identified.client.get(f"/v1/jobs/{job}/models/1/linear-system", params={"continuous": "foh"})
    assert "there is no conversion 'foh'" in problem_of(answer, 422, "invalid-settings")
    for text, detail in (("u_V", "NAME=VALUE"), ("u_V=nan", "NAME=VALUE"), ("w=1", "no input w")):
        answer = identified.client.get(f"/v1/jobs/{job}/models/1/linear-system", params={"at": text})
        kind = "invalid-model" if "input" in detail else "invalid-settings"
        assert detail in problem_of(answer, 422, kind)


@pytest.mark.parametrize("several", [False, True])
def test_all_figures_of_an_operating_point_are_drawn_once(identified, job, outputs, several, monkeypatch):
    which, drawn = outputs if several else job, []
    from islands_api.web.routes import linear_systems

    run = linear_systems.run_figure_worker

    async def count(*arguments):
        drawn.append(arguments[2])
        return await run(*arguments)

    monkeypatch.setattr(linear_systems, "run_figure_worker", count)
    with Client(identified.url, timeout=PATIENCE) as client:
        pictures = {name: client.linear_figure(which, name) for name in LINEAR_FIGURES}
        assert all(picture.startswith(b"<?xml") for picture in pictures.values())
        assert len(set(pictures.values())) == len(LINEAR_FIGURES)
        table = client.linear_figure(which, "bode", form="csv").decode()
    assert len(drawn) == 1
    assert json.loads(drawn[0][-1].partition("=")[2]) == {}
    assert len(table.splitlines()) > 100


def test_the_asynchronous_client_has_the_same_calls(identified, job):
    async def ask():
        async with AsyncClient(identified.url, timeout=PATIENCE) as client:
            return await client.linear_system(job), await client.export_linear_system(job)

    system, text = asyncio.run(ask())
    assert system.outputs == ("y_um",)
    assert "sys = ss(A, B, C, D, 0.01);" in text
