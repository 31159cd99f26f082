# evertwin. Needs Python 3.11 or newer; everything else goes into .venv, without root rights.
#
#   make demo    both embedded machines improve their own models
#   make test    the tests (CI=true: nothing may be skipped)

SHELL := /bin/bash
BIN := .venv/bin
WORKERS ?= 2
FIND := for p in python3.11 python3.12 python3.13 python3.14 python3; do \
	$$p -c 'import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 11))' 2>/dev/null \
	&& { command -v $$p; break; }; done
PYTHON ?= $(shell $(FIND))
NEEDS := pyproject.toml constraints.txt
# Compiled on all processors afterwards; pip does it on one. What is broken Python is a template. Nobody
# imports the tests of others.
define INSTALL
$(BIN)/python tools/alive.py installing $(BIN)/python -m pip install --no-compile -c constraints.txt -e
endef
COMPILE := $(BIN)/python tools/alive.py compiling $(BIN)/python -m compileall -qq -j 0 -x '/tests?/' .venv/lib || true

.PHONY: help venv demo test kernels lint types reference docs pages commands notebooks bench
.PHONY: coverage prove wheel clean again
.DEFAULT_GOAL := help

help:
	@sed -n 's/^#   //p' Makefile
	@echo "also: venv kernels lint types reference docs notebooks bench coverage prove wheel clean again"

.venv/pyvenv.cfg:
	@test -n "$(PYTHON)" || { echo "No Python 3.11 or newer with venv was found: install it" \
		"(Debian: python3-venv), or name one: make PYTHON=/path/to/python" >&2; exit 1; }
	$(PYTHON) tools/alive.py "making .venv" $(PYTHON) -m venv .venv

# A stamp says what is installed, so that the second call costs nothing.
.venv/.has-all: .venv/pyvenv.cfg $(NEEDS)
	$(INSTALL) '.[all]'
	@$(COMPILE)
	@touch $@

.venv/.has-dev: .venv/pyvenv.cfg $(NEEDS)
	$(INSTALL) '.[all,dev,docs]'
	@$(COMPILE)
	@touch $@ .venv/.has-all

.venv/.has-bench: .venv/.has-dev
	$(INSTALL) '.[all,bench]'
	@$(COMPILE)
	@touch $@

venv: .venv/.has-dev

demo: .venv/.has-all
	$(BIN)/evertwin demo --live

test: .venv/.has-dev
	$(BIN)/python -m pytest -n $(WORKERS) $(if $(filter true 1 yes,$(CI)),--durations=40)

# What failed, one test at a time and with nothing beside it.
again: .venv/.has-dev
	$(BIN)/python -m pytest --last-failed --last-failed-no-failures none

# Counting lines takes half as long again as the tests themselves.
coverage: .venv/.has-dev
	CI=true $(BIN)/python -m pytest -n $(WORKERS) --cov --cov-report=term

kernels: .venv/.has-dev
	$(BIN)/python -m tools.compile_kernels

lint: .venv/.has-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: .venv/.has-dev
	$(BIN)/mypy

reference: .venv/.has-dev
	$(BIN)/python -m tools.write_reference

docs: pages commands

pages: .venv/.has-dev
	$(BIN)/sphinx-build -W --keep-going -q -b html docs docs/_build/html

commands: .venv/.has-dev
	$(BIN)/python tools/run_docs.py

notebooks: .venv/.has-dev
	$(BIN)/python tools/run_notebooks.py

bench: .venv/.has-bench
	$(BIN)/python -m benchmarks

prove: .venv/.has-bench
	$(BIN)/python -m proofs
	CI=true $(BIN)/python -m pytest -n $(WORKERS) -m long

wheel: .venv/.has-dev
	rm -rf dist
	$(BIN)/python -m build --wheel --no-isolation --outdir dist .
	$(BIN)/python tools/try_wheel.py dist

clean:
	rm -rf build dist docs/_build .coverage .coverage.* htmlcov
	rm -rf .mypy_cache .pytest_cache .ruff_cache .hypothesis .import_linter_cache
