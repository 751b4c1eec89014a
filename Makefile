# Every target makes what it needs. `make help` lists them.
MAKEFLAGS += --no-print-directory
.DEFAULT_GOAL := help

PYTHON ?= python3
MODULE ?=
ARITH  ?=
TAPS   ?=
SIM    ?=
DATA   ?=
SEED   ?=
WAVES  ?=
CLOCK  ?=
COUNTED ?=
STEP   ?=
QUICK  ?=
TRADE  ?= full

VENV   := .venv
READY  := $(VENV)/.ready
RUN    := $(VENV)/bin/python
ARITH_FLAG := $(if $(ARITH),--arith='$(ARITH)')
TAPS_FLAG  := $(if $(TAPS),--taps='$(TAPS)')
SIM_FLAGS  := $(if $(MODULE),--module '$(MODULE)') $(ARITH_FLAG) $(TAPS_FLAG) $(if $(SIM),--sim '$(SIM)') \
              $(if $(DATA),--data '$(DATA)') $(if $(SEED),--seed '$(SEED)') $(if $(filter-out 0,$(WAVES)),--waves)

.PHONY: help sim replay test vectors lint format mutate formal synth vivado coverage precision score figures bench scenes compression trade terrain extremes scale registers readme clean

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z]+:.*## / { printf "  make %-11s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

sim: $(READY) ## simulate all against their models [MODULE=] [ARITH=] [TAPS=] [SIM=verilator|icarus] [DATA=file] [SEED=] [WAVES=1]
	@$(RUN) scripts/sim.py $(SIM_FLAGS)

replay: $(READY) ## run a whole file through the core and compare every record, DATA=file [ARITH=] [TAPS=] [SIM=verilator|icarus]
	@$(RUN) scripts/replay.py $(if $(DATA),--data '$(DATA)') $(ARITH_FLAG) $(TAPS_FLAG) $(if $(SIM),--sim '$(SIM)')

test: $(READY) ## run all tests: the model's and the RTL's, on every simulator found [ARITH=fixed|float16|float32|float64] [COUNTED=0]
	@$(RUN) -m pytest -n auto --dist worksteal $(ARITH_FLAG) $(if $(filter 0,$(COUNTED)),-m 'not counted')

vectors: $(READY) ## stream a million vectors through every float unit, where `make test` takes 20,000
	@OPENECHO_FLOAT_VECTORS=1000000 $(RUN) -m pytest -n auto tb/float

lint: $(READY) ## ruff, mypy, and Verilator and Verible on the RTL
	@$(RUN) scripts/lint.py

format: $(READY) ## lay out Python and SystemVerilog
	@$(RUN) scripts/lint.py --fix

mutate: $(READY) ## break the RTL line by line and count what the benches catch
	@$(RUN) scripts/mutate.py

formal: $(READY) ## prove the control of every module, and that each proof fails with a planted fault [MODULE=]
	@$(RUN) scripts/formal.py --faults $(if $(MODULE),--module '$(MODULE)')

synth: $(VENV)/.synth ## area on xc7, with CLOCK=1 also the clock on ECP5, of all modules and float units [MODULE=] [CLOCK=1]
	@$(RUN) scripts/synth.py $(if $(MODULE),--module '$(MODULE)') $(if $(filter-out 0,$(CLOCK)),--clock)

vivado: $(READY) ## run Vivado: synthesis, routing, IP package, Zynq design [STEP=synth|impl|package|bd] [ARITH=] [TAPS=]
	@$(RUN) scripts/vivado.py $(if $(STEP),--step '$(STEP)') $(ARITH_FLAG) $(TAPS_FLAG)

coverage: $(READY) ## lines and branches of the RTL that the benches reach, at least 98 %, and toggles of its bits
	@$(RUN) scripts/coverage.py

precision: $(READY) ## Monte Carlo of the echo position against the Cramér–Rao bound [SEED=]
	@$(RUN) -m openecho.study.precision $(if $(SEED),--seed '$(SEED)')

