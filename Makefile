# Everything a developer runs. `make help` lists the targets; a fresh machine needs python3 (>= 3.11), gcc, g++ and make.

PYTHON ?= python3
VENV ?= .venv
EXTRAS ?= test,bench,calibrate,view,xacro,docs
JOBS ?= auto
RUN := $(VENV)/bin
READY := $(VENV)/ready
GENERATED := generated
PSDMC := $(RUN)/psdmc

# One thread per process: the tests and the benchmark bring their own parallelism, or want none.
export OMP_NUM_THREADS ?= 1
export OPENBLAS_NUM_THREADS ?= 1

.DEFAULT_GOAL := help
.PHONY: help venv docs dist demo test coverage check golden bench bench-legged bench-contacts bench-accelerator bench-learning bench-save bench-compare calibrate-demo campaign clean test-intervals test-slow test-processes test-trees test-demo test-accuracy test-targets test-machines test-lowest test-adapters test-examples test-pages audit fuzz mutate test-sanitize planted-faults

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  make %-16s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

venv: $(READY) ## create the environment .venv; the other targets do so if it is missing

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

test: $(READY) ## run the tests that every change must pass; JOBS=2 sets the number of workers
	$(RUN)/python -m pytest -n $(JOBS) --dist worksteal -m 'not slow' tests

SLOW ?= tests
test-slow: $(READY) ## run the longer cases of the same tests: more robots, builds, tools and seeds; SLOW='tests --part 0/8' runs the first of eight parts
	$(RUN)/python -m pytest -n $(JOBS) --dist worksteal -m slow $(SLOW)

COVERED ?= tests
coverage: $(READY) ## run all tests and show the share of each file that they run; COVERED='tests/program' runs a part
	@mkdir -p $(GENERATED)
	$(RUN)/python -m pytest -n $(JOBS) --dist worksteal --cov --cov-report=term --cov-report=html:$(GENERATED)/coverage $(COVERED)

CAMPAIGN ?= --robots 10000
campaign: $(READY) ## compare 10,000 random chains, 1,000 trees and 300 robots with contacts and loops with Pinocchio and MuJoCo, some hours; CAMPAIGN='--robots 500 --trees 50 --contacts 20' for less
	@mkdir -p $(GENERATED)
	$(RUN)/python tests/campaign/campaign_run.py $(CAMPAIGN) --journal $(GENERATED)/campaign.jsonl --json $(GENERATED)/campaign.json

INTERVALS ?= --workers 2
test-intervals: $(READY) ## count how often three standard deviations hold the truth, 200 simulated logs of each kind of error, 20 minutes; INTERVALS='--logs 20' for less
	$(RUN)/python tests/campaign/campaign_intervals.py $(INTERVALS)

test-processes: $(READY) ## kill every command 50 times at random moments, and check the files
	PSDMC_KILLS=50 $(RUN)/python -m pytest -q -rs tests/end_to_end/test_killed.py tests/end_to_end/test_full_disk.py

test-demo: $(READY) ## run the complete calibration campaigns of the virtual Denso; make test tries an arm of two joints
	PSDMC_DEMO=whole $(RUN)/python -m pytest -n $(JOBS) -q tests/calibration/test_demo.py tests/calibration/identify/test_coverage.py

planted-faults: $(READY) ## plant faults in good logs and print what calibrate says, as in docs/verdict.md; UR10=LOG.csv adds a real robot
	$(RUN)/python docs/planted_faults.py $(UR10)

test-accuracy: $(READY) ## measure the accuracy of the compiled C for every robot, function and sine; make test takes some
	PSDMC_ACCURACY=whole $(RUN)/python -m pytest -n $(JOBS) -rP tests/end_to_end/test_accuracy_table.py tests/end_to_end/test_random_chains.py tests/functions tests/trig/test_accuracy.py \
	  tests/derivation/test_nearly_parallel.py tests/derivation/test_derived_torques.py tests/toolchain/test_footprint.py \
	  tests/toolchain/test_target_machines.py tests/lower/test_expanded.py tests/bench/test_gate.py

test-trees: $(READY) ## test 20 whole robots, 300 random trees and ten seconds of a trotting quadruped, with figures; make test takes a few
	PSDMC_TREES=whole $(RUN)/python -m pytest -n $(JOBS) -q -rP tests/end_to_end/test_real_trees.py tests/end_to_end/test_random_trees.py tests/end_to_end/test_trotting.py tests/dynamics tests/functions/test_steps_of_free_robots.py tests/functions/test_constrained_forward_dynamics.py tests/robot/test_floating.py tests/robot/test_errors.py

