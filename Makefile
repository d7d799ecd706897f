# make all    environment, then every result and figure     make test   environment, then the tests
# make quick  the same chain on config/quick.yaml            make lint   all that is asked of the text alone
# make check  lint, then the quick tests                      make docs   the files written from the code
# make bench  what a passage costs, one to seven minutes on an idle machine

PYTHON ?= $(shell command -v python3.11 || command -v python3)
CORES ?= 2
VENV := .venv
BIN := $(VENV)/bin

export PATH := $(CURDIR)/$(BIN):$(PATH)
export NUMBA_CACHE_DIR ?= $(CURDIR)/.numba_cache
export OMP_NUM_THREADS ?= 1
# what is installed comes from the lock files alone
export PIP_DISABLE_PIP_VERSION_CHECK := 1

.PHONY: all quick test lint check bench docs unlock
.DEFAULT_GOAL := all

$(BIN)/python:
	$(PYTHON) -m venv $(VENV)

$(VENV)/core.stamp: requirements.lock pyproject.toml | $(BIN)/python
	$(BIN)/python -m pip install --quiet --require-hashes --no-deps -r requirements.lock
	$(BIN)/python -m pip install --quiet --no-deps --no-build-isolation -e .
	touch $@

$(VENV)/dev.stamp: requirements-dev.lock pyproject.toml | $(BIN)/python
	$(BIN)/python -m pip install --quiet --require-hashes --no-deps -r requirements-dev.lock
	$(BIN)/python -m pip install --quiet --no-deps --no-build-isolation -e .
	touch $@ $(VENV)/core.stamp

# a run that was killed leaves its lock behind: take it away if no run is alive
unlock: $(VENV)/core.stamp
	@$(BIN)/python workflow/scripts/unlock.py

all: $(VENV)/core.stamp unlock
	snakemake all --cores $(CORES)

quick: $(VENV)/core.stamp unlock
	snakemake all --cores $(CORES) --configfile config/quick.yaml

test: $(VENV)/dev.stamp
	pytest --numprocesses $(CORES)

# format, lint, contracts of imports, types, and the workflow's own lint
lint: $(VENV)/dev.stamp
	ruff format --check .
	ruff check .
	lint-imports
	mypy
	snakefmt --check Snakefile workflow
	snakemake --lint

check: lint
	pytest --numprocesses $(CORES) -m "not slow"

# alone on the machine; BENCH=--quick for a minute's run
bench: $(VENV)/core.stamp
	$(BIN)/python benchmarks/bench_passage.py $(BENCH)

# the files that are written from the code
docs: $(VENV)/core.stamp
	maglev describe config > config/config.yaml
	maglev describe schema > workflow/schemas/config.schema.yaml
	maglev describe parameters > docs/parameters.md
	maglev describe datasets > docs/datasets.md
	maglev describe stages > docs/stages.md
	python workflow/scripts/environments.py
