# All that Fourpole's developers and first-time users run. Needs Python >= 3.11 and make, nothing else.

# The first Python on the path that is new enough; PYTHON=... on the command line chooses another.
ifeq ($(origin PYTHON), undefined)
PYTHON := $(shell for p in python3 python python3.15 python3.14 python3.13 python3.12 python3.11; do \
	$$p -c 'import sys; sys.exit(sys.version_info < (3, 11))' >/dev/null 2>&1 && { echo $$p; exit; }; done; echo python3)
endif

BIN := .venv/bin
READY := .venv/.ready
READY_DEMO := .venv/.ready-demo
READY_LOWEST := .venv-lowest/.ready
READY_BENCH := .venv-bench/.ready
# Recordings are worked on side by side; threads inside each small product only get in the way.
export OPENBLAS_NUM_THREADS ?= 1
# Python compiles what is imported when it is imported, which is a small part of all that is installed; it must keep that,
# or each process that a test starts takes some seconds more. Images of containers often forbid it.
unexport PYTHONDONTWRITEBYTECODE
PIP_FLAGS := --quiet --disable-pip-version-check --no-compile
# The tests in two processes; one that has done its own takes from the other. A third makes fixtures that they have made.
TWO_AT_A_TIME := --numprocesses 2 --dist worksteal
# Two processes use both cores; more threads of polars in each wait for each other.
pytest lowest every: export POLARS_MAX_THREADS ?= 1

.PHONY: help demo test ready check docs figures links lines format chromium compiler kernel strace pytest lowest lowest-install bench bench-install benchmark benchmark-data validate faults hostile every lock clean

help:  ## list the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  make %-13s %s\n", $$1, $$2 }' Makefile

# The locks hold the versions and hashes of everything, the build tool too: so no build isolation.
# $(call install,ENVIRONMENT,LOCK): make or refresh it, and put the package in it, editable.
define install
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null || { \
		echo "Fourpole needs Python 3.11 or newer, and '$(PYTHON)' is not ($$($(PYTHON) --version 2>&1 | head -n 1))."; \
		echo "Install one, or name it: make PYTHON=/path/to/python3"; exit 1; } >&2
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || { \
		echo "'$(PYTHON)' cannot make virtual environments: its modules venv and ensurepip are missing."; \
		echo "On Debian and Ubuntu: sudo apt install python3-venv (or python3.X-venv, for another version X)."; \
		exit 1; } >&2
	@echo "Installing $(2) into $(1) (once; a minute or so)"
	@[ -x $(1)/bin/python ] || $(PYTHON) -m venv $(1)
	@$(1)/bin/python -m pip install $(PIP_FLAGS) --no-deps --requirement $(2)
	@[ $(1)/.package -nt pyproject.toml ] || \
		$(1)/bin/python -m pip install $(PIP_FLAGS) --no-deps --no-build-isolation --editable .
	@touch $(1)/.package
endef

# The demonstration needs the package alone; in the same place, so that `make test` installs nothing of it again.
$(READY_DEMO): requirements-demo.lock pyproject.toml
	$(call install,.venv,requirements-demo.lock)
	@touch $@

$(READY): requirements.lock pyproject.toml
	$(call install,.venv,requirements.lock)
	@touch $@

$(READY_LOWEST): requirements-lowest.lock pyproject.toml
	$(call install,.venv-lowest,requirements-lowest.lock)
	@touch $@

# The peers stand in no lock, and some need build tools that no lock has: so they are built in isolation. All libraries that
# they share with Fourpole are those of .venv, which the file .pth adds to the path.
$(READY_BENCH): $(READY)
	@echo "Installing the peers of bench/ into .venv-bench (once; half a minute)"
	@$(PYTHON) -m venv .venv-bench
	@$(BIN)/python -c "import site; print(f'import site; site.addsitedir({site.getsitepackages()[0]!r})')" > \
		"$$(.venv-bench/bin/python -c 'import site; print(site.getsitepackages()[0])')/locked.pth"
	@.venv-bench/bin/python -m pip install $(PIP_FLAGS) --no-warn-conflicts 'fourpole[bench]'
	@touch $@

demo: $(if $(wildcard $(READY)),$(READY),$(READY_DEMO))  ## make the demonstration campaign in ./fourpole-demo and analyse it
	@$(BIN)/fourpole demo

