# Two commands do all set-up on a machine with python3 >= 3.11, make and the package index:
#   make demo   the main job on a simulated building      make test   the tests
PYTHON ?= python3
UV_VERSION := 0.13.9
VENV := .venv
STAMP := $(VENV)/.wayfuse-setup
WEB := src/wayfuse/service/web
PAGE := $(WEB)/assets/built.sha256.txt
# a process for each core, at most four; the tests of a file stay together, for they share its servers
PARALLEL := -n auto --maxprocesses 4 --dist loadfile

.PHONY: setup sionna web demo test test-fast check lint types imports cov results bench clean

setup: $(STAMP) $(PAGE)

$(STAMP): pyproject.toml uv.lock
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "wayfuse needs python3 >= 3.11 ($(PYTHON) is older): set PYTHON=/path/to/python3.11"; exit 2; }
	$(PYTHON) -m venv --clear $(VENV)
	$(VENV)/bin/python -m pip install --quiet --disable-pip-version-check uv==$(UV_VERSION)
	UV_PROJECT_ENVIRONMENT=$(VENV) $(VENV)/bin/uv sync --locked --inexact --quiet --python $(VENV)/bin/python
	@touch $@

# the ray tracer of `wayfuse simulate`, an optional extra; it needs an LLVM library too (Debian: libllvm19)
sionna: setup
	UV_PROJECT_ENVIRONMENT=$(VENV) $(VENV)/bin/uv sync --locked --inexact --quiet --extra sionna --python $(VENV)/bin/python

# what the page of `wayfuse serve` loads besides its own files: the map library, from npm, as locked
web: $(PAGE)

$(PAGE): $(WEB)/package-lock.json $(WEB)/build.py | $(STAMP)
	$(VENV)/bin/python -m wayfuse.service.web.build
	@touch $@

demo: setup
	$(VENV)/bin/wayfuse demo --out demo-out

test: setup lint types imports
	$(VENV)/bin/python -m pytest $(PARALLEL)

test-fast: setup
	$(VENV)/bin/python -m pytest $(PARALLEL) -m "not slow"

check: test

lint: setup
	$(VENV)/bin/ruff check src tests benchmarks scripts docs/skeletons
	$(VENV)/bin/ruff format --check src tests benchmarks scripts docs/skeletons

types: setup
	$(VENV)/bin/mypy

imports: setup
	$(VENV)/bin/lint-imports

cov: setup
	NUMBA_DISABLE_JIT=1 $(VENV)/bin/python -m pytest --cov --cov-report=term-missing:skip-covered -m "not slow"

bench: setup
	UV_PROJECT_ENVIRONMENT=$(VENV) $(VENV)/bin/uv sync --locked --inexact --quiet --group bench --python $(VENV)/bin/python
	$(VENV)/bin/python -m benchmarks

results: setup
	$(VENV)/bin/wayfuse results --out docs/results.md

clean:
	rm -rf $(VENV) $(WEB)/assets demo-out .mypy_cache .ruff_cache .pytest_cache .hypothesis
