# Everything a developer runs. `make help` lists the targets; a fresh machine needs python3 (>= 3.11), gcc, g++ and make.

PYTHON ?= python3
VENV ?= .venv
EXTRAS ?= test,bench,calibrate,xacro,docs
JOBS ?= auto
RUN := $(VENV)/bin
READY := $(VENV)/ready
GENERATED := generated
PSDMC := $(RUN)/psdmc

# One thread per process: the tests and the benchmark bring their own parallelism, or want none.
export OMP_NUM_THREADS ?= 1
export OPENBLAS_NUM_THREADS ?= 1

.DEFAULT_GOAL := help
.PHONY: help venv docs dist demo test coverage check golden bench bench-save bench-compare calibrate-demo campaign clean test-slow test-processes test-trees test-demo test-accuracy test-targets test-machines test-lowest test-pages audit fuzz mutate test-sanitize

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  make %-16s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

venv: $(READY) ## make the environment in .venv (the others do so where it is missing)

$(READY): pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
	  || { echo "error: $(PYTHON) is older than 3.11"; echo "hint: make $(MAKECMDGOALS) PYTHON=python3.12"; exit 2; }
	$(PYTHON) -m venv $(VENV)
	$(RUN)/python -m pip install --quiet --disable-pip-version-check --editable '.[$(EXTRAS)]'
	@touch $@

demo: $(READY) ## derive, emit, build, check and benchmark the bundled Denso VS-6556G
	@mkdir -p $(GENERATED)
	$(PSDMC) derive examples/robots/denso_wall.toml -o $(GENERATED)/denso_wall.npz
	$(PSDMC) emit-c $(GENERATED)/denso_wall.npz -o $(GENERATED)/denso_wall
	$(PSDMC) build $(GENERATED)/denso_wall
	$(PSDMC) check $(GENERATED)/denso_wall.npz
	$(RUN)/python -m psdmc.bench.demo $(GENERATED)/denso_wall.npz

test: $(READY) ## run the tests, but for what the other test- targets take
	$(RUN)/python -m pytest -n $(JOBS) --dist worksteal -m 'not slow' tests

test-slow: $(READY) ## the cases that make test leaves out: further robots, builds, tools and seeds of the same tests; CI runs it
	$(RUN)/python -m pytest -n $(JOBS) --dist worksteal -m slow tests

COVERED ?= tests
coverage: $(READY) ## run all tests (COVERED='tests/program tests/model': these) and say which share of each file they run
	@mkdir -p $(GENERATED)
	$(RUN)/python -m pytest -n $(JOBS) --dist worksteal --cov --cov-report=term --cov-report=html:$(GENERATED)/coverage $(COVERED)

CAMPAIGN ?= --robots 10000
campaign: $(READY) ## 10,000 random chains and 1,000 trees against Pinocchio and MuJoCo, an hour or more of two cores; CAMPAIGN='--robots 500 --trees 50' for less
	@mkdir -p $(GENERATED)
	$(RUN)/python tests/campaign/campaign_run.py $(CAMPAIGN) --journal $(GENERATED)/campaign.jsonl --json $(GENERATED)/campaign.json

test-processes: $(READY) ## kill every command 50 times at random moments, and whatever else takes long
	PSDMC_KILLS=50 $(RUN)/python -m pytest -q -rs tests/end_to_end/test_killed.py tests/end_to_end/test_full_disk.py

test-demo: $(READY) ## the virtual Denso's whole campaigns and all seeds of coloured noise; make test tries an arm of two joints
	PSDMC_DEMO=whole $(RUN)/python -m pytest -n $(JOBS) -q tests/calibration/test_demo.py tests/calibration/identify/test_coverage.py

test-accuracy: $(READY) ## accuracy of every robot's, function's and sine's C as psdmc.compile builds it; make test takes some
	PSDMC_ACCURACY=whole $(RUN)/python -m pytest -n $(JOBS) -rP tests/end_to_end/test_accuracy_table.py tests/end_to_end/test_random_chains.py tests/functions tests/trig/test_accuracy.py \
	  tests/derivation/test_nearly_parallel.py tests/derivation/test_derived_torques.py tests/toolchain/test_footprint.py \
	  tests/toolchain/test_target_machines.py tests/lower/test_expanded.py tests/bench/test_gate.py

