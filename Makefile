# `make demo` and `make test` need only Python 3.11-3.13 and a network to the package index. Another interpreter than
# the first suitable one: make PYTHON=/path/to/python3.12 ...
BIN := .venv/bin
# Without what Python keeps of a file that it has compiled, every process of the tests spends seconds on compiling.
export PYTHONDONTWRITEBYTECODE :=
# Types are checked on one core while the kernels are compiled on the other. Their lines are kept whole. Any other
# target must show at once what it says, e.g. the address of the live view.
ifneq ($(filter test,$(MAKECMDGOALS)),)
MAKEFLAGS += --jobs=2 --output-sync=line
endif

.PHONY: help demo test test-slow test-long kernels lint format docs release lock venv venv-isaac clean

help:  ## list the targets
	@grep -E '^[a-z-]+:.*##' Makefile | sed -E 's/:.*## /\t/' | expand -t 12

demo: venv  ## the standing robot pulls loosened screws from the pack in the twin
	$(BIN)/golem demo

test: lint kernels  ## lint, types and the fast tests
	$(BIN)/pytest -n 2 -m "not slow" --durations=15

test-slow: venv-dev  ## the tests that take more than a few seconds, up to a minute
	$(BIN)/pytest -n 2 -m "slow and not alone and not long" --durations=40
	$(BIN)/pytest -m "slow and alone and not long" --durations=15

test-long: venv-dev  ## more trials and more mutations of what the others check; before a release
	$(BIN)/pytest -n 2 -m "long and not alone"
	$(BIN)/pytest -m "long and alone"

kernels: venv-dev  ## compile the numba kernels, once for all tests
	$(BIN)/golem doctor --compile

lint: venv-dev  ## style and types
	$(BIN)/ruff check src tests scripts examples
	$(BIN)/ruff format --check src tests scripts examples
	$(BIN)/pyright

format: venv-dev  ## rewrite the sources in the project's style
	$(BIN)/ruff check --fix src tests scripts examples
	$(BIN)/ruff format src tests scripts examples

docs: venv-docs  ## build the documentation into site/
	$(BIN)/mkdocs build --strict

release: venv-docs  ## wheel, sdist, docs, bill of materials and checksums of a tagged version into dist/
	scripts/release.sh

lock: venv-dev  ## resolve the requirements again (UPGRADE=--upgrade takes newer releases)
	scripts/lock.sh $(UPGRADE)

venv:  ## create .venv with what `golem` needs to run, to be watched in a browser, and to write reports
	@PYTHON="$(PYTHON)" scripts/bootstrap.sh core report view

venv-isaac:  ## create .venv-isaac with Isaac Lab for the robot `isaaclab` (PYTHON: a Python 3.12)
	@PYTHON="$(PYTHON)" scripts/venv_isaac.sh

venv-%:
	@PYTHON="$(PYTHON)" scripts/bootstrap.sh $*

clean:  ## remove everything the targets above created
	rm -rf .venv .venv-* .uv .cache site dist .pytest_cache .ruff_cache .hypothesis
