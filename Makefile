# make env | run | test | test-wheel | lint | docs | measure | verify | bench
# The interpreter is the first of PYTHON, python3, python3.13, python3.12, python3.11 that is 3.11 or newer.

SHELL := /bin/bash
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed

export OPENBLAS_NUM_THREADS ?= 1

.PHONY: env run test test-wheel lint docs measure verify bench clean

env: $(STAMP)

$(STAMP): pyproject.toml
	@for python in "$(PYTHON)" python3.13 python3.12 python3.11; do \
	  if "$$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then found="$$python"; break; fi; \
	done; \
	if [ -z "$${found:-}" ]; then \
	  echo "make: no Python 3.11 or newer found; install one, or name it: make env PYTHON=/path/to/python3.11" >&2; \
	  exit 2; \
	fi; \
	echo "Environment in $(VENV), with $$("$$found" --version)" && "$$found" -m venv $(VENV)
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[dev]'
	@touch $@

run: env
	$(BIN)/orchestrator build
	$(BIN)/orchestrator compare landing_200m_point9

test: env
	@$(BIN)/python -m fmus.face.first_use
	$(BIN)/python -m pytest -q

test-wheel: env
	$(BIN)/python -m pytest -q -m slow tests/test_wheel.py

lint: env
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/pyright
	$(BIN)/lint-imports

$(VENV)/.docs: $(STAMP)
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[docs]'
	@touch $@

docs: $(VENV)/.docs
	$(BIN)/python -m sphinx -q -n -W --keep-going -b html docs docs/_build/html
	@echo "docs/_build/html/index.html"

measure: env
	$(BIN)/python docs/measured.py

verify: env
	$(BIN)/python -m verification
	$(BIN)/python -m pytest -q -m slow

bench: env
	@for file in $(wildcard benchmarks/*.py); do echo "== $$file"; $(BIN)/python "$$file"; done

clean:
	rm -rf $(VENV) build dist
