"""Without the packages of an extra, an error names the extra and how it is installed from a file."""

import ast
import re
import subprocess
import sys
import sysconfig
import tomllib
import venv
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import NamedTuple

import pytest

import islands
from islands.cli.app import EXTRAS as COMMAND_EXTRAS
from islands.cli.engines import start_engine
from islands.errors import IslandsError
from islands.evolution.engine import SerialEngine
from islands.facade.engine_choice import open_engine
from islands.models.sympy_expression import to_sympy
from islands.simulators.fmu.fmi_description import import_fmpy
from islands_api.web.auth import make_verifier
from islands_service.settings import ServiceSettings
from islands_service.store.buckets import ObjectStore
from islands_service.store.dialect import make_engine
from islands_service.telemetry import Traces
from support.repository import ROOT

EXTRAS = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]

#: Part of a message: the extra of the wheel, and the same extra in a checkout. pip takes a requirement that
#: ends in .whl for a path, and does not look for it in an index if the file does not exist.
INSTRUCTION = re.compile(
    r"needs the extra '(\w+)': pip install 'FOLDER/islands_sysid-[\d.]+-py3-none-any\.whl\[\1\]', "
    r"or in a checkout: python3 deploy/packages/install\.py \.venv --extra \1\b"
)

TOKENS = ServiceSettings(oidc_issuer="https://id.example.org", oidc_audience="islands")


class Use(NamedTuple):
    """What needs an extra.

    Attributes
    ----------
    requirement : str
        Name of the package in the extra.
    absent : str
        Module of the package.
    call : callable
        Needs the module; the argument is an empty folder.
    importing : tuple of str
        Our modules that import it when they are imported.
    """

    requirement: str
    absent: str
    call: Callable[[Path], object]
    importing: tuple[str, ...] = ()


def model() -> islands.Model:
    return islands.make_model([(islands.parse("y(k-1)"), 0.5), (islands.parse("u(k-1)"), 1.0)])


def read(name: str) -> Callable[[Path], object]:
    """Return a function that reads a file with a name."""

    def call(folder: Path) -> object:
        (folder / name).write_bytes(b"not empty")
        return islands.read_record(folder / name, inputs=["u"], output="y")

    return call


USES = {
    "cluster": Use(
        "psycopg",
        "psycopg",
        lambda _: make_engine("postgresql+psycopg://user@127.0.0.1/name"),
        ("islands_service.store.timed_connection",),
    ),
    "control": Use("control", "control", lambda _: islands.linearise(model(), [0.0]).to_control()),
    "excel": Use("openpyxl", "openpyxl", read("a.xlsx")),
    "fmi": Use("fmpy", "fmpy", lambda _: import_fmpy()),
    "mdf": Use("asammdf", "asammdf.blocks.utils", read("a.mf4")),
    "oidc": Use("joserfc", "joserfc", lambda _: make_verifier(TOKENS)),
    "parquet": Use("pyarrow", "pyarrow", read("a.parquet")),
    "ray": Use(
        "ray",
        "ray",
        lambda _: open_engine("ray").__enter__(),
        ("islands_service.runtime.cluster", "islands_service.runtime.ray_engine"),
    ),
    "s3": Use("s3fs", "s3fs", lambda _: ObjectStore("s3://bucket/a")),
    "sklearn": Use(
        "scikit-learn", "sklearn.base", lambda _: import_module("islands.sklearn"), ("islands.sklearn",)
    ),
    "sympy": Use("sympy", "sympy", lambda _: to_sympy(model())),
    "tdms": Use("npTDMS", "nptdms", read("a.tdms")),
    "telemetry": Use("opentelemetry-sdk", "opentelemetry", lambda _: Traces("http://127.0.0.1:1", "api")),
}


@pytest.mark.parametrize("extra", USES)
def test_a_missing_package_leads_to_the_extra_that_installs_it(extra, tmp_path, monkeypatch):
    use = USES[extra]
    for name in use.importing:
        monkeypatch.delitem(sys.modules, name, raising=False)
    monkeypatch.setitem(sys.modules, use.absent, None)
    with pytest.raises(IslandsError) as caught:
        use.call(tmp_path)
    (named,) = INSTRUCTION.findall(str(caught.value))
    assert named == extra
    assert use.requirement in {re.split(r"[\[>]", each)[0] for each in EXTRAS[extra]}


@pytest.fixture
def reduced(tmp_path):
    """Return a function that makes an environment without some of the packages of this one."""

    def make(*absent: str) -> Path:
        venv.create(tmp_path / "venv", symlinks=True)
        packages = Path(sysconfig.get_path("purelib"))
        target = next((tmp_path / "venv").glob("lib/python*/site-packages"))
        for each in packages.iterdir():
            if not re.match(rf"({'|'.join(absent)})(-[\d.]+\.dist-info)?$", each.name):
                (target / each.name).symlink_to(each)
        return tmp_path / "venv/bin/python"

    return make


@pytest.mark.ci
@pytest.mark.parametrize(
    ("absent", "options", "extras"),
    [
        (("uvicorn",), (), "'service'"),
        (("structlog", "psycopg"), ("--database", "postgresql+psycopg://me@db/d"), "'service' and 'cluster'"),
    ],
)
def test_a_service_without_some_of_its_packages_names_them_and_does_not_start(
    reduced, tmp_path, absent, options, extras
):
    command = [reduced(*absent), "-m", "islands", "serve", "--data-dir", tmp_path / "data", *options]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60, cwd=tmp_path)
    assert done.returncode == 2, done.stderr
    said = " ".join(done.stderr.split())
    needs = f"needs the extra{'s' if len(absent) > 1 else ''} {extras}: pip install 'FOLDER/"
    assert said.startswith(f"error: islands serve cannot run without {', '.join(absent)}; it {needs}")
    assert said.endswith("".join(f" --extra {each}" for each in re.findall(r"'(\w+)'", extras)))
    assert not (tmp_path / "data").exists()


def test_a_search_on_one_core_for_lack_of_ray_says_how_to_install_it(monkeypatch):
    monkeypatch.setattr("islands.cli.engines.has_ray", lambda: False)
    messages = []
    with start_engine(None, None, 2, messages.append) as engine:
        assert isinstance(engine, SerialEngine)
    assert INSTRUCTION.findall(*messages) == ["ray"]


def test_every_message_names_an_extra_and_is_tested():
    named = {
        ast.literal_eval(node.args[1])
        for folder in ("src", "services", "measurements", "api")
        for path in (ROOT / folder).rglob("*.py")
        if "describe_missing_extra(" in (text := path.read_text())
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.Call)
        and ast.unparse(node.func) == "describe_missing_extra"
        and isinstance(node.args[1], ast.Constant)
    }
    assert named == USES.keys()
    assert {*USES, *COMMAND_EXTRAS.values()} == EXTRAS.keys() - {"all", "server"}