test-trees: $(READY) ## 20 whole robots on fixed and free bases, compiled, 300 random trees against extended precision, Pinocchio and MuJoCo, with figures, ten seconds of a trot and of free flight; make test takes a few
	PSDMC_TREES=whole $(RUN)/python -m pytest -n $(JOBS) -q -rP tests/end_to_end/test_real_trees.py tests/end_to_end/test_random_trees.py tests/end_to_end/test_trotting.py tests/dynamics tests/functions/test_steps_of_free_robots.py tests/robot/test_floating.py tests/robot/test_errors.py

TARGET_PROGRAMS := qemu-aarch64 qemu-s390x qemu-arm aarch64-linux-gnu-gcc s390x-linux-gnu-gcc arm-none-eabi-gcc
test-targets: $(READY) ## self-tests of every function on 64-bit ARM, big-endian s390x and Cortex-M under qemu-user; minutes
	@for program in $(TARGET_PROGRAMS); do command -v $$program >/dev/null || { echo "error: $$program is not installed"; \
	  echo "hint: apt install qemu-user gcc-aarch64-linux-gnu gcc-s390x-linux-gnu libc6-dev-s390x-cross gcc-arm-none-eabi libnewlib-arm-none-eabi"; exit 2; }; done
	PSDMC_TARGETS=whole $(RUN)/python -m pytest -q -rsP tests/toolchain/test_target_machines.py -k "compiled_for or first_byte"

LOWEST := .venv-lowest
LOWEST_TESTS = $(FAST) tests/test_atomic.py tests/emit/test_package.py tests/emit/test_write.py tests/toolchain/test_call.py \
  tests/toolchain/test_cache.py tests/bench/test_results.py tests/calibration/logs/test_log_files.py tests/calibration/identify/test_linear_fit.py \
  tests/derivation/test_same_bytes.py

$(LOWEST)/ready: pyproject.toml constraints/lowest.txt
	$(PYTHON) -m venv --clear $(LOWEST)
	$(LOWEST)/bin/python -m pip install --quiet --disable-pip-version-check --constraint constraints/lowest.txt \
	  --editable '.[calibrate]' pytest pytest-xdist pytest-benchmark hypothesis example-robot-data mpmath
	@touch $@

test-lowest: $(LOWEST)/ready ## run the fast tests with the oldest dependencies that pyproject.toml admits
	$(LOWEST)/bin/python -m pytest -q -m 'not slow' $(LOWEST_TESTS)

test-pages: $(READY) ## bench, calibration and site pages in Chromium at three widths, light and dark; screenshots in generated/pages
	@$(RUN)/python -c 'import playwright, axe_playwright_python' 2>/dev/null || $(RUN)/python -m pip install --quiet '.[pages]'
	@mkdir -p $(GENERATED)/pages
	PSDMC_SCREENSHOTS=$(abspath $(GENERATED)/pages) $(RUN)/python -m pytest -q -rs tests/pages

ADVISORIES ?= https://pypi.org/pypi
ASK := import json, sys, urllib.request as u; \
  json.load(u.urlopen(f"{sys.argv[1]}/numpy/{sys.argv[2]}/json", timeout=20))["vulnerabilities"]
audit: $(READY) ## ask the advisory databases about every installed dependency (pip-audit; needs the network)
	@$(RUN)/python -c '$(ASK)' $(ADVISORIES) $$($(RUN)/python -c 'import numpy; print(numpy.__version__)') 2>/dev/null \
	  || { echo "error: $(ADVISORIES) gives no advisories of numpy: nothing is audited"; echo "hint: run make audit where the index of packages is reached"; exit 2; }
	@test -x $(AUDIT)/bin/pip-audit || { $(PYTHON) -m venv $(AUDIT) && $(AUDIT)/bin/python -m pip install --quiet --disable-pip-version-check pip-audit; }
	$(RUN)/python -m pip freeze --exclude-editable > $(AUDIT)/installed.txt
	$(AUDIT)/bin/pip-audit --requirement $(AUDIT)/installed.txt --no-deps --disable-pip --strict

AUDIT := .venv-audit

test-sanitize: $(READY) ## emitted C under sanitizers, valgrind, guard pages and analyzers; make test runs a short form
	$(RUN)/python tests/toolchain/sanitize_campaign.py

FAST := tests/test_architecture.py tests/program tests/robot tests/dynamics tests/model

# A fifth of the tests' time, for robot files and series that a change of code seldom touches: make test has them.
LATER := tests/robot/test_mjcf.py tests/robot/test_limits.py tests/robot/test_against_pinocchio.py tests/robot/test_lock.py \
  tests/dynamics/test_tangent_steps.py tests/model/test_forged_models.py

