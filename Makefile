# make demo    a simulated flight through the real node, plots in demo/
# make test    ruff, then the tests but the slow ones, two files at a time
# make slow    the slow tests
# make soak    a flight of a day through the node, with what its memory does; HOURS=2 RATE=1 for less
# make clean   removes what these made, .venv included
#
# Each makes .venv from the newest Python of 3.13 .. 3.10 (or PYTHON=...). Where a ROS installation
# is sourced, its Python and its rclpy are used instead of the wheels.

ifdef ROS_DISTRO
  PYTHON ?= python3
  VENV_OPTIONS = --system-site-packages
  EXTRAS = test
  # ROS brings pytest plugins older than the pytest of .venv.
  export PYTEST_DISABLE_PLUGIN_AUTOLOAD = 1
else
  EXTRAS = ros,test
endif
BIN = .venv/bin
STAMP = .venv/installed-for-$(or $(ROS_DISTRO),wheels)

test: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/python -m pytest -p xdist -n 2 --dist loadfile -m "not slow"

slow: $(STAMP)
	$(BIN)/python -m pytest -m slow

HOURS = 24
RATE = 5
soak: $(STAMP)
	$(BIN)/python test/soak.py --hours $(HOURS) --rate $(RATE)

DRONE = config/small_drone.yaml
demo: $(STAMP)
	mkdir -p demo
	$(BIN)/ctcbs table build $(DRONE) -o demo/table.npz
	$(BIN)/ctcbs simulate --config $(DRONE) --radius 60 --speed 20 --turns 6 --radius-change 80,3 \
	  --position-noise 1.5 --velocity-noise 0.3 --gap 60,5 --seed 1 -o demo/flight.tlog
	$(BIN)/ctcbs replay demo/flight.tlog --config $(DRONE) --table demo/table.npz \
	  --through node --out demo
	@echo "Predictions and plots: $(CURDIR)/demo"

# An environment made for the other kind of ROS is made anew.
$(STAMP): setup.py setup.cfg pyproject.toml
	@if [ ! -e $@ ] && ls .venv/installed-for-* >/dev/null 2>&1; then rm -rf .venv; fi
	@if [ ! -x $(BIN)/pip ]; then \
	  python="$(PYTHON)"; \
	  for version in 3.13 3.12 3.11 3.10; do \
	    if [ -z "$$python" ] && python$$version -c "import ensurepip" 2>/dev/null; then \
	      python=python$$version; \
	    fi; \
	  done; \
	  if [ -z "$$python" ]; then \
	    echo "No Python 3.10 to 3.13 with venv was found; give one: make PYTHON=/path" >&2; exit 1; \
	  fi; \
	  echo "Making .venv with $$python"; \
	  "$$python" -m venv --clear $(VENV_OPTIONS) .venv || exit 1; \
	fi
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[$(EXTRAS)]'
	@touch $@

clean:
	rm -rf .venv build install log demo .pytest_cache .ruff_cache .hypothesis *.egg-info
	find ctcbs_ros test -name __pycache__ -type d -prune -exec rm -rf {} +

.PHONY: test slow soak demo clean
