# saltus: `make` lists the targets. PYTHON=python3.12 make ... chooses the interpreter.
.POSIX:
.NOTPARALLEL:
.PHONY: help demo test campaign coverage thorough lint bench dist docs gallery lock clean

BIN = .venv/bin
PYTEST_ARGS = -n 2 --dist worksteal
LOCK_ARGS =
DIST_ARGS =

help: ## list the targets
	@sed -n 's/^\([a-z]*\):.*## /\1\t/p' Makefile | expand -t 8

demo: ## compute figure 3 of the paper into results/
	@tools/make_env.sh run
	$(BIN)/saltus reproduce fig3 -o results/

test: lint ## all checks: those of lint, then the tests (PYTEST_ARGS="-n 0 -k flow")
	$(BIN)/python tools/run_tests.py -m "not campaign" $(PYTEST_ARGS)

campaign: ## tests that guard no single change; then points and words with three kernels of OpenBLAS
	@tools/make_env.sh test
	$(BIN)/python tools/run_tests.py -m "campaign and not thorough" $(PYTEST_ARGS)
	$(BIN)/python tests/campaign/rounding.py

coverage: ## how often intervals of fits hold the true values: five systems, 50 sets of data each, an hour
	@tools/make_env.sh test
	$(BIN)/python tests/campaign/fit_intervals.py

thorough: ## before a release: the many random systems of which the campaign runs some
	@tools/make_env.sh test
	$(BIN)/python tools/run_tests.py -m thorough $(PYTEST_ARGS)
	$(BIN)/python tests/campaign/rounding.py --all

lint: ## style, types and the contract between the floors
	@tools/make_env.sh test
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports --no-logo

bench: ## run the benchmarks, append to benchmarks/history.csv; benchmarks/README.md keeps results with reasons
	@tools/make_env.sh run
	@set -e; for file in benchmarks/bench_*.py; do echo "$$file"; BENCH_HISTORY=benchmarks/history.csv $(BIN)/python "$$file"; done
	$(BIN)/python tools/bench_page.py

dist: ## build sdist and wheel, check them, try the wheel in fresh environments (DIST_ARGS="--python python3.13")
	@tools/make_env.sh run
	$(BIN)/python tools/dist.py $(DIST_ARGS)

docs: ## build the site of the documentation into build/site; a warning is an error
	@tools/make_env.sh docs
	$(BIN)/python tools/site/stage.py

gallery: ## draw the pictures of the examples anew whose code has changed
	@tools/make_env.sh run
	$(BIN)/python tools/gallery.py

lock: ## renew the lock files after a change of pyproject.toml (LOCK_ARGS=--upgrade: all to the newest)
	@tools/lock.sh $(LOCK_ARGS)

clean: ## remove .venv and all caches; results/ stays
	rm -rf .venv .venv-lock build dist .pytest_cache .mypy_cache .ruff_cache .import_linter_cache .hypothesis
	find . -path ./.git -prune -o -name __pycache__ -type d -prune -exec rm -rf {} +