TARGET_PROGRAMS := qemu-aarch64 qemu-s390x qemu-arm aarch64-linux-gnu-gcc s390x-linux-gnu-gcc arm-none-eabi-gcc
test-targets: $(READY) ## run self-tests for 64-bit Arm, big-endian s390x and Cortex-M in qemu; minutes
	@for program in $(TARGET_PROGRAMS); do command -v $$program >/dev/null || { echo "error: $$program is not installed"; \
	  echo "hint: apt install qemu-user gcc-aarch64-linux-gnu gcc-s390x-linux-gnu libc6-dev-s390x-cross gcc-arm-none-eabi libnewlib-arm-none-eabi"; exit 2; }; done
	PSDMC_TARGETS=whole $(RUN)/python -m pytest -q -rsP tests/toolchain/test_target_machines.py -k "compiled_for or first_byte"

LOWEST := .venv-lowest
LOWEST_TESTS = $(FAST) tests/test_atomic.py tests/backends/c/test_package.py tests/backends/c/test_write.py tests/toolchain/test_call.py \
  tests/toolchain/test_cache.py tests/bench/test_results.py tests/calibration/logs/test_log_files.py tests/calibration/identify/test_linear_fit.py \
  tests/derivation/test_same_bytes.py

$(LOWEST)/ready: pyproject.toml constraints/lowest.txt
	$(PYTHON) -m venv --clear $(LOWEST)
	$(LOWEST)/bin/python -m pip install --quiet --disable-pip-version-check --constraint constraints/lowest.txt \
	  --editable '.[calibrate]' pytest pytest-xdist pytest-benchmark hypothesis example-robot-data mpmath
	@touch $@

test-lowest: $(LOWEST)/ready ## run the fast tests with the oldest dependencies that pyproject.toml allows
	$(LOWEST)/bin/python -m pytest -q -n $(JOBS) --dist worksteal -m 'not slow' $(LOWEST_TESTS)

ADAPTERS := .venv-adapters
TORCH ?= torch==2.13.0+cpu
TORCH_INDEX ?= https://download.pytorch.org/whl/cpu

$(ADAPTERS)/ready: pyproject.toml
	$(PYTHON) -m venv --clear $(ADAPTERS)
	$(ADAPTERS)/bin/python -m pip install --quiet --disable-pip-version-check '$(TORCH)' 2>/dev/null \
	  || $(ADAPTERS)/bin/python -m pip install --quiet --disable-pip-version-check --extra-index-url $(TORCH_INDEX) '$(TORCH)'
	$(ADAPTERS)/bin/python -m pip install --quiet --disable-pip-version-check \
	  --editable '.[jax,torch,fmu,cuda]' pytest pytest-xdist hypothesis example-robot-data mpmath
	@touch $@

test-adapters: $(ADAPTERS)/ready ## test robots inside JAX, PyTorch, FMPy and pip's wheels, and compile CUDA packages, in a separate environment; TORCH=torch takes the newest PyTorch with CUDA
	$(ADAPTERS)/bin/python -m pytest -q -rs -n $(JOBS) --dist loadfile tests/frameworks tests/backends/adapters tests/backends/cuda/test_machine_code.py

EXAMPLES := .venv-examples
EXAMPLE_TESTS = $(shell grep -o 'tests/[a-z_/]*\.py' examples/README.md)

$(EXAMPLES)/ready: pyproject.toml
	$(PYTHON) -m venv --clear $(EXAMPLES)
	$(EXAMPLES)/bin/python -m pip install --quiet --disable-pip-version-check --editable '.[test,bench,calibrate,examples]' 'pin==4.0.*'
	@touch $@

test-examples: $(EXAMPLES)/ready ## run the tests of the examples, with those in Crocoddyl, in a separate environment with Pinocchio 4.0
	$(EXAMPLES)/bin/python -m pytest -q -rs -n $(JOBS) --dist loadfile $(EXAMPLE_TESTS)

test-pages: $(READY) ## open bench, calibration and site pages in Chromium at three widths, light and dark; screenshots in generated/pages
	@$(RUN)/python -c 'import playwright, axe_playwright_python' 2>/dev/null || $(RUN)/python -m pip install --quiet --editable '.[pages]'
	@mkdir -p $(GENERATED)/pages
	PSDMC_SCREENSHOTS=$(abspath $(GENERATED)/pages) $(RUN)/python -m pytest -q -rs tests/pages