# Installing waits for the network half of the time, so three things are done at a time, the tests on the lowest versions
# among them; the tests take both cores.
test:  ## everything: check, the peers, the tests on the lowest versions, the tests
	@$(MAKE) --no-print-directory --jobs 3 ready
	@$(MAKE) --no-print-directory pytest

ready: lowest bench-install docs check

# $(call program,COMMANDS,PACKAGES,WHAT NEEDS IT): install packages with apt-get unless one of the commands is there.
define program
	@for b in $(1); do command -v $$b >/dev/null 2>&1 && exit 0; done; \
	as=; [ "$$(id -u)" = 0 ] || as="sudo -n"; \
	if command -v apt-get >/dev/null 2>&1 && { [ -z "$$as" ] || $$as true 2>/dev/null; }; then \
		echo "Installing $(2) with apt-get"; \
		$$as apt-get -qq update && \
		$$as env DEBIAN_FRONTEND=noninteractive apt-get -qq install -y --no-install-recommends $(2) >/dev/null; \
	elif [ "$$CI" = true ]; then \
		echo "$(3) need it: sudo apt install $(2)" >&2; exit 1; \
	else \
		echo "$(2): not found, $(3) will be skipped; to run them: sudo apt install $(2)" >&2; \
	fi
endef

chromium:  ## the browser that the tests of the report need; installed here where that may be done
	$(call program,chromium chromium-browser google-chrome google-chrome-stable,chromium,the tests of the report)

compiler: chromium  ## the C compiler that the tests of FMUs need; after chromium, for one apt-get runs at a time
	$(call program,gcc cc clang,gcc libc6-dev,the tests of FMUs)

# A compiler that cannot do it stops nothing: numpy does the same.
kernel: $(READY) compiler  ## the library in C that reduces recordings a quarter quicker, beside its source
	@library=$$($(BIN)/python -m fourpole.io.kernel); \
	for b in cc gcc clang; do [ ! -e "$$library" ] && command -v $$b >/dev/null 2>&1 || continue; \
		rm -f src/fourpole/core/kernel-*.library; $$b -O3 -fPIC -shared -o "$$library" src/fourpole/core/kernel.c -lm; done; true

strace: compiler  ## the tracer that the tests of faults need; after the compiler, for one apt-get runs at a time
	$(call program,strace,strace,the tests of faults)

# Asserts are plain, for to rewrite those of all files takes 20 s; what fails runs once more, and says the values.
pytest: $(READY) strace kernel  ## the tests, the examples of the docstrings and of the README
	@$(BIN)/python -m pytest $(TWO_AT_A_TIME) --assert=plain || { $(BIN)/python -m pytest --last-failed --last-failed-no-failures none; exit 1; }

check: $(READY)  ## lint, format, types, direction of imports
	@$(BIN)/ruff check
	@$(BIN)/ruff format --check
	@$(BIN)/mypy
	@$(BIN)/lint-imports --no-logo

lines: $(READY)  ## count the code lines of the package, in the format that `make check` wants
	@$(BIN)/ruff format --check --quiet src || { echo "run make format first" >&2; exit 1; }
	@$(BIN)/python tools/lines.py

# Pages that have not changed are not read again. A warning is an error: of a link, a formula, a docstring.
docs: $(READY)  ## the site of the documentation, build/site/index.html, made without a network
	@$(BIN)/python -m sphinx -q -W --keep-going --jobs auto -d build/doctrees docs build/site

figures: $(READY)  ## make the figures and tables of the documentation anew; the tests say which need it
	@$(BIN)/python docs/build/figures.py

links: $(READY)  ## try the links to other sites; lists those that are broken
	@$(BIN)/python -m sphinx -q -b linkcheck --jobs auto -d build/doctrees docs build/links

format: $(READY)  ## put the code in its format, and mend what the linter can
	@$(BIN)/ruff check --fix-only
	@$(BIN)/ruff format

# What it holds: each function of a library that the package calls is there in the lowest version and does the same. So
# every fifth test, by turns, runs with its first case alone (--first), except where the cases differ in the library that
# they call (tests/selection.py). Left out are examples, for they show numbers as today's numpy prints them; warnings, for
# those of an old library are nobody's to mend; the commands', the report's and the pages' own tests, which hold exact
# output of the terminal, browser and drawing libraries of the lock alone; tests that take long or repeat an estimate many
# times, which ask of our formulas, not of a library; core/joint and models, algebra on numpy and scipy, which the analyses
# and fits of the other tests run. Asserts are plain, as those of `make pytest`.
lowest: lowest-install strace kernel  ## the tests of the library on the lowest versions allowed (Python 3.11 or 3.12)
	@[ ! -e $(READY_LOWEST) ] || .venv-lowest/bin/python -m pytest --override-ini=addopts=--import-mode=importlib \
		-W default $(TWO_AT_A_TIME) --assert=plain --first -m "not statistical and not thorough" tests \
		--ignore=tests/app --ignore=tests/report --ignore=tests/docs --ignore=tests/tools \
		--ignore=tests/core/joint --ignore=tests/models

