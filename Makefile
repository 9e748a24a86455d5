.PHONY: help setup browser demo test lint lab docs soak bench lock clean

export LC_ALL := C.UTF-8
export TZ := UTC
# The problems are small: threads in BLAS only get in each other's way.
export OMP_NUM_THREADS := 1
export OPENBLAS_NUM_THREADS := 1

python := .venv/bin/python

help:
	@echo 'make demo    set up if needed, then solve the demonstration problem into demo/'
	@echo 'make test    set up if needed, then run the tests, ruff and mypy'
	@echo 'make lint    ruff and mypy alone'
	@echo 'make lab     the notebooks in JupyterLab, on loopback'
	@echo 'make docs    the documentation as a site, in build/docs/html'
	@echo 'make soak    the long random test'
	@echo 'make bench   times against peers, in one run'
	@echo 'make lock    renew requirements.lock from pyproject.toml (LOCKFLAGS=--upgrade takes newer releases)'
	@echo 'make clean   remove what these made, .venv included'
	@echo 'PYTHON=...   the interpreter to build .venv with (3.11 or later)'

setup:
	@bash tools/setup.sh

demo: setup
	$(python) -m problems.clemen_rupp --output demo

browser:
	@bash tools/setup.sh browser

test: setup browser
	$(python) -m pytest --numprocesses 2 --dist worksteal
	@$(MAKE) --no-print-directory lint

lint: setup
	$(python) -m ruff check
	$(python) -m mypy trajopt norms scara problems bench

lab: setup
	$(python) -m jupyterlab --ip=127.0.0.1 $(if $(filter 0,$(shell id -u)),--allow-root) notebooks

docs: setup
	$(python) -m docs.build

bench: setup
	$(python) -m bench.run --output build/bench

soak: setup
	$(python) -m tests.soak

UV = .setup/uv/bin/uv

.setup/uv/bin/uv:
	$(or $(PYTHON),python3) -m venv .setup/uv
	.setup/uv/bin/python -m pip install --quiet uv

# Compiled from the present lock, so that without --upgrade only what must change changes.
lock: $(UV)
	@mkdir -p .setup
	cp requirements.lock .setup/new.lock
	$(UV) pip compile pyproject.toml --extra build --extra test --extra cluster --extra notebooks --extra docs --extra bench --universal --python-version 3.11 \
	    --generate-hashes --no-header --no-annotate --quiet $(LOCKFLAGS) --output-file .setup/new.lock
	@! grep -nE '://|^-' .setup/new.lock || { echo 'lock: it names a host or an option, not kept' >&2; exit 1; }
	mv .setup/new.lock requirements.lock

clean:
	rm -rf .venv .setup demo build *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