ADVISORIES ?= https://pypi.org/pypi
ASK := import json, sys, urllib.request as u; \
  json.load(u.urlopen(f"{sys.argv[1]}/numpy/{sys.argv[2]}/json", timeout=20))["vulnerabilities"]
audit: $(READY) ## look up known vulnerabilities of the installed dependencies (pip-audit; needs the network)
	@$(RUN)/python -c '$(ASK)' $(ADVISORIES) $$($(RUN)/python -c 'import numpy; print(numpy.__version__)') 2>/dev/null \
	  || { echo "error: $(ADVISORIES) gives no advisories of numpy: nothing is audited"; echo "hint: run make audit where the index of packages is reached"; exit 2; }
	@test -x $(AUDIT)/bin/pip-audit || { $(PYTHON) -m venv $(AUDIT) && $(AUDIT)/bin/python -m pip install --quiet --disable-pip-version-check pip-audit; }
	$(RUN)/python -m pip freeze --exclude-editable > $(AUDIT)/installed.txt
	$(AUDIT)/bin/pip-audit --requirement $(AUDIT)/installed.txt --no-deps --disable-pip --strict

AUDIT := .venv-audit

test-sanitize: $(READY) ## run emitted C under sanitizers, valgrind, guard pages and analysers; make test runs a short form
	$(RUN)/python tests/toolchain/sanitize_campaign.py

FAST := tests/test_architecture.py tests/program tests/robot tests/dynamics tests/model

# A fifth of the tests' time, for robot files and series that a change of code seldom touches: make test has them.
LATER := tests/robot/test_mjcf.py tests/robot/test_limits.py tests/robot/test_against_pinocchio.py tests/robot/test_lock.py \
  tests/dynamics/test_tangent_steps.py tests/model/test_forged_models.py

check: $(READY) ## check format, lint, types and prose, and run the fast tests: seconds
	$(RUN)/ruff format --check .
	$(RUN)/ruff check .
	$(RUN)/mypy
	$(RUN)/reuse lint --quiet
	$(RUN)/python -m pytest -n $(JOBS) --dist worksteal -m 'not slow' $(addprefix --ignore=,$(LATER)) $(FAST) tests/prose

BYTES := tests/derivation/test_same_bytes.py
MACHINES := $(FAST) tests/functions/test_steps_of_free_robots.py
SETTING ?=
test-machines: $(READY) ## run the fast tests with the arithmetic of other processors; SETTING=haswell runs one setting
	@for setting in $(or $(SETTING),$$($(RUN)/python tests/machines.py names)); do \
	  $(RUN)/python tests/machines.py run $$setting $(RUN)/python -m pytest -n $(JOBS) --dist worksteal -m 'not slow' \
	    $(addprefix --ignore=,$(LATER)) $(MACHINES) || exit 1; \
	  $(RUN)/python tests/machines.py run $$setting $(RUN)/python -m pytest -n $(JOBS) $(BYTES) || exit 1; done

golden: $(READY) ## rewrite the golden files; review their diff like code
	PSDMC_REWRITE_GOLDEN=1 $(RUN)/python -m pytest tests/lower tests/backends/c tests/end_to_end/test_reference_robot.py tests/derivation/test_same_bytes.py
	git --no-pager diff --stat -- tests/golden $(GENERATED)

bench: $(READY) ## time the standard robots against other programs, on an idle machine; page and JSON in generated/
	$(RUN)/python -m psdmc.bench --json $(GENERATED)/bench.json
	$(RUN)/python -m psdmc.report.bench_page $(GENERATED)/bench.json $(GENERATED)/bench.html

LEGS ?=
bench-legged: $(READY) ## time derivatives and matrices of seven legged robots, on an idle machine; LEGS='hyq go1' for some
	$(RUN)/python -m psdmc.bench.legged $(LEGS) --json $(GENERATED)/bench-legged.json

bench-contacts: $(READY) ## time dynamics with contacts of four legged robots, and of a palletiser, beside Pinocchio, on an idle machine; LEGS='hyq' for some
	$(RUN)/python benchmarks/contacts.py $(LEGS)

LEARNING := .venv-learning
ONLY ?=

