# seamlog: each verb sets up what it needs; only python3 with its venv module, and make, are assumed.
PYTHON ?= python3
BIN := .venv/bin

.DEFAULT_GOAL := demo
.PHONY: demo

.venv/.locked: requirements/dev.lock
	$(PYTHON) -m venv .venv
	$(BIN)/pip install --quiet --disable-pip-version-check --require-hashes -r requirements/dev.lock
	touch $@

# The project itself, editable: entry points, links and uPlot.
.venv/.installed: .venv/.locked pyproject.toml $(wildcard build_tools/*.py)
	$(BIN)/pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation -e .
	touch $@

.venv: .venv/.installed

demo: .venv
	$(BIN)/seamlog demo -o demo --force
