# seamlog: each verb sets up what it needs; only python3 with its venv module, and make, are assumed.
PYTHON ?= python3
BIN := .venv/bin
PIP := pip install --quiet --disable-pip-version-check
PYTEST := -m pytest -n 2 --dist loadfile
ARGS ?=

.DEFAULT_GOAL := help
.PHONY: help demo test lint bench soak docs test-wheel wheel lock clean

help:
	@echo "make demo        record, analyse and report a virtual weld into demo/"
	@echo "make test        every test but the long ones"
	@echo "make soak        the long ones"
	@echo "make lint        ruff, mypy and the import contracts"
	@echo "make bench       every benchmark, beside its peers (ARGS=--json for programs)"
	@echo "make docs        the generated parts of docs/ and THIRD_PARTY.md"
	@echo "make test-wheel  the tests against the built wheel, away from this tree"
	@echo "make wheel       the wheel, in dist/"
	@echo "make lock        requirements/*.lock and package-lock.json anew"

demo: .venv
	$(BIN)/seamlog demo -o demo --force

test: .venv node_modules/.installed
	$(BIN)/python $(PYTEST) -m "not soak" $(ARGS)

soak: .venv node_modules/.installed
	$(BIN)/python -m pytest -m soak --timeout 1800 $(ARGS)

lint: .venv
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	$(BIN)/lint-imports

bench: .venv/.bench
	@failed=""; for script in benchmarks/[a-z]*.py; do \
		$(BIN)/python $$script $(ARGS) || failed="$$failed $$script"; \
	done; test -z "$$failed" || { echo "failed:$$failed" >&2; exit 1; }

docs: .venv
	$(BIN)/python build_tools/docs.py
	$(BIN)/python build_tools/third_party.py

wheel: .venv
	SEAMLOG_RELEASE=1 $(BIN)/pip wheel --quiet --no-deps --no-build-isolation -w dist .

# The tests and what they read, without the four source folders: only the installed wheel is left.
test-wheel: wheel .venv-wheel/.locked node_modules/.installed
	.venv-wheel/bin/$(PIP) --no-deps --force-reinstall dist/seamlog-*.whl
	$(BIN)/python build_tools/run_apart.py .venv-wheel/bin/python $(PYTEST) -m "not soak" $(ARGS)

lock:
	$(PYTHON) -m venv .venv-lock
	.venv-lock/bin/$(PIP) uv
	.venv-lock/bin/python build_tools/lock.py $(ARGS)

clean:
	rm -rf .venv .venv-* node_modules build dist demo reports/assets/uplot *.egg-info
	rm -rf .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache

.PHONY: .venv
.venv: .venv/.installed

.venv/.locked .venv-wheel/.locked: requirements/dev.lock
	$(PYTHON) -m venv $(@D)
	$(@D)/bin/$(PIP) --require-hashes -r requirements/dev.lock
	touch $@

# The project itself, editable: entry points and uPlot.
.venv/.installed: .venv/.locked pyproject.toml $(wildcard build_tools/*.py)
	$(BIN)/python build_tools/uplot.py
	$(BIN)/$(PIP) --no-deps --no-build-isolation -e .
	touch $@

.venv/.bench: .venv/.installed requirements/bench.lock
	$(BIN)/$(PIP) --require-hashes -r requirements/bench.lock
	touch $@

node_modules/.installed: package-lock.json .venv/.locked
	$(BIN)/python build_tools/npm.py ci
	touch $@
