# Each chore is one command. Python 3.11 and make are all that has to be there.
PYTHON ?= python3
BIN := .venv/bin

# INSTALL_OPTIONS=--pip installs everything by pip instead of uv.
INSTALL := $(PYTHON) deploy/packages/install.py .venv $(INSTALL_OPTIONS)

.PHONY: help setup demo collect test ci nightly soak fuzz load lint kernels bench docs lock sbom licences audit wheel release clean

# The first target, so that `make` alone prints it.
help:
	@echo 'make demo     set up, identify a record, show the result: 30 s on a fresh machine with two cores'
	@echo 'make test     the tests: 130 s'
	@echo 'make setup    the environment .venv with what runs: Ray and the service'
	@echo 'make lint     format, types, imports     make docs   the site     make bench   speed on this machine'
	@echo 'CONTRIBUTING.md describes the others.'

# What runs: core, Ray, service. Other targets add their groups of packages when they are first called.
setup: .venv/ready

.venv/ready: requirements.lock pyproject.toml deploy/packages/install.py deploy/packages/compile_modules.py
	@$(INSTALL) --extra ray --extra service --group build --project
	@touch $@

.venv/ready-%: .venv/ready
	@$(INSTALL) --extra all --group $*
	@touch $@

demo: setup
	@$(BIN)/islands demo --out demo-out

# By file, since fixtures of modules are costly, and in the order of collection, which has the long files first.
PYTEST := $(BIN)/pytest --costs --dist loadfile --no-loadscope-reorder

# Bytecode of rewritten assertions is kept between runs, whatever the environment says: it halves the collection.
unexport PYTHONDONTWRITEBYTECODE

# Compile the sources and rewrite the assertions of all tests once. Otherwise each worker of the first run does.
collect: .venv/ready-test
	$(BIN)/pytest --collect-only -q >/dev/null

# As many workers as cores: another one would use the time in which tests wait, and collect all tests once more.
test: .venv/ready-test .venv/ready-lint .venv/ready-docs
	$(PYTEST) -n 2

# What CI runs besides `make test`: browser, PostgreSQL, kills of a coordinator and of an island. More of these tests
# wait: for processes, pages and databases. The tests of the wheel need one, which .ci/run builds first.
ci: .venv/ready-test .venv/ready-lint .venv/ready-docs .venv/ready-packages
	$(PYTEST) -n 4 -m "ci and not nightly" --ignore tests/acceptance/test_installed_wheel.py

# Another order and other kills every day of the year.
DAY = $(shell date +%j)

# Everything else: the remaining slow tests, the properties with many examples, 500 random kills, and mutated files.
nightly: .venv/ready-test .venv/ready-lint .venv/ready-docs .venv/ready-packages
	$(PYTEST) -n 2 --timeout 1200 --random-order --random-order-seed $(DAY) \
		--hypothesis-profile thorough -m "nightly or hypothesis"
	$(MAKE) soak fuzz

# 500 random kills and suspensions of a service on each database: no job may be lost or duplicated, and results must
# be identical.
soak: .venv/ready-test
	$(BIN)/python -m lab.service.soak --kills 500 --seed $(DAY)
	$(BIN)/python -m lab.service.soak --kills 500 --seed $(DAY) --database postgresql

# Five minutes of mutated files for all readers of uploads, and five of short and extreme records for the searches.
fuzz: .venv/ready-test
	$(BIN)/python -m lab.fuzzing.readers --seconds 300 --seed $(DAY)
	$(BIN)/python -m lab.fuzzing.searches --seconds 300 --seed $(DAY)

# Figures of a service under load, on a machine that should be otherwise idle.
load: .venv/ready-test
	$(BIN)/python -m lab.service.load --repeat 5

lint: .venv/ready-lint
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports --no-cache

# The machine code of all kernels, which is part of the package: after a change of a kernel or of its imports. 100 s of CPU.
kernels: .venv/ready-test
	$(BIN)/python deploy/packages/compile_kernels.py

bench: setup
	$(BIN)/islands bench

# The theme prints a notice about a later version of MkDocs, which is not installed.
docs: .venv/ready-docs
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --site-dir site

# Pin the newest versions that pyproject.toml admits and that the lock file does not pin yet; LOCK_OPTIONS=--upgrade for all.
# The tools alone are installed before, since the lock file may not agree with pyproject.toml yet.
lock:
	@$(INSTALL) --tools --group build
	$(BIN)/uv pip compile pyproject.toml --quiet --all-extras --group build --group docs --group lint --group packages \
		--group test --generate-hashes --custom-compile-command 'make lock' --output-file requirements.lock $(LOCK_OPTIONS)

# What the image contains, in CycloneDX. The file depends on requirements.lock and pyproject.toml only.
sbom: .venv/ready-packages
	$(BIN)/python deploy/packages/write_sbom.py --output dist/islands-sbom.json

# Every locked package has a licence of deploy/packages/licences.toml.
licences: .venv/ready-packages .venv/ready-test .venv/ready-lint .venv/ready-docs
	$(BIN)/python deploy/packages/check_licences.py

# Known vulnerabilities of the locked packages. Exit code 2 of the script: not checked, for lack of a service.
audit: .venv/ready-packages
	$(BIN)/python deploy/packages/audit_packages.py

wheel: setup
	$(BIN)/python -m build --no-isolation --wheel --outdir dist .

# Source archive and wheel with hashes in dist/, tested on Python 3.11, 3.12 and 3.13, with all extras and with the core only: a
# quarter of an hour, and an index of packages.
release: setup
	.ci/release

clean:
	rm -rf .venv build dist demo-out bench-out site
