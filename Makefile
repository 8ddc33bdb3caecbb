# What people type: `make run`, `make test`. Everything lives in .venv; nothing needs root.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
INSTALLED := $(VENV)/.installed
DEV := $(VENV)/.installed-dev

.PHONY: run test lint types layers bench mutants clean help

help: ## this list
	@grep -E '^[a-z]+:.*##' $(MAKEFILE_LIST) | sed 's/:.*## /\t/'

PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check

# What it takes to run. Imported modules compile on first use, so pip need not compile all of them.
$(INSTALLED): pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(PIP) --no-compile --editable .
	@touch $@

# What it takes to test, beside that. --group needs pip 25.1, which older Pythons' venvs do not bring.
$(DEV): $(INSTALLED)
	$(PIP) --upgrade 'pip>=25.1'
	$(PIP) --group dev
	@touch $@

run: $(INSTALLED) ## run the inspection recipe on the virtual stage
	$(BIN)/stagectl run recipes/inspection-20.yaml --simulate --out runs/inspection-20

# First what goes by virtual time, several at a time; then what goes by this machine's clock, alone.
# In their order, the long files of tests/system come first and none is left over for one process.
test: $(DEV) lint types layers ## lint, types, layers, all tests
	STAGECTL_REQUIRE_VCAN= $(BIN)/python -m pytest -m "not real_time" -n auto --maxprocesses 8 --dist loadfile --no-loadscope-reorder
	$(BIN)/python -m pytest -m real_time

lint: $(DEV) ## ruff
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(DEV) ## mypy --strict
	$(BIN)/mypy

layers: $(DEV) ## import contracts
	$(BIN)/lint-imports

bench: $(DEV) ## figures of docs/figures.md, and ratios of the hot paths
	$(BIN)/python -m benchmarks.settling.run_figures
	$(BIN)/python -m benchmarks.rates.cycle_rate
	$(BIN)/python -m benchmarks.rates.simulation_rate
	$(BIN)/python -m benchmarks.rates.cycle_peers

mutants: $(DEV) ## mutants of what must not fail unseen; an hour, on demand
	$(PIP) --group mutants
	nice -n 19 $(BIN)/mutmut run --max-children 1

clean: ## remove what was built
	rm -rf $(VENV) runs mutants .pytest_cache .mypy_cache .ruff_cache .import_linter_cache
