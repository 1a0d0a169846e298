# Each chore is one command. Python 3.11 and make are all that has to be there.
PYTHON ?= python3
BIN := .venv/bin

.PHONY: setup demo test slow lint bench wheel clean

setup: .venv/ready

.venv/ready: requirements.lock pyproject.toml
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "islands needs Python 3.11 or newer: make PYTHON=python3.11")'
	$(PYTHON) -m venv .venv
	$(BIN)/pip install --disable-pip-version-check --require-hashes -r requirements.lock
	$(BIN)/pip install --disable-pip-version-check --no-build-isolation --no-deps -e .
	touch $@

demo: setup
	$(BIN)/islands demo --out demo-out

test: setup
	$(BIN)/pytest -n 2 --dist loadgroup

slow: setup
	$(BIN)/pytest -n 2 --dist loadgroup -m "slow or measured or browser"

lint: setup
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports --no-cache

bench: setup
	$(BIN)/islands bench

wheel: setup
	$(BIN)/python -m build --no-isolation --wheel --outdir dist .

clean:
	rm -rf .venv dist demo-out bench-out
