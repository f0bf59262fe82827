# softstart: two commands do everything on a machine with Python 3.11+ and make.
#   make compare   the main job on the crane drive: table, plots, report in results/
#   make test      the whole test suite
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check --quiet

.PHONY: compare test lint types layers benchmark clean

compare: $(VENV)/.installed
	$(BIN)/softstart compare --out results

test: $(VENV)/.installed-test
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -n auto --dist worksteal  # a worker a core: more threads spin

lint: $(VENV)/.installed-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(VENV)/.installed-dev
	$(BIN)/mypy

layers: $(VENV)/.installed-dev
	$(BIN)/lint-imports

benchmark: $(VENV)/.installed-benchmark
	$(BIN)/softstart study benchmark-starts --out results/benchmark-starts
	$(BIN)/softstart study benchmark-optima --out results/benchmark-optima
	$(BIN)/softstart study benchmark-sweeps --out results/benchmark-sweeps
	$(BIN)/softstart study benchmark-chains --out results/benchmark-chains

clean:
	rm -rf $(VENV) results

$(VENV)/.installed: pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "softstart needs Python 3.11 or newer; say which with: make PYTHON=python3.12 ...")'
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	@echo "installing softstart and its libraries into $(VENV) (once, a minute or two)"
	$(PIP) install --editable .
	@touch $@

$(VENV)/.installed-test: $(VENV)/.installed
	$(PIP) install --editable '.[test]'
	@touch $@

$(VENV)/.installed-dev: $(VENV)/.installed-test
	$(PIP) install --editable '.[dev]'
	@touch $@

$(VENV)/.installed-benchmark: $(VENV)/.installed-test
	$(PIP) install --editable '.[benchmark]'
	@touch $@
