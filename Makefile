# Everything starts from Python 3.11 or later with pip, make and a C library; see README.md.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/$(if $(filter Windows_NT,$(OS)),Scripts,bin)
READY := $(VENV)/.ready
COMPILED := $(VENV)/.compiled
# Tests wait for child processes now and then: one worker more than there are processors.
TEST_WORKERS = $(shell $(PYTHON) -c 'import os; print(1 + (os.cpu_count() or 1))')
# Without bytecode on disk each of some thousand child processes compiles its modules again.
unexport PYTHONDONTWRITEBYTECODE

# What Qt 6 needs of the system on Debian and Ubuntu, and the virtual-environment module their Python lacks.
QT_PACKAGES := libegl1 libgl1 libopengl0 libxkbcommon0 libxkbcommon-x11-0 libdbus-1-3 libfontconfig1 libglib2.0-0 \
	libxcb-cursor0 libxcb-icccm4 libxcb-image0 libxcb-keysyms1 libxcb-randr0 libxcb-render-util0 libxcb-shape0 \
	libxcb-shm0 libxcb-sync1 libxcb-xfixes0 libxcb-xinerama0 libxcb-xkb1
# What compiles the Arduino firmware, and the simulator that its tests run it in.
FIRMWARE_PACKAGES := gcc-avr avr-libc gcc libc6-dev libsimavr-dev libelf-dev
# A window system, its window manager, and hands of an operator, for tests of the window.
DESKTOP_TEST_PACKAGES := xvfb openbox xdotool xclip

# What logs the system calls that the drill of a power cut rebuilds disks from, and mounts a disk that hangs.
TEST_PACKAGES := strace bindfs gcc libc6-dev

.PHONY: same-python audit licences wheel drill-tools test-tools docs translations help setup installed run test lint types types-host types-win32 types-darwin compiled collected bench bench-recording bench-desktop peers windows packages try-packages quick-environment quick-test screenshots study drill lock system-libraries firmware firmware-tools desktop-tools

help:
	@echo "make setup   virtual environment .venv with the locked packages, and what Qt needs of the system"
	@echo "make run     the window on the simulated stand; without a display, 'slipstand demo'"
	@echo "make test    all tests; with another Python by PYTHON=python3.13 VENV=.venv-3.13"
	@echo "make lint    ruff, mypy, import contracts, the schema of workflows"
	@echo "make bench   benchmarks, ratios in one run (docs/benchmarks.md)"
	@echo "make bench-recording   recording, release detection, library and recovery, a quarter of an hour"
	@echo "make bench-desktop     repaint, wire to screen, start, the handle of f_d; a minute"
	@echo "make study   statistics on simulated records of known truth (docs/validation.md); an hour on two idle cores"
	@echo "make drill   kills, pulled cables, full disks, rubbish: an hour (docs/reliability.md)"
	@echo "make peers   drivers, simulated devices and firmware against programs that are not ours (docs/peers.md)"
	@echo "make windows  demo, ports, window and tests on Windows' Python under Wine, as root (docs/systems.md); the first time half an hour"
	@echo "make drill-tools   what logs system calls and mounts a disk that hangs, for drills; their tests are skipped without"
	@echo "make firmware-tools, make firmware   the Arduino's compiler and simulator; the firmware (firmware/README.md)"
	@echo "make desktop-tools   window system and manager for the test of a day in the window, which is skipped without them"
	@echo "make packages   wheel, tarball and Debian package, or on Windows the installer, into dist (packaging/README.md)"
	@echo "make packages KINDS=windows   the installer of Windows, under Wine, as root"
	@echo "make try-packages   them installed, used and removed on bare Debian 12 and 13, as root; half an hour"
	@echo "make quick-test PYTHON=python3.13   some tests with another Python, in half a minute"
	@echo "make screenshots   pictures of every screen into docs/screenshots"
	@echo "make audit   known vulnerabilities of the locked packages, by the advisories of PyPI"
	@echo "make licences, make wheel   docs/licences.md; the wheel with its bill of materials (CycloneDX) into dist"
	@echo "make docs    the documentation site into docs/_build/html, which needs no network"
	@echo "make translations   new texts into the catalogues of messages/locale"

setup: same-python $(COMPILED)

installed: $(READY)

# An environment keeps the Python that made it: another one that is asked for needs another environment.
same-python:
	@:
ifneq ($(origin PYTHON),file)
	@version='import sys; print("%d.%d" % sys.version_info[:2])'; wanted=$$($(PYTHON) -c "$$version") || exit 1; \
	has=$$(test ! -x $(BIN)/python && echo $$wanted || $(BIN)/python -c "$$version"); test "$$has" = "$$wanted" || \
		{ echo "error: $(VENV) has Python $$has, not $$wanted. Add VENV=.venv-$$wanted" >&2; exit 1; }
