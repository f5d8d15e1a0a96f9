# make demo: the main job on the shipped boomerang. make test: every check. Both set up .venv first.
PYTHON ?= python3
BIN := .venv/bin

.PHONY: demo test clean
demo: .venv/ready
	$(BIN)/forceid demo -o demo

test: .venv/ready
	$(BIN)/ruff check .
	$(BIN)/lint-imports
	$(BIN)/mypy
	$(BIN)/pytest -n 2

.venv/ready: requirements.txt pyproject.toml
	test -x $(BIN)/python || $(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -r requirements.txt
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable .
	touch $@

clean:
	rm -rf .venv build dist *.egg-info demo
