# softstart: two commands do everything on a machine with Python 3.11+ and make.
#   make compare        the main job on the crane drive: table, plots, report in results/
#   make test           the test suite, three minutes on two cores; without the slow tests
#   make serve          the interactive page, in the browser
# and for those who work on it (CONTRIBUTING.md):
#   make check                 lint, types, layers and the tests of what has changed: under two minutes
#   make lint types layers     ruff, mypy, import-linter
#   make slow                  the tests that `make test` leaves out: each takes 0.5 s of processor time or more
#   make fuzz                  the property tests with newly drawn examples (the suite always draws the same)
#   make page                  tests of the page in a real browser (needs chromium); ONLY='-m alone': its speed
#   make export-test           exports by a C compiler, FMU simulator and parser; ONLY='-m slow': Arm in emulation
#   make pictures              the pictures of README and documentation (needs chromium)
#   make floors                a hundred tests on the oldest libraries that pyproject.toml allows
#   make pythons               every library has a wheel for each Python that softstart supports
#   make docs                  the documentation, warnings are errors; GALLERY=0: without running its examples
#   make docs-commands         every command shown in it is run, on WORKERS cores (2); ONLY='-m slow': long pages
#   make package               sdist and wheel into dist/; package-check looks into both and installs the wheel,
#                              package-test runs all tests from both, each in an empty folder
#   make benchmark             speed and optima beside other packages
PYTHON ?= python3
WORKERS ?= 2
VENV := .venv
FLOORS := .venv-floors
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check --quiet
# uv installs in a third of pip's time; where there is none for a machine, pip does it
UV := $(BIN)/uv pip install --quiet --python $(BIN)/python
install = ($(PIP) install --only-binary :all: uv && $(UV) --editable '$(1)') || $(PIP) install --editable '$(1)'
EVERYTHING := .[dev,docs,page,package,export-test]

unexport PYTHONDONTWRITEBYTECODE  # hundreds of processes: each would recompile all modules

.PHONY: compare test slow check fuzz everything floors pythons serve lint types layers page export-test pictures package package-check package-test benchmark docs docs-commands clean

compare: $(VENV)/.installed
	$(BIN)/softstart compare --out results

test: $(VENV)/.installed-test
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -n auto --dist worksteal -m "not slow"  # a worker a core

slow: $(VENV)/.installed-test
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -n auto --dist worksteal -m slow

check: $(VENV)/.installed-dev lint types layers
	OPENBLAS_NUM_THREADS=1 $(BIN)/python .ci/touched.py | xargs $(BIN)/python -m pytest -q -n auto -m "not slow"

fuzz: $(VENV)/.installed-test
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -q -n auto -m hypothesis --hypothesis-profile=fuzz tests

lint: $(VENV)/.installed-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(VENV)/.installed-dev
	$(BIN)/mypy

layers: $(VENV)/.installed-dev
	$(BIN)/lint-imports

floors: $(FLOORS)/.installed
	OPENBLAS_NUM_THREADS=1 NUMBA_CACHE_DIR=$(CURDIR)/$(FLOORS)/kernels $(FLOORS)/bin/softstart compare
	OPENBLAS_NUM_THREADS=1 NUMBA_CACHE_DIR=$(CURDIR)/$(FLOORS)/kernels $(FLOORS)/bin/python -m pytest -q --few-kernels -W default \
		tests/softstart/drive tests/softstart/kernel/test_anchors.py tests/softstart/test_documents.py \
		tests/softstart/test_profile.py tests/softstart/test_quantities.py tests/softstart/test_store.py \
		tests/validation/test_gerasymiak_subbotin.py

everything: $(VENV)/.installed-test
	@$(call install,$(EVERYTHING))
	@touch $(addprefix $(VENV)/.installed-,dev docs ui page package export-test)

serve: $(VENV)/.installed-ui
	$(BIN)/softstart serve

page: $(VENV)/.installed-page
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest tests/page --page -m "not slow and not alone" \
		-o cache_dir=.pytest_cache/page $(ONLY)

export-test: $(VENV)/.installed-export-test
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest tests/export --export -n auto --dist worksteal -m "not slow" $(ONLY)

pictures: $(VENV)/.installed-page
	SOFTSTART_PICTURES=docs/_static $(BIN)/python -m pytest -q tests/page/test_pictures.py --page

docs: $(VENV)/.installed-docs
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m sphinx -b html -n -W --keep-going docs docs/_build/html
	@echo "open docs/_build/html/index.html"

docs-commands: $(VENV)/.installed-test
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest tests/docs --docs-commands -n $(WORKERS) --dist worksteal \
		-m "not slow" $(ONLY)

pythons: $(VENV)/.installed-dev
	for version in 3.11 3.12 3.13 3.14; do $(BIN)/uv pip compile --quiet --python-version $$version \
		--only-binary :all: --no-binary tree-sitter-iec61131-3-st --all-extras pyproject.toml >/dev/null && echo "all wheels for Python $$version" || exit 1; done

package: $(VENV)/.installed-package
	rm -rf dist
	$(BIN)/python -m build --outdir dist .

package-check: package
	$(BIN)/python .ci/package.py dist

package-test: package
	$(BIN)/python .ci/package.py dist --whole

benchmark: $(VENV)/.installed
	$(BIN)/softstart study benchmark-starts --out results/benchmark-starts
	$(BIN)/softstart study benchmark-optima --out results/benchmark-optima

clean:
	rm -rf $(VENV) $(FLOORS) results dist docs/_build docs/gallery_pages

$(VENV)/.installed: pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "softstart needs Python 3.11 or newer; say which with: make PYTHON=python3.12 ...")'
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	@echo "installing softstart and its libraries into $(VENV) (once, half a minute or more)"
	@$(call install,.)
	@touch $@

$(VENV)/.installed-test: $(VENV)/.installed
	@$(call install,.[test])
	@touch $@

$(VENV)/.installed-dev: $(VENV)/.installed-test
	@$(call install,.[dev])
	@touch $@

$(FLOORS)/.installed: pyproject.toml $(VENV)/.installed-dev
	rm -rf $(FLOORS)
	$(BIN)/uv venv --quiet --python 3.11 $(FLOORS)
	$(BIN)/uv pip install --quiet --python $(FLOORS)/bin/python --resolution lowest-direct --editable '.[test]'
	@touch $@

$(VENV)/.installed-docs: $(VENV)/.installed
	@$(call install,.[docs])
	@touch $@

$(VENV)/.installed-ui: $(VENV)/.installed
	@$(call install,.[ui])
	@touch $@

$(VENV)/.installed-page: $(VENV)/.installed-test
	@$(call install,.[page])
	@touch $@

$(VENV)/.installed-export-test: $(VENV)/.installed-test
	@$(call install,.[export-test])
	@touch $@

$(VENV)/.installed-package: $(VENV)/.installed-test
	@$(call install,.[package])
	@touch $@
