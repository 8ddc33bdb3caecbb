# What people type: `make run`, `make test`. Everything lives in .venv; nothing needs root.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
INSTALLED := $(VENV)/.installed
CONSOLE := $(VENV)/.installed-console
DEV := $(VENV)/.installed-dev

# Else every process that a test starts would compile all that it imports.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: run console test tests docs test-newest test-lowest docs-check docs-quotes lint types layers bench mutants release lock clean help

help: ## this list
	@grep -E '^[a-z-]+[a-z -]*:.*##' $(MAKEFILE_LIST) | sed 's/:.*## /\t/'

# What resolves versions; it is pinned nowhere, since nothing else depends on it.
UV := .venv-uv/bin/uv
COMPILE := $(UV) pip compile --quiet --upgrade --universal --python-version 3.11 --generate-hashes --custom-compile-command 'make lock' --output-file
$(UV):
	$(PYTHON) -m venv .venv-uv
	.venv-uv/bin/python -m pip install --quiet --disable-pip-version-check uv

PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check
LOCKED := $(PIP) --require-hashes

# What it takes to run. Imported modules compile on first use, so pip need not compile all of them.
$(INSTALLED): pyproject.toml requirements/run.txt
	$(PYTHON) -m venv $(VENV)
	$(LOCKED) --no-compile --requirement requirements/run.txt
	$(PIP) --no-compile --no-deps --no-build-isolation --editable .
	@touch $@

# What it takes to test, beside that. One package has no wheel, and is built by what is installed.
$(DEV): $(INSTALLED) requirements/dev.txt
	$(LOCKED) --no-build-isolation --requirement requirements/dev.txt
	@touch $@

# What the operator's page takes beside that.
$(CONSOLE): $(INSTALLED) requirements/console.txt
	$(LOCKED) --requirement requirements/console.txt
	@touch $@

console: $(CONSOLE) ## the operator's page on the virtual stage
	$(BIN)/stagectl console --simulate

run: $(INSTALLED) ## run the inspection recipe on the virtual stage
	$(BIN)/stagectl run recipes/inspection-20.yaml --simulate --out runs/inspection-20

# What is marked slow is left to CI: make test SLOW=1.
FAST = $(if $(SLOW),, and not slow)

# First what a busy machine only delays, several at a time: one more than there are processors, for
# some of it mostly waits. Then what goes by this machine's clock: it waits still more, so that the
# longest file of it, which waits for a guest, runs beside the others.
# In their order, the long files of tests/system come first and none is left over for one process.
# Of the latter only files that have any are collected: to import all of them takes long.
# Files that tests read are UTF-8, whatever the locale.
IN_REAL_TIME = grep -rlE "real_time|every_bus" tests --include="test_*.py" | sort
WORKERS = $$(($$(nproc) < 8 ? $$(nproc) + 1 : 8))
IN_ORDER = --dist loadfile --no-loadscope-reorder
define run_tests
	PYTHONUTF8=1 STAGECTL_REQUIRE_VCAN= $(1)/bin/python -m pytest -m "not real_time$(FAST)" -n $(WORKERS) $(IN_ORDER)
	PYTHONUTF8=1 $(1)/bin/python -m pytest -m "real_time$(FAST)" -n 2 $(IN_ORDER) $$($(IN_REAL_TIME))
endef

test: $(DEV) lint types layers ## lint, types, layers, all tests but slow ones; SLOW=1: those, too
	$(call run_tests,$(VENV))

tests: $(DEV) ## the tests alone
	$(call run_tests,$(VENV))

# Not with the locked versions, but with what the index has today; on demand, not in CI.
test-newest: RESOLUTION := highest
test-lowest: RESOLUTION := lowest-direct
test-newest test-lowest: test-%: $(UV) ## all tests with the newest or lowest versions that pyproject.toml allows
	$(UV) venv --quiet --clear --seed --python $(PYTHON) .venv-$*
	$(UV) pip install --quiet --python .venv-$* --resolution $(RESOLUTION) --group dev --editable '.[postgres,export]'
	$(call run_tests,.venv-$*)

docs-check: $(DEV) ## all commands of README and docs, with what the docs quote of their output
	$(BIN)/python tools/docs_commands.py check

docs-quotes: $(DEV) ## quote anew in README and docs what their commands print
	$(BIN)/python tools/docs_commands.py quotes

docs: $(DEV) ## the documentation as a site, in docs/_build/html; every warning is an error
	$(BIN)/sphinx-build -q -W --keep-going -b html docs docs/_build/html

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
	$(LOCKED) --requirement requirements/mutants.txt
	nice -n 19 $(BIN)/mutmut run --max-children 1

release: $(DEV) ## wheel, sdist, list of parts (SBOM) and licences in dist/, checked; on demand
	$(PYTHON) -m venv .venv-release
	.venv-release/bin/python -m pip install --quiet --disable-pip-version-check --require-hashes --requirement requirements/release.txt
	.venv-release/bin/python tools/release.py

lock: $(UV) ## requirements/ anew, with the newest versions that pyproject.toml allows
	$(COMPILE) requirements/run.txt --group build pyproject.toml
	$(COMPILE) requirements/dev.txt --constraint requirements/run.txt --all-extras --group dev pyproject.toml
	$(COMPILE) requirements/console.txt --constraint requirements/dev.txt --extra console pyproject.toml
	$(COMPILE) requirements/mutants.txt --constraint requirements/dev.txt --group mutants
	$(COMPILE) requirements/release.txt --constraint requirements/dev.txt --group release pyproject.toml

clean: ## remove what was built
	rm -rf $(VENV) .venv-* dist runs mutants .pytest_cache .mypy_cache .ruff_cache .import_linter_cache
