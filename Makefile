# make demo: the main job on the shipped boomerang. make test: every check. Both set up .venv first.
PYTHON ?= python3
BIN := .venv/bin

.PHONY: charts demo test bench study docs clean
demo: .venv/ready
	$(BIN)/forceid demo -o demo

test: .venv/ready
	$(BIN)/ruff check .
	$(BIN)/lint-imports
	$(BIN)/mypy
	$(BIN)/pytest -n 2

# paired ratios against the peers, which live in a venv of their own; BENCH=--quick for under 90 s
bench: .venv-bench/ready
	.venv-bench/bin/python -m benchmarks -o bench $(BENCH)

# what the estimators reach, into docs/
study: .venv/ready
	$(BIN)/python -m benchmarks.estimation

# the site, into docs/_build/html; notebooks run when they have changed
docs: .venv/ready
	$(BIN)/sphinx-build -W --keep-going -q -b html docs docs/_build/html

# every method and peer on every scene, and where each of them breaks, into docs/; resumes where it stopped
charts: .venv-bench/ready
	.venv-bench/bin/forceid chart -o docs/chart $(CHART)
	.venv-bench/bin/forceid stress -o docs/stress $(CHART)

.venv-bench/ready: requirements.txt requirements-bench.txt pyproject.toml setup.py forceid/kalman/_compiled.cpp forceid/kalman/_flight.cpp forceid/motion/_poses.cpp forceid/pseudorigid/_polar.cpp forceid/pseudorigid/_splitting.cpp
	test -x .venv-bench/bin/python || $(PYTHON) -m venv .venv-bench
	.venv-bench/bin/python -m pip install --quiet --disable-pip-version-check -r requirements-bench.txt
	.venv-bench/bin/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable .
	touch $@

.venv/ready: requirements.txt pyproject.toml setup.py forceid/kalman/_compiled.cpp forceid/kalman/_flight.cpp forceid/motion/_poses.cpp forceid/pseudorigid/_polar.cpp forceid/pseudorigid/_splitting.cpp
	test -x $(BIN)/python || $(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -r requirements.txt
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable .
	touch $@

clean:
	rm -rf .venv .venv-bench build dist bench *.egg-info demo docs/_build forceid/*/*.so
