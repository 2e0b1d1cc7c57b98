# Two commands do everything, on a machine with Python 3.11 to 3.14 and make:
#   make sweep   set up, run a small benchmark (a minute on two cores), print the table, write the report
#   make test    set up, check style and types, build the documentation, run every test
# and one the headline of the project (40 trials per cell take some two hours on two cores):
#   make headline [TRIALS=40] [FIDELITY=near-contact]

PYTHON ?= python3
WORKERS ?= 2
FIDELITY ?= near-contact
sweep: TRIALS ?= 6
sweep: OUT ?= runs/sweep
headline: TRIALS ?= 40
headline: OUT ?= runs/headline_$(FIDELITY)

VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --quiet --disable-pip-version-check
NUMERIC = $(BIN)/python -m benchmarks.switches $(BIN)/pytest -q -m "numeric and not slow" -n {processes} \
    $$(grep -rl pytest.mark.numeric tests --include=test_*.py)
MIN := import sys; sys.exit(not (3, 11) <= sys.version_info < (3, 15))

export OMP_NUM_THREADS := 1
export OPENBLAS_NUM_THREADS := 1

.PHONY: sweep headline test style types contracts site test-extras numeric docs lowest clean

sweep: $(VENV)/.installed
	$(BIN)/apo-bench sweep benchmarks/demo.toml --trials $(TRIALS) --workers $(WORKERS) --out $(OUT)
	@$(BIN)/apo-bench report $(OUT) | sed -n '/^Answer/,$$p'

headline: $(VENV)/.installed
	$(BIN)/apo-bench sweep benchmarks/headline.toml --trials $(TRIALS) --fidelity $(FIDELITY) --workers $(WORKERS) \
	    --out $(OUT)
	$(BIN)/apo-bench report $(OUT)

# bytecode of the package and its tests is kept, as hundreds of processes are started
test numeric: export PYTHONDONTWRITEBYTECODE :=
# what needs one core runs beside what needs the other; three processes for two cores, as some tests wait for a process
# or a limit; how long each test took is kept in build/durations.xml
test: $(VENV)/.installed-dev
	$(MAKE) --jobs 2 types site style contracts
	$(BIN)/pytest -q -n 3 --dist worksteal -m "not extras" --durations=10 --junitxml=build/durations.xml
	$(NUMERIC)

types: $(VENV)/.installed-dev
	$(BIN)/mypy

site: $(VENV)/.installed-dev
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --site-dir build/site  # `--quiet` would not count warnings

style: $(VENV)/.installed-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/codespell

contracts: $(VENV)/.installed-dev
	$(BIN)/lint-imports --no-logo --no-cache

# the tests that start a Ray cluster or read STEP files
test-extras: $(VENV)/.installed-dev
	$(BIN)/pytest -q -m extras $$(grep -rl pytest.mark.extras tests --include=test_*.py)

# the tests marked numeric, under every other kernel of OpenBLAS and NumPy that the processor allows
numeric: $(VENV)/.installed-dev
	$(NUMERIC)

# the documentation as a site, at http://127.0.0.1:8000; what is built lies in build/site
docs: $(VENV)/.installed-dev
	$(BIN)/mkdocs serve --strict

# the oldest versions that pyproject.toml allows, in an environment of their own
lowest: $(BIN)/python
	$(BIN)/python benchmarks/lowest.py

clean:
	rm -rf $(VENV) build dist runs .pytest_cache .mypy_cache .ruff_cache .hypothesis

$(BIN)/python:
	@$(PYTHON) -c '$(MIN)' || { echo "Python 3.11 to 3.14 is needed (daqp, manifold3d and ray have no wheels for 3.15); say which with: make PYTHON=python3.13 $(MAKECMDGOALS)"; exit 1; }
	$(PYTHON) -m venv $(VENV)

$(VENV)/.installed: pyproject.toml | $(BIN)/python
	$(PIP) install --editable .
	@touch $@

$(VENV)/.installed-dev: pyproject.toml | $(BIN)/python
	$(PIP) install --editable '.[dev]'
	@touch $@ $(VENV)/.installed