lowest-install:  ## install the lowest versions allowed
	@if $(PYTHON) -c 'import sys; sys.exit(sys.version_info >= (3, 13))'; then \
		$(MAKE) --no-print-directory --silent $(READY_LOWEST); \
	else \
		echo "lowest: skipped, the lowest versions allowed have no wheels for $$($(PYTHON) --version)"; \
	fi

bench-install: $(READY_BENCH)  ## install the peers, and see that each script in bench/ and each method of the benchmark finds them
	@$(BENCHMARK) .venv-bench/bin/python -c "from elastomer_truth.adapters import METHODS, method; [method(name) for name in METHODS]"
	@cd bench && ../.venv-bench/bin/python -c "import glob, importlib; [importlib.import_module(name[:-3]) for name in glob.glob('*.py')]"

# Each script writes what it found into bench/kept, and fails where a promise is not kept; the others run all the same.
bench: $(READY_BENCH) kernel  ## compare with the peers, write the table of docs/speed.md; fails where a promise is not kept
	@rm -rf bench/kept
	@for script in bench/bench_*.py; do echo; echo "== $$script"; .venv-bench/bin/python "$$script"; done; \
	.venv-bench/bin/python bench/write_table.py

# Each step goes on where it was stopped. Data, truth and answers are in benchmark/work.
BENCHMARK := PYTHONPATH=benchmark

benchmark-data: $(READY)  ## make the campaigns of the benchmark, 0.2 GB; ONLY=H001: one, ONLY=H: the honest ones
	@$(BENCHMARK) $(BIN)/python -m elastomer_truth make $(ONLY)
	-@$(BENCHMARK) $(BIN)/python -m elastomer_truth check $(ONLY)

benchmark: $(READY_BENCH) benchmark-data  ## run all methods on them, score, and write the tables of three pages; 100 minutes of CPU time
	@$(BENCHMARK) .venv-bench/bin/python -m elastomer_truth run $(ONLY)
	@$(BENCHMARK) .venv-bench/bin/python -m elastomer_truth score $(ONLY) \
		--page docs/benchmark.md --page docs/validation.md --page docs/faults.md

validate: benchmark  ## the former name of make benchmark

faults: $(READY) strace  ## errors, a full disk and kills at every call of two commands; 20 CPU minutes, goes on where it was
	@$(BIN)/python -m tests.faults

hostile: $(READY)  ## every command and every page on every folder that is made to harm; 20 CPU minutes
	@$(BIN)/python -m tests.hostile
	@FOURPOLE_EVERY=1 $(BIN)/python -m pytest -q tests/served/test_hostile.py

every: $(READY)  ## all of the tests of which `make test` takes a part, which is another after each change of the sources
	@FOURPOLE_EVERY=1 $(BIN)/python -m pytest $(TWO_AT_A_TIME) -m sampled docs tests

LOCK := .venv-lock/bin/uv --quiet --no-config pip compile --universal --python-version 3.11 --generate-hashes \
	--no-emit-index-url --no-emit-find-links --custom-compile-command "make lock" pyproject.toml

lock:  ## write the lock files anew, with uv
	@$(PYTHON) -m venv .venv-lock
	@.venv-lock/bin/python -m pip install $(PIP_FLAGS) uv
	@$(LOCK) --upgrade --extra dev --output-file requirements.lock
	@$(LOCK) --upgrade --extra test --resolution lowest-direct --output-file requirements-lowest.lock
	@echo "hatchling>=1.27" | $(LOCK) - --upgrade --constraint requirements.lock --output-file requirements-demo.lock

clean:  ## remove the environments, caches and what was built
	@rm -rf .venv .venv-lowest .venv-bench .venv-lock build dist docs/api/made .*_cache .hypothesis .coverage
	@find src tests -name __pycache__ -type d -prune -exec rm -rf {} +
