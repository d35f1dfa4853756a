# make run         the paper's case, from microstructure to fuzzy vibration, into results/paper/
# make test        the tests (slower ones: make test-slow)
# make bench-solver, make charts, make stability    what the methods cost and where they end
# The environment is made on first use; make clean-env removes it.
CASE ?= cases/paper.toml
WORKERS ?= 2
OUT ?= results/$(basename $(notdir $(CASE)))
IN = ./enter

.PHONY: run test test-slow lint charts bench-solver stability docs clean clean-env

run:
	$(IN) python -m alphacut run $(CASE) --out $(OUT) --workers $(WORKERS) $(if $(FRESH),--fresh)

test:
	$(IN) python -m pytest -m "not slow" $(PYTEST)

test-slow:
	$(IN) python -m pytest -m slow $(PYTEST)

bench-solver:
	$(IN) python -m benchmarks.cell_solvers

lint:
	ruff check . && ruff format --check .
	$(IN) mypy --strict alphacut stochastic rve fuzzy frame

charts:
	$(IN) python -m benchmarks.cell_charts

stability:
	$(IN) python -m benchmarks.cell_stability

clean:
	rm -rf results build

clean-env:
	./enter --clean
