# make demo: the main job on the shipped boomerang. make test: the tests. Both set up .venv first, for what they run.
PYTHON ?= python3
BIN := .venv/$(if $(filter Windows_NT,$(OS)),Scripts,bin)
INSTALL := -m pip install --quiet --disable-pip-version-check
BUILT_FROM := pyproject.toml evidence/pyproject.toml setup.py $(wildcard forceid/*/*.cpp forceid/*/*.hpp forceid/*.hpp)

# the tests start a hundred processes: byte code is kept for them, whatever the shell says
test test-long kernels: export PYTHONDONTWRITEBYTECODE :=
# two workers on two cores: each with one thread of BLAS
test test-long kernels: export OPENBLAS_NUM_THREADS := 1

.PHONY: charts demo test test-long lint kernels bench study docs remake wheel clean
demo: .venv/ready
	$(BIN)/forceid demo -o demo

test: .venv/test-ready
	$(BIN)/pytest -n 2 --dist worksteal

# style, imports that go down only, types, spelling of what people read
lint: .venv/test-ready
	$(BIN)/ruff check .
	$(BIN)/lint-imports
	$(BIN)/mypy
	$(BIN)/typos README.md CONTRIBUTING.md CHANGELOG.md docs notebooks

# the claims that take long to check: drawn records in numbers, notebooks, the site, processes that are killed
test-long: .venv/test-ready
	$(BIN)/pytest -n 2 --dist worksteal -m long

# the numerical core under three kernels of BLAS, with the scalar and the vector engines
NUMERICAL := tests/kalman/test_square_root.py tests/kalman/test_linear.py tests/flight/test_long_flight.py \
  tests/motion/test_pose.py tests/principal tests/partition/test_dynamics.py \
  tests/partition/test_commands.py tests/pseudorigid tests/estimation/body/test_affine_lever.py \
  tests/estimation/methods/test_classic.py tests/estimation/body/test_kinematics.py tests/estimation/test_run.py
kernels: .venv/test-ready
	@for run in Prescott:baseline:sse2 Haswell:v3:avx2 SkylakeX:v4:avx512f; do \
	  set -- $$(echo $$run | tr : ' '); \
	  if grep -qw "$$3" /proc/cpuinfo; then \
	    echo "BLAS kernel $$1, engine $$2"; \
	    OPENBLAS_CORETYPE=$$1 FORCEID_ENGINE_ARCH=$$2 $(BIN)/pytest -n 2 --dist worksteal -m 'long or not long' $(NUMERICAL) || exit 1; \
	  else echo "BLAS kernel $$1 skipped: this processor has no $$3"; fi; \
	done

# paired ratios against the peers, which live in a venv of their own; BENCH=--quick for under 90 s
bench: .venv-bench/ready
	.venv-bench/bin/python -m evidence.races -o bench $(BENCH)

# error over bound of flights drawn from their prior
study: .venv/test-ready
	$(BIN)/python -m evidence.claims.strict

# the site, into docs/_build/html; notebooks run when they have changed
docs: .venv/test-ready
	$(BIN)/sphinx-build -j 2 -W --keep-going -q -b html docs docs/_build/html

# every method and peer on every scene, and where each of them breaks, into docs/; resumes where it stopped
charts: .venv-bench/ready
	.venv-bench/bin/forceid chart -o docs/chart $(CHART)
	.venv-bench/bin/forceid stress -o docs/stress $(CHART)

# every table and picture of the site, into remade/; resumes where it stopped. REMAKE='--minutes 60' for a night
remake: .venv-bench/ready
	.venv-bench/bin/python -m evidence.remake -o remade $(REMAKE)

# source archive and wheels into dist/; that wheel, and one made without compiler, run the demo where nothing else is
wheel:
	rm -rf dist .venv-wheel
	$(PYTHON) -m venv .venv-wheel/build
	.venv-wheel/build/bin/python -m pip install --quiet --disable-pip-version-check build==1.6.1
	.venv-wheel/build/bin/python -m build --outdir dist/compiled .
	CC=false CXX=false .venv-wheel/build/bin/python -m pip wheel --quiet --disable-pip-version-check --no-deps \
	  --no-cache-dir --wheel-dir dist/numpy dist/compiled/forceid-*.tar.gz
	.venv-wheel/build/bin/python -m build --wheel --outdir dist/evidence evidence
	for engine in compiled numpy; do \
	  $(PYTHON) -m venv .venv-wheel/$$engine && \
	  .venv-wheel/$$engine/bin/python -m pip install --quiet --disable-pip-version-check dist/$$engine/*.whl dist/evidence/*.whl && \
	  (cd .venv-wheel && $$engine/bin/forceid --version | grep "engine $$engine" && \
	   $$engine/bin/forceid demo -o demo-$$engine && $$engine/bin/forceid stress --help >/dev/null && $$engine/bin/python -c "import forceid; \
	   print(forceid.summarize(forceid.estimate(forceid.open_motion('demo-$$engine/boomerang.h5'), method='savgol')).force_error)") \
	  || exit 1; \
	done

.venv-bench/ready: requirements.txt requirements-test.txt requirements-bench.txt $(BUILT_FROM)
	test -x .venv-bench/bin/python || $(PYTHON) -m venv .venv-bench
	.venv-bench/bin/python $(INSTALL) -r requirements-bench.txt
	.venv-bench/bin/python $(INSTALL) --no-deps --no-build-isolation --editable . --editable evidence
	touch $@

# the engine is compiled while the rest is installed
.venv/ready: requirements.txt $(BUILT_FROM)
	test -x $(BIN)/python || $(PYTHON) -m venv .venv
	$(BIN)/python $(INSTALL) $$(grep -E '^(packaging|pybind11|setuptools|setuptools-scm|vcs-versioning)==' requirements.txt)
	$(BIN)/python $(INSTALL) --no-deps --no-build-isolation --editable . --editable evidence & \
	  $(BIN)/python $(INSTALL) -r requirements.txt && wait $$!
	$(BIN)/python -m compileall -q forceid evidence
	touch $@

.venv/test-ready: requirements-test.txt .venv/ready
	$(BIN)/python $(INSTALL) -r requirements-test.txt
	touch $@

clean:
	rm -rf .venv .venv-bench .venv-wheel build dist bench remade *.egg-info demo docs/_build forceid/*/*.so evidence/*.egg-info evidence/build