score: $(READY) ## judge the echoes of every tap set by the references that a file carries, DATA=file [ARITH=]
	@mkdir -p build/reports
	@$(VENV)/bin/openecho score $(if $(DATA),'$(DATA)') $(ARITH_FLAG) --output build/reports/score.json

figures: $(READY) ## the V–L paper's figures, ours: accumulation, wavelet, Vondrák, Gaussian against laser template [SEED=]
	@$(RUN) -m openecho.study.enhancement $(if $(SEED),--seed '$(SEED)')

bench: $(VENV)/.bench ## speed and precision of the Gaussian fit beside gdecomp and curve_fit, on one core [SEED=] [QUICK=1]
	@$(RUN) -m openecho.study.bench $(if $(SEED),--seed '$(SEED)') $(if $(filter-out 0,$(QUICK)),--quick)

scenes: $(READY) ## methods against the truth of every bundled scene, its plan against full fidelity, speed, a recorded set [SEED=]
	@$(RUN) -m openecho.study.scenes $(if $(SEED),--seed '$(SEED)')

compression: $(READY) ## bits a sample and speed of the lossless codec beside zlib, zstd and xz, on recorded files
	@$(RUN) -m openecho.study.compression

trade: $(if $(filter quick,$(TRADE)),$(READY),$(VENV)/.synth) ## what speed costs: every way to decompose, its accuracy, area and speed; 20 minutes [TRADE=quick] [SEED=]
	@$(RUN) scripts/ways.py --extent '$(TRADE)'
	@$(RUN) -m openecho.study.trade --extent '$(TRADE)' $(if $(SEED),--seed '$(SEED)')

terrain: $(VENV)/.bench ## from waveforms to terrain with its truth: methods, ground filters, cost of a million points; 20 minutes [QUICK=1] [SEED=]
	@$(RUN) -m openecho.study.terrain $(if $(SEED),--seed '$(SEED)') $(if $(filter-out 0,$(QUICK)),--quick)

extremes: $(READY) ## numerical stability at the extremes: what is tried, guaranteed and found, each guarantee broken once [SEED=] [QUICK=1]
	@$(RUN) -m openecho.study.extremes $(if $(SEED),--seed '$(SEED)') $(if $(filter-out 0,$(QUICK)),--quick)

scale: $(READY) ## speed and memory on a large granule, interrupted, resumed and in two processes [SEED=]
	@$(RUN) -m openecho.study.scale $(if $(SEED),--seed '$(SEED)')

registers: $(READY) ## make the SystemVerilog package, the C header and the README's table of the registers
	@$(RUN) scripts/registers.py

readme: $(READY) ## copy the figures of build/reports/ into README.md
	@$(RUN) scripts/readme.py

clean: ## remove everything that make made
	rm -rf build $(VENV) .mypy_cache .pytest_cache .ruff_cache

# All set-up is here: one virtual environment with what pyproject.toml asks for, marked ready only when complete.
$(READY): pyproject.toml
	@command -v $(PYTHON) >/dev/null || { echo 'error: $(PYTHON) not found: expected Python 3.11 or newer' >&2; exit 2; }
	@$(PYTHON) -c 'import sys; v = sys.version_info; v >= (3, 11) or sys.exit( "error: $(PYTHON) is Python %d.%d: expected 3.11 or newer (make PYTHON=...)" % v[:2])'
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || { echo 'error: $(PYTHON) has no venv module: expected it installed (Debian: apt-get install python3-venv)' >&2; exit 2; }
	@echo 'setting up $(VENV) from pyproject.toml (once, a minute or two)'
	@$(RUN) -c '' 2>/dev/null || $(PYTHON) -m venv --clear $(VENV)
	@$(RUN) -m pip install --quiet --disable-pip-version-check --editable '.[dev]'
	@touch $@

# The open synthesis tools, only where they are wanted.
$(VENV)/.synth: $(READY)
	@$(RUN) -m pip install --quiet --disable-pip-version-check --editable '.[synth]'
	@touch $@

# What the fits are compared with is built from source.
$(VENV)/.bench: $(READY)
	@$(RUN) -m pip install --quiet --disable-pip-version-check --editable '.[bench]'
	@touch $@
