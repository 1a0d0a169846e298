# Each chore is one command. Python 3.11 and make are all that has to be there.
PYTHON ?= python3
BIN := .venv/bin

.PHONY: setup demo collect test ci nightly soak fuzz load lint bench docs sbom licences audit wheel wheel-matrix clean

setup: .venv/ready

.venv/ready: requirements.lock pyproject.toml
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "islands needs Python 3.11 or newer: make PYTHON=python3.11")'
	$(PYTHON) -m venv .venv
	$(BIN)/pip install --disable-pip-version-check --no-compile --require-hashes -r requirements.lock
	-$(BIN)/python -m compileall -qq -j 0 .venv/lib
	$(BIN)/pip install --disable-pip-version-check --no-build-isolation --no-deps -e .
	$(BIN)/python -c 'from islands.facade.warm_up import warm_up; warm_up()'
	touch $@

demo: setup
	$(BIN)/islands demo --out demo-out

# By file, since fixtures of modules are costly, and in the order of collection, which has the long files first.
PYTEST := $(BIN)/pytest --costs --dist loadfile --no-loadscope-reorder

# Bytecode of rewritten assertions is kept between runs, whatever the environment says: it halves the collection.
unexport PYTHONDONTWRITEBYTECODE

# Compile the sources and rewrite the assertions of all tests once. Otherwise each worker of the first run does.
collect: setup
	$(BIN)/pytest --collect-only -q >/dev/null

# Three workers on two cores: some tests wait for other processes.
test: setup
	$(PYTEST) -n 3

# What CI runs besides `make test`: browser, PostgreSQL, kills of a coordinator and of an island. The tests of the
# wheel need one, which .ci/run builds first.
ci: setup
	$(PYTEST) -n 2 -m "ci and not nightly" --ignore tests/acceptance/test_installed_wheel.py

# Another order and other kills every day of the year.
DAY = $(shell date +%j)

# Everything else: the remaining slow tests, the properties with many examples, 500 random kills, and mutated files.
nightly: setup
	$(PYTEST) -n 2 --timeout 1200 --random-order --random-order-seed $(DAY) \
		--hypothesis-profile thorough -m "nightly or hypothesis"
	$(MAKE) soak fuzz

# 500 random kills and suspensions of a service on each database: no job may be lost or duplicated, and results must
# be identical.
soak: setup
	$(BIN)/python benchmarks/service_soak.py --kills 500 --seed $(DAY)
	$(BIN)/python benchmarks/service_soak.py --kills 500 --seed $(DAY) --database postgresql

# Five minutes of mutated files for all readers of uploads.
fuzz: setup
	$(BIN)/python benchmarks/fuzz_readers.py --seconds 300 --seed $(DAY)

# Figures of a service under load, on a machine that should be otherwise idle.
load: setup
	$(BIN)/python benchmarks/service_load.py --repeat 5

lint: setup
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports --no-cache

bench: setup
	$(BIN)/islands bench

# The theme prints a notice about a later version of MkDocs, which is not installed.
docs: setup
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --site-dir site

# What the image contains, in CycloneDX. The file depends on deploy/requirements.lock only.
sbom: setup
	$(BIN)/python deploy/packages/write_sbom.py --output dist/islands-sbom.json

# Every locked package has a licence of deploy/packages/licences.toml.
licences: setup
	$(BIN)/python deploy/packages/check_licences.py

# Known vulnerabilities of the locked packages. Exit code 2 of the script: not checked, for lack of a service.
audit: setup
	$(BIN)/python deploy/packages/audit_packages.py

wheel: setup
	$(BIN)/python -m build --no-isolation --wheel --outdir dist .

# The wheel on Python 3.11, 3.12 and 3.13, with all extras and with the core only: a quarter of an hour, and an index of packages.
wheel-matrix: setup
	.ci/wheel-matrix

clean:
	rm -rf .venv build dist demo-out bench-out site