check: $(READY) ## format, lint, types and the fast tests: seconds
	$(RUN)/ruff format --check .
	$(RUN)/ruff check .
	$(RUN)/mypy
	$(RUN)/reuse lint --quiet
	$(RUN)/python -m pytest -n $(JOBS) --dist worksteal -m 'not slow' $(addprefix --ignore=,$(LATER)) $(FAST)

BYTES := tests/derivation/test_same_bytes.py
MACHINES := $(FAST) tests/functions/test_steps_of_free_robots.py
SETTING ?=
test-machines: $(READY) ## fast tests as other processors compute, SETTING=haswell for one: OpenBLAS's kernels, NumPy's features, two threads
	@for setting in $(or $(SETTING),$$($(RUN)/python tests/machines.py names)); do \
	  $(RUN)/python tests/machines.py run $$setting $(RUN)/python -m pytest -n $(JOBS) --dist worksteal -m 'not slow' \
	    $(addprefix --ignore=,$(LATER)) $(MACHINES) || exit 1; \
	  $(RUN)/python tests/machines.py run $$setting $(RUN)/python -m pytest -n $(JOBS) $(BYTES) || exit 1; done

golden: $(READY) ## rewrite the golden files; review their diff like code
	PSDMC_REWRITE_GOLDEN=1 $(RUN)/python -m pytest tests/lower tests/emit tests/end_to_end/test_reference_robot.py tests/derivation/test_same_bytes.py
	git --no-pager diff --stat -- tests/golden $(GENERATED)

bench: $(READY) ## measure the standard robots against every rival, on an idle machine; page and JSON in generated/
	$(RUN)/python -m psdmc.bench --json $(GENERATED)/bench.json
	$(RUN)/python -m psdmc.report.bench_page $(GENERATED)/bench.json $(GENERATED)/bench.html

bench-save: $(READY) ## rewrite benchmarks/baseline.json: operations and instructions, not times
	$(RUN)/python -m psdmc.bench.gate save

bench-compare: $(READY) ## fail where operations or instructions grew beyond that baseline
	$(RUN)/python -m psdmc.bench.gate compare

docs: $(READY) ## build the documentation site into generated/site; a warning is an error
	$(RUN)/python docs/site_pages.py
	@echo "generated/site/index.html"

dist: $(READY) ## write a wheel and an sdist to dist/, as a release needs them; pip fetches setuptools
	rm -rf dist build psdmc.egg-info
	@mkdir -p $(GENERATED)
	$(RUN)/python -m build >$(GENERATED)/dist.log 2>&1 || { tail -n 20 $(GENERATED)/dist.log; exit 1; }
	@rm -rf psdmc.egg-info
	@ls dist/*

calibrate-demo: $(READY) ## excite, simulate and calibrate the virtual Denso; page in generated/
	$(RUN)/python -m psdmc.report.calibrate_demo

FUZZ := $(if $(FORMAT),--format $(FORMAT)) $(if $(COUNT),--count $(COUNT)) $(if $(ENGINE),--engine $(ENGINE))
FUZZ += --seconds $(or $(SECONDS),$(if $(COUNT),1000000,240)) $(FUZZ_OPTIONS)

fuzz: $(READY) ## hostile files and command lines, minutes: SECONDS=, COUNT=, FORMAT=, ENGINE=; figures in generated/fuzz/
	@$(RUN)/python -c 'import atheris' 2>/dev/null || $(RUN)/python -m pip install --quiet --only-binary :all: '.[fuzz]' \
	  || echo "atheris does not install here: mutation without guidance by coverage"
	$(RUN)/python tests/fuzz/fuzz.py $(FUZZ)

MUTANTS ?= 80
FIRST_MUTANT := psdmc.program.cost.x_cost__mutmut_1
mutate: $(READY) ## which of MUTANTS=80 sampled faults in program/ and lower/ no fast test sees; minutes, `mutmut show NAME` for one
	@$(RUN)/python -c 'import mutmut' 2>/dev/null || $(RUN)/python -m pip install --quiet '.[mutate]'
	rm -rf mutants
	$(RUN)/mutmut run --max-children 1 $(FIRST_MUTANT)
	$(RUN)/mutmut run $$($(RUN)/python tests/mutation/sampled.py $(MUTANTS))
	$(RUN)/mutmut results

clean: ## remove the environment and everything generated but the reference robot
	rm -rf mutants $(VENV) $(LOWEST) $(AUDIT) build dist .pytest_cache .mypy_cache .ruff_cache .hypothesis .benchmarks *.egg-info
	find $(GENERATED) -mindepth 1 -maxdepth 1 ! -name two_link ! -name .gitkeep -exec rm -rf {} +
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
