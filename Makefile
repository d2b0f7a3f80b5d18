# Everything runs in .venv, which the first `make` of any target makes.
# `make help` lists the targets.

VENV := .venv
BIN := $(VENV)/bin
INSTALLED := $(VENV)/.installed
DEVELOPER := $(VENV)/.developer

export UNIT

.DEFAULT_GOAL := help
.PHONY: help rig-demo test-can calib-header simulate test check lint types nightly bench golden clean

help:  ## List the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / {printf "  make %-28s %s\n", $$1, $$2}' $(MAKEFILE_LIST)
	@echo
	@echo "  Units:" $$(ls units)

calib-header: $(INSTALLED)  ## UNIT=<name>: fit, generate, prove and cross-check the C of a unit
	@if [ -z "$$UNIT" ]; then \
	    echo "make: UNIT is missing; say make calib-header UNIT=<name>, one of:" $$(ls units) >&2; exit 1; fi
	@$(BIN)/triaxcal calib "units/$$UNIT"

simulate: $(INSTALLED)  ## UNIT=<name>: write the measurements of a simulated unit again
	@$(BIN)/triaxcal simulate "units/$$UNIT"

test: $(DEVELOPER)  ## Tests (under 3 minutes)
	@$(BIN)/pytest -q -m "not slow"

check: lint types test  ## What CI runs: lint, types, tests

lint: $(DEVELOPER)
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .

types: $(DEVELOPER)
	@$(BIN)/mypy

nightly: $(DEVELOPER)  ## The slow campaigns as well
	@$(BIN)/pytest -q

golden: $(DEVELOPER)  ## Write the golden files anew; look at the difference before committing it
	@$(BIN)/pytest -q tests/test_golden.py --update-golden

bench: $(DEVELOPER)  ## Benchmarks, as ratios within one run
	@$(BIN)/python bench/calib_header.py
	@$(BIN)/python bench/rig_decode.py
	@$(BIN)/python bench/rig_receive.py
	@$(BIN)/python bench/rig_stillness.py

test-can: $(DEVELOPER)  ## The bench on real SocketCAN: this machine's vcan, or QEMU (2 minutes)
	@rig/test-can.sh

rig-demo: $(DEVELOPER)  ## A whole session on the simulated rig, to a header (2 minutes)
	@$(BIN)/triaxcal rig run --bus virtual --unit AT-SIM-BENCH --plain --sessions build/rig-demo
	@$(MAKE) --no-print-directory calib-header UNIT=AT-SIM-BENCH

clean:  ## Remove what make made
	rm -rf build $(VENV) .pytest_cache .mypy_cache .ruff_cache .hypothesis

$(INSTALLED): pyproject.toml constraints.txt
	@command -v python3 >/dev/null || { echo "make: python3 not found; sudo apt-get install python3" >&2; exit 1; }
	@echo "setting up $(VENV) (once) ..."
	@python3 -m venv $(VENV) || { rm -rf $(VENV); \
	    echo "make: python3 cannot make an environment; sudo apt-get install python3-venv" >&2; exit 1; }
	@$(BIN)/pip install --quiet --disable-pip-version-check -c constraints.txt -e .
	@touch $@

$(DEVELOPER): $(INSTALLED)
	@echo "adding the developers' tools to $(VENV) (once) ..."
	@$(BIN)/pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[dev,rig]'
	@touch $@