$(LEARNING)/ready: pyproject.toml
	$(PYTHON) -m venv --clear $(LEARNING)
	$(PYTHON) -m venv --clear $(LEARNING)/adam
	$(LEARNING)/bin/python -m pip install --quiet --disable-pip-version-check '$(TORCH)' \
	  || $(LEARNING)/bin/python -m pip install --quiet --disable-pip-version-check --extra-index-url $(TORCH_INDEX) '$(TORCH)'
	$(LEARNING)/bin/python -m pip install --quiet --disable-pip-version-check \
	  --editable '.[jax,torch]' example-robot-data adam-robotics frax jaxsim mujoco-mjx
	$(LEARNING)/adam/bin/python -m pip install --quiet --disable-pip-version-check 'adam-robotics[jax]'
	@touch $@

bench-learning: $(LEARNING)/ready ## time forward dynamics and its gradient in JAX and PyTorch beside frax, adam, jaxsim and MJX; ONLY='psdmc in JAX,frax' for some
	$(LEARNING)/bin/python benchmarks/learning.py --adam $(LEARNING)/adam/bin/python --only '$(ONLY)'

bench-accelerator: $(READY) ## compare functions on an NVIDIA GPU with those of the CPU, then time them, as shares of the bandwidth
	$(RUN)/python -m pip install --quiet --disable-pip-version-check --editable '.[cuda]'
	$(RUN)/python benchmarks/accelerator.py --json $(GENERATED)/bench-accelerator.json

bench-save: $(READY) ## rewrite benchmarks/baseline.json: operations and instructions, not times
	$(RUN)/python -m psdmc.bench.gate save

bench-compare: $(READY) ## fail if operations or instructions grew beyond that baseline
	$(RUN)/python -m psdmc.bench.gate compare

docs: $(READY) ## build the documentation site in generated/site; a warning is an error
	$(RUN)/python docs/site_pages.py
	@echo "generated/site/index.html"

dist: $(READY) ## write a wheel and an sdist to dist/; pip fetches setuptools for it
	rm -rf dist build psdmc.egg-info
	@mkdir -p $(GENERATED)
	$(RUN)/python -m build >$(GENERATED)/dist.log 2>&1 || { tail -n 20 $(GENERATED)/dist.log; exit 1; }
	@rm -rf psdmc.egg-info
	@ls dist/*

calibrate-demo: $(READY) ## plan, simulate and calibrate the virtual Denso; page in generated/
	$(RUN)/python -m psdmc.report.calibrate_demo

FUZZ := $(if $(FORMAT),--format $(FORMAT)) $(if $(COUNT),--count $(COUNT)) $(if $(ENGINE),--engine $(ENGINE))
FUZZ += --seconds $(or $(SECONDS),$(if $(COUNT),1000000,240)) $(FUZZ_OPTIONS)

fuzz: $(READY) ## try damaged files and command lines, minutes; SECONDS=, COUNT=, FORMAT=, ENGINE=; figures in generated/fuzz/
	@$(RUN)/python -c 'import atheris' 2>/dev/null || $(RUN)/python -m pip install --quiet --only-binary :all: --editable '.[fuzz]' \
	  || echo "atheris does not install here: mutation without guidance by coverage"
	$(RUN)/python tests/fuzz/fuzz.py $(FUZZ)

MUTANTS ?= 80
FIRST_MUTANT := psdmc.program.cost.x_cost__mutmut_1
mutate: $(READY) ## put faults into program/ and lower/ and list those that no fast test notices; MUTANTS=80, minutes; `mutmut show NAME` for one
	@$(RUN)/python -c 'import mutmut' 2>/dev/null || $(RUN)/python -m pip install --quiet --editable '.[mutate]'
	rm -rf mutants
	$(RUN)/mutmut run --max-children 1 $(FIRST_MUTANT)
	$(RUN)/mutmut run $$($(RUN)/python tests/mutation/sampled.py $(MUTANTS))
	$(RUN)/mutmut results

clean: ## remove the environment and all generated files but the reference robot
	rm -rf mutants $(VENV) $(LOWEST) $(AUDIT) $(ADAPTERS) $(EXAMPLES) $(LEARNING) build dist .pytest_cache .mypy_cache .ruff_cache .hypothesis .benchmarks *.egg-info
	find $(GENERATED) -mindepth 1 -maxdepth 1 ! -name two_link ! -name .gitkeep -exec rm -rf {} +
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
