# Everything happens in .venv, which is made on the first call; nothing needs to be activated.
#   make PYTHON=/path/to/python3.12 setup    to choose the Python (3.11 or 3.12)

SHELL := /bin/bash
.SHELLFLAGS := -euo pipefail -c
.DEFAULT_GOAL := help

VENV := .venv
RUN := $(VENV)/bin/python
OUT := out
JOBS := 2

# The first Python on the PATH that will do; a name alone may belong to a version manager that does not have it.
PYTHON ?= $(or $(shell for python in python3.12 python3.11 python3; do \
	"$$python" -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 12))' >/dev/null 2>&1 \
	&& echo "$$python" && break; done),python3)

# Nobody else's ROS graph, unless asked for.
ROS_AUTOMATIC_DISCOVERY_RANGE ?= LOCALHOST
export ROS_AUTOMATIC_DISCOVERY_RANGE
export PIP_DISABLE_PIP_VERSION_CHECK := 1
# Some shells have it: every process would compile all modules again, which is a third of the time that it takes to start.
unexport PYTHONDONTWRITEBYTECODE

REQUIREMENTS := $(patsubst %,requirements/%.txt,runtime ros build test docs)
WHEELS := $(VENV)/.wheels-installed
MSGS := $(VENV)/.msgs-installed
PACKAGE := $(VENV)/.package-installed
WEIGHTS := $(VENV)/.weights-asked-for
COMPILED := $(VENV)/.compiled
# Of the hundreds of lines that pip prints one in twenty packages, and that it unpacks them. No awk: some wait for a full buffer.
SHOW_LIFE = { n=0; while read -r line; do case "$$line" in \
	Collecting*) n=$$((n + 1)); if ((n % 20 == 0)); then echo "  $$n packages fetched"; fi ;; \
	"Installing collected"*) echo "  unpacking $$n packages" ;; esac; done; }
MSGS_SOURCES := $(shell find msgs -type f -not -path '*/build/*')
PACKAGE_SOURCES := setup.py setup.cfg pyproject.toml package.xml $(shell find config launch resource -type f 2>/dev/null)

.PHONY: help setup check-system system demo test test-long test-ros lint docs benchmark benchmark-full clean

help:  ## show this list
	@grep -hE '^[a-z-]+:.*  ## ' $(MAKEFILE_LIST) | sed -E 's/^([a-z-]+):.*  ## (.*)/  make \1\t\2/' | expand -t 24

setup: $(PACKAGE) $(WEIGHTS) $(COMPILED)  ## make .venv with the pinned packages, the interfaces and this package

check-system:
	@"$(PYTHON)" tools/check_system.py

system:  ## install missing system packages (as root, with apt-get)
	@packages=$$("$(PYTHON)" tools/check_system.py --packages); \
	if [ -n "$$packages" ]; then apt-get update -q && DEBIAN_FRONTEND=noninteractive apt-get install -y -q $$packages; fi

$(WHEELS): $(REQUIREMENTS)
	@"$(PYTHON)" tools/check_system.py
	@$(RUN) -m pip --version >/dev/null 2>&1 || "$(PYTHON)" -m venv --clear $(VENV)
	@echo "Installing the pinned packages into $(VENV) (3 GB; two to ten minutes)"
	@$(RUN) -m pip install --progress-bar off --no-deps $(REQUIREMENTS:%=-r %) | $(SHOW_LIFE)
	@touch $@

$(MSGS): $(WHEELS) $(MSGS_SOURCES)
	@echo "Building the interface package"
	@$(RUN) -m pip install --quiet --no-deps --no-build-isolation --force-reinstall ./msgs
	@touch $@

# Editable: the sources are used where they are, and config and launch files are links. New ones ask for this again.
$(PACKAGE): $(MSGS) $(PACKAGE_SOURCES) tools/link_data_files.py
	@$(RUN) -m pip install --quiet --no-deps --no-build-isolation --editable .
	@$(RUN) tools/link_data_files.py
	@touch $@

# Once: without network everything but points of people works, and what needs them fetches their weights then.
$(WEIGHTS): | $(PACKAGE)
	@echo "Fetching the weights of the network that finds points of people (35 MB, kept in ~/.cache/tracker_node)"
	@$(RUN) tools/fetch_weights.py
	@touch $@

# Once: what changes later is compiled when it is called.
$(COMPILED): | $(PACKAGE)
	@echo "Compiling what tracking takes (once, on all processors)"
	@$(RUN) tools/compile_ahead.py
	@touch $@

demo: setup check-system  ## track a real recording of a person by contours and points; results in out/demo
	@$(RUN) -m tracker_node.cli.main demo --output $(OUT)/demo

# Two at once, each file's tests in one process, which makes what they share once.
PYTEST := $(RUN) -m pytest -n $(JOBS) --dist loadfile

# The types take a minute of a processor at the first time, which the tests need: `make lint` has them.
test: setup check-system  ## import contract, ruff and the tests that take no more than seconds each
	@$(VENV)/bin/lint-imports
	@$(VENV)/bin/ruff check .
	@$(PYTEST) -m "not long and not ros" $(PYTEST_ARGS)

test-long: setup check-system  ## real processes, walkthroughs of the pages, drills, soak and fuzz
	@$(PYTEST) --timeout 900 -m "long and not ros" $(PYTEST_ARGS)

# TRACKER_ROS2_ENV names the folder whose env.sh makes `ros2` and `launch` available, with this package installed in it.
test-ros: setup check-system  ## what needs the real ros2 command and launch
	@$(PYTEST) -m ros $(PYTEST_ARGS)

# American spelling; words of the field are in pyproject.toml.
SPELLED := README.md CONTRIBUTING.md docs tracker_node test benchmark config tools msgs launch examples

lint: setup  ## import contract, style, spelling, docstrings and types
	@$(VENV)/bin/lint-imports
	@$(VENV)/bin/ruff check .
	@$(VENV)/bin/codespell $(SPELLED)
	@$(RUN) tools/check_docstrings.py tracker_node
	@$(VENV)/bin/mypy

docs: setup  ## searchable site of the pages and the API in out/docs; a broken link fails
	@$(RUN) tools/site/build.py --output $(OUT)/docs
	@echo "$(OUT)/docs/index.html"

benchmark: setup check-system  ## quick run of every benchmark; JSON in out/benchmark
	@$(RUN) benchmark/_all.py --quick --output $(OUT)/benchmark

benchmark-full: setup check-system  ## full run of every benchmark; puts the figures into docs/measured.md
	@status=0; $(RUN) benchmark/_all.py --output $(OUT)/benchmark || status=$$?; \
	$(RUN) benchmark/_measured.py --json-folder $(OUT)/benchmark && exit $$status

clean:  ## remove .venv and everything that was built or written
	rm -rf $(VENV) $(OUT) build install log *.egg-info msgs/build .pytest_cache .mypy_cache .ruff_cache .import_linter_cache .hypothesis
	find tracker_node test benchmark -name __pycache__ -type d -prune -exec rm -rf {} + 2>/dev/null || true