endif

# uv, which takes a fifth of pip's time, by its hashes; pip where there is none, or where only pip knows the index.
$(READY): requirements.lock pyproject.toml setup.py | system-libraries
	@$(PYTHON) -c 'import sys; sys.exit("error: Python %d.%d is too old. Install Python 3.11 or later and run: make setup PYTHON=python3.11" % sys.version_info[:2] if sys.version_info < (3, 11) else 0)'
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	sed -n '/^uv==/,/[^\\]$$/p' requirements.lock >$(VENV)/uv.txt
	{ $(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r $(VENV)/uv.txt && \
		$(BIN)/python -m uv pip install --quiet --python $(BIN)/python --require-hashes -r requirements.lock; } || \
		$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --quiet --no-deps --no-build-isolation --editable .
	@touch $@

$(COMPILED): $(READY)
	@echo "Compiling the numerical code, so that no first test waits: about a minute"
	@$(BIN)/python -m tools.compile_all
	@touch $@

# Nothing is asked of systems without dpkg: their Qt wheels bring or find what they need.
system-libraries:
	@$(call install_packages,$(QT_PACKAGES),test -x $(BIN)/python || $(PYTHON) -c 'import ensurepip' 2>/dev/null || \
		missing="$$missing $$($(PYTHON) -c 'import sys; print("python%d.%d-venv" % sys.version_info[:2])')")

drill-tools:
	@$(call install_packages,$(TEST_PACKAGES),true)

firmware-tools:
	@$(call install_packages,$(FIRMWARE_PACKAGES),true)

desktop-tools:
	@$(call install_packages,$(DESKTOP_TEST_PACKAGES),true)

# All that tests need of the system, in one go.
test-tools: | system-libraries
	@$(call install_packages,$(FIRMWARE_PACKAGES) $(DESKTOP_TEST_PACKAGES) $(TEST_PACKAGES),true)

# $(1): packages of Debian and Ubuntu that must be there, or one that provides them: Debian 13 and Ubuntu 24.04 have
# libglib2.0-0t64 for libglib2.0-0. One whose triggers have still to run, while another is installed, is there. $(2): a command that may add to $$missing.
define install_packages
command -v dpkg-query >/dev/null 2>&1 || exit 0; \
	installed=$$(dpkg-query -W -f '$${db:Status-Status} $${Package},$${Provides}\n' | \
		sed -n -E 's/^(installed|triggers-[a-z]+) //p' | tr ',' '\n' | sed 's/^ *//; s/ .*//'); \
	missing=""; \
	for package in $(1); do \
		printf '%s\n' "$$installed" | grep -qxF "$$package" || missing="$$missing $$package"; \
	done; \
	$(2); \
	[ -z "$$missing" ] && exit 0; \
	if [ "$$(id -u)" = 0 ]; then \
		echo "Installing system packages:$$missing"; \
		apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $$missing >/dev/null; \
	else \
		echo "error: system packages are missing. Run: sudo apt-get install -y$$missing   then make again"; exit 1; \
	fi
endef

firmware:
	@for converter in ads1256 ads131m02 hx711 pattern; do $(MAKE) --no-print-directory -s -C firmware CONVERTER=$$converter || exit 1; done

run: setup
	@if [ -n "$$DISPLAY$$WAYLAND_DISPLAY" ] || [ "$$(uname)" = Darwin ]; then \
		$(BIN)/slipstand --simulated; \
	else \
		$(BIN)/slipstand demo; \
	fi

# By files, in the order of tests/conftest.py: pytest-xdist would begin with the one that has most tests. Those in
# real time are few and long, so that a worker without any takes over from one that has many.
test: same-python compiled
	$(BIN)/python -m pytest tests -m "not realtime" -n $(TEST_WORKERS) --dist loadfile --no-loadscope-reorder
	$(BIN)/python -m pytest tests -m realtime -n 4 --dist worksteal

# With another Python, given by PYTHON, in an environment of its own. uv: pip takes minutes.
QUICK_TESTS := tests/config tests/messages tests/app/test_child_process.py tests/app/test_version.py tests/app/runs/test_schema.py tests/app/runs/test_run_round_trip.py tests/app/runs/test_validation.py
quick-environment: installed
	$(BIN)/python -m uv venv --quiet --clear --python $(PYTHON) build/quick
	$(BIN)/python -m uv pip install --quiet --python build/quick --require-hashes -r requirements.lock
	$(BIN)/python -m uv pip install --quiet --python build/quick --no-deps --no-build-isolation --editable .

quick-test: quick-environment
	build/quick/$(notdir $(BIN))/python -m pytest -m "not realtime" -n 2 --dist loadfile $(QUICK_TESTS)

# Once, before processes that start at once would each do it.
compiled: installed
	@$(BIN)/python -m tools.compile_all
	@touch $(COMPILED)

# Tests with their assertions rewritten, on disk, before workers that start at once would each do it. What cannot be
# collected is said by `make test`.
collected: compiled
	@$(BIN)/python -m pytest tests --collect-only -q >/dev/null || true

lint: types
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports
	$(BIN)/check-jsonschema --builtin-schema vendor.github-workflows .github/workflows/*.yml

# Systems that the types are checked for besides this one.
OTHER_SYSTEMS ?= win32 darwin
types: types-host $(OTHER_SYSTEMS:%=types-%)

types-host: installed
	$(BIN)/mypy

types-win32 types-darwin: types-%: installed
	$(BIN)/mypy --platform $* --no-warn-unreachable --cache-dir .mypy_cache/$*

bench: setup
	@for script in benchmarks/solver.py benchmarks/identification.py benchmarks/decoders.py; do echo "== $$script"; $(BIN)/python $$script || exit 1; done

bench-recording: setup
	@for script in recording release_detection library recover; do \
		echo "== benchmarks/$$script.py"; $(BIN)/python benchmarks/$$script.py || exit 1; done

translations: setup
	$(BIN)/python -m tools.translations

bench-desktop: setup
	@for script in desktop desktop_handle; do \
		echo "== benchmarks/$$script.py"; $(BIN)/python benchmarks/$$script.py || exit 1; done

drill: setup drill-tools
	$(BIN)/python -m tests.drills.kill_engine --count 200
	$(BIN)/python -m tests.drills.kill_window --count 50
	$(BIN)/python -m tests.drills.unplug --count 100
	$(BIN)/python -m tests.drills.disk_full --count 50
	$(BIN)/python -m tests.drills.starved --count 14
	$(BIN)/python -m tests.drills.hanging_disk --count 10
	$(BIN)/python -m tests.drills.power_loss --count 2000
	$(BIN)/python -m tests.drills.damaged_runs --count 10000
	$(BIN)/python -m tests.drills.hostile_texts --count 20000
	$(BIN)/python -m tests.drills.oversized_files
	$(BIN)/python -m tests.drills.hostile_wire
	$(BIN)/python -m tests.drills.resources
	$(BIN)/python -m tests.drills.clock
	$(BIN)/python -m tests.drills.hostile_bytes --megabytes 1000 --frames 1000000

peers: setup
	$(BIN)/python -m pytest tests -m peer -rA

windows: setup
	@$(call install_packages,debootstrap,true)
	$(BIN)/python -m tools.windows

# KINDS: some of wheel, tarball, deb, windows.
packages: setup
	$(BIN)/python -m tools.packages $(KINDS)

try-packages: setup
	@$(call install_packages,debootstrap xvfb imagemagick,true)
	$(BIN)/python -m tools.packages.checks

# Beside the virtual environment, so that its packages stay those of the lock.
$(VENV)/tools/.ready:
	$(PYTHON) -m venv $(VENV)/tools
	$(VENV)/tools/bin/python -m pip install --quiet --disable-pip-version-check pip-audit pip-licenses cyclonedx-bom build
	@touch $@

audit: $(VENV)/tools/.ready
	$(VENV)/tools/bin/pip-audit --strict --require-hashes --disable-pip --requirement requirements.lock

licences: setup $(VENV)/tools/.ready
	@{ printf '# Licences\n\nOf the packages of `requirements.lock`, those for development included, as they state them. Made by `make licences`.\n\n'; \
		$(VENV)/tools/bin/pip-licenses --python $(BIN)/python --ignore-packages slipstand --format=markdown --with-urls | sed 's/  */ /g; /^|-/s/--*/---/g'; } >docs/licences.md

# The wheel into dist/, and beside it what it is made of, in the form of CycloneDX.
wheel: setup $(VENV)/tools/.ready
	$(VENV)/tools/bin/python -m build --wheel --outdir dist
	$(VENV)/tools/bin/cyclonedx-py requirements --pyproject pyproject.toml --output-reproducible --of JSON -o dist/slipstand.cdx.json requirements.lock

docs: setup
	$(BIN)/python -m sphinx -q -W --keep-going -b html docs docs/_build/html

screenshots: setup
	$(BIN)/python -m tools.screenshots docs/screenshots

study: setup
	@for study in coverage wrong_models garbage one_mass campaign plan real_stand live; do \
		echo "== benchmarks.study_$$study"; $(BIN)/python -m benchmarks.study_$$study || exit 1; done

lock: setup
	$(BIN)/python -m uv pip compile --universal --generate-hashes --no-header --no-annotate --extra dev pyproject.toml -o requirements.lock
