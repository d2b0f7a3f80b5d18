# Everything runs in .venv, which the first `make` of any target makes.
# `make help` lists the targets.

VENV := .venv
BIN := $(VENV)/bin
INSTALLED := $(VENV)/.installed
DEVELOPER := $(VENV)/.developer
WRITER := $(VENV)/.writer
BENCHES := $(VENV)/.benches

# A file stays on one core, so that its compiled fixtures are made once. The tests start the command
# a hundred times: with bytecode of the sources as they are, also where Python writes none itself.
PYTEST := $(BIN)/python -m compileall -q toolchain && $(BIN)/pytest -q -n auto --dist loadfile

export UNIT EVERY

# A unit is named, not given by path: the command line takes paths.
NAMED = case "$$UNIT" in \
    "") echo "make: UNIT is missing; say UNIT=<name>, one of:" $$(ls units) >&2; exit 1;; \
    */*) echo "make: UNIT=$$UNIT is a path; say UNIT=<name>, one of:" $$(ls units) >&2; exit 1;; esac

.DEFAULT_GOAL := help
.PHONY: help series test-versions test-long test-verify rig-demo test-can calib-header verify certify fuzz mutation mutation-by-proof simulate test check lint types nightly bench golden docs clean test-targets bench-target

help:  ## List the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / {printf "  make %-28s %s\n", $$1, $$2}' $(MAKEFILE_LIST)
	@echo
	@echo "  Units:" $$(ls units)

calib-header: $(INSTALLED)  ## UNIT=<name>: fit, generate, prove and cross-check the C of a unit
	@$(NAMED)
	@$(BIN)/triaxcal calib "units/$$UNIT"

series: $(INSTALLED)  ## Every unit of units/ that is not done yet, and a page about them all
	@$(BIN)/triaxcal batch units/*

verify: $(INSTALLED)  ## UNIT=<name>: Gappa, Frama-C, cppcheck, gcc and clang on the C of a unit
	@$(NAMED)
	@$(BIN)/triaxcal verify "units/$$UNIT"

certify: $(INSTALLED)  ## UNIT=<name>: the error bound as theorems that Coq checks (minutes)
	@$(NAMED)
	@$(BIN)/triaxcal certify "units/$$UNIT"

fuzz: $(DEVELOPER)  ## Images against the loaders, text against the parsers, for a minute
	@$(BIN)/python fuzz/run.py

mutation: $(DEVELOPER)  ## EVERY=<n>: does the vector set find each n-th mutant of the generated C?
	@$(BIN)/python fuzz/mutation.py --every "$${EVERY:-1}"

mutation-by-proof: $(DEVELOPER)  ## EVERY=<n>: does WP refuse each n-th mutant, as the vectors do? (an hour for all)
	@$(BIN)/python fuzz/mutation.py --proof --every "$${EVERY:-10}"

simulate: $(INSTALLED)  ## UNIT=<name>: write the measurements of a simulated unit again
	@$(NAMED)
	@$(BIN)/triaxcal simulate "units/$$UNIT"

test: $(DEVELOPER)  ## Tests (under 3 minutes)
	@$(PYTEST) -m "not slow and not long" --ignore tests/verify

test-long: $(DEVELOPER)  ## The longer ones: whole sessions, series, cores, coverage (14 minutes)
	@$(PYTEST) -m "long and not slow" --ignore tests/verify

test-versions: $(DEVELOPER)  ## The wheel with lowest and highest versions, and with no compiler but ziglang's
	@$(BIN)/pytest -q tests/test_versions.py

test-verify: $(DEVELOPER)  ## That every check of `make verify` passes, and can fail (3 minutes)
	@$(PYTEST) -m "not slow" tests/verify

check: lint types test  ## What CI runs: lint, types, tests

lint: $(DEVELOPER)
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .

types: $(DEVELOPER)
	@$(BIN)/mypy

nightly: $(DEVELOPER)  ## The slow campaigns as well
	@$(PYTEST)

golden: $(DEVELOPER)  ## Write golden files and generated tables; look at the difference before committing
	@$(BIN)/pytest -q tests/test_golden.py --update-golden
	@$(BIN)/python docs/_ext/generated.py

docs: $(WRITER)  ## The documentation as a site: docs/_build/html/index.html
	@$(BIN)/python -m sphinx -q -W --keep-going -E -b html docs docs/_build/html
	@echo "docs/_build/html/index.html"

bench: $(BENCHES)  ## Benchmarks beside other programs, as ratios of one run, into docs/performance.md (10 minutes)
	@$(BIN)/python bench/run.py --page

test-can: $(DEVELOPER)  ## The bench on real SocketCAN: this machine's vcan, or QEMU (3 minutes)
	@rig/test-can.sh

rig-demo: $(DEVELOPER)  ## A whole session on the simulated rig, to a header (2 minutes)
	@$(BIN)/triaxcal rig run --bus virtual --unit AT-SIM-BENCH --plain --sessions build/rig-demo
	@$(MAKE) --no-print-directory calib-header UNIT=AT-SIM-BENCH

test-targets: $(INSTALLED)  ## The generated C on other cores under QEMU (all shapes, or UNIT=<name>)
	@$(BIN)/triaxcal target test $${UNIT:+"units/$$UNIT"}

bench-target: $(INSTALLED)  ## What a call costs on each core, beside floating point; into docs/reference/targets.md
	@$(BIN)/triaxcal target bench --page docs/reference/targets.md

clean:  ## Remove what make made
	rm -rf build docs/_build $(VENV) .pytest_cache .mypy_cache .ruff_cache .hypothesis

$(INSTALLED): pyproject.toml constraints.txt
	@command -v python3 >/dev/null || { echo "make: python3 not found; sudo apt-get install python3" >&2; exit 1; }
	@echo "setting up $(VENV) (once, about half a minute) ..."
	@python3 -m venv $(VENV) || { rm -rf $(VENV); \
	    echo "make: python3 cannot make an environment; sudo apt-get install python3-venv" >&2; exit 1; }
	@$(BIN)/pip install -qq --disable-pip-version-check -c constraints.txt -e .
	@$(BIN)/python -m compileall -q toolchain
	@touch $@

$(DEVELOPER): $(INSTALLED)
	@echo "adding the developers' tools to $(VENV) (once) ..."
	@$(BIN)/pip install -qq --disable-pip-version-check -c constraints.txt -e '.[dev,rig,instruments,device,series,plot,proof]'
	@touch $@

$(WRITER): $(INSTALLED)
	@echo "adding the documentation's tools to $(VENV) (once) ..."
	@$(BIN)/pip install -qq --disable-pip-version-check -c constraints.txt -e '.[docs,plot,rig]'
	@touch $@

$(BENCHES): $(DEVELOPER)
	@echo "adding the peers of the benchmarks to $(VENV) (once) ..."
	@$(BIN)/pip install -qq --disable-pip-version-check -c constraints.txt -e '.[bench,export]'
	@touch $@
