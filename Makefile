# Two commands do everything: `make demo` and `make test`. Both install what a fresh Debian or Ubuntu lacks.

CARGO ?= cargo
IMAGE := tests/data/workshop.exr

.PHONY: demo test test-large build setup fmt clippy generated gallery goldens

# The main job on a real photograph: tone mapping. Prints the plan and where the picture is.
demo: setup
	$(CARGO) build --release --locked --package pipe
	@mkdir -p out
	./target/release/pipe plan tone-map --size 512x256
	./target/release/pipe run tone-map $(IMAGE) out/demo.png -v
	@echo "The picture is out/demo.png"

# Every test, on whatever adapter there is; none is skipped for want of one.
test: setup
	@bash tests/run.sh

# An image of 32768² pixels against NumPy: a quarter of an hour, 24 GiB of disk, Python with NumPy. SIZE=8192 is quicker.
test-large: setup build
	@python3 -c 'import numpy' || { echo "test-large compares with NumPy: sudo apt-get install python3-numpy"; exit 1; }
	python3 tests/references/large.py --size $(or $(SIZE),32768) --vram $(or $(VRAM),512MiB)

build:
	$(CARGO) build --release --locked --package pipe

# A Vulkan driver, when there is none: Mesa's software renderer.
setup:
	@bash tests/setup.sh

fmt:
	$(CARGO) fmt --all

clippy:
	$(CARGO) clippy --workspace --all-targets --locked -- --deny warnings

# Writes the generated pages anew.
generated: build
	./target/release/pipe nodes --markdown > docs/nodes.md

# Runs every preset and writes the page with their pictures anew. VOLUME=scan.nii.gz adds those of scans.
gallery: build
	./target/release/pipe presets --gallery docs/gallery --image $(IMAGE) $(if $(VOLUME),--volume $(VOLUME))

# Writes the expected pictures of the presets anew. Look at each before it is committed.
goldens: setup
	PIPE_BLESS=1 $(CARGO) test --locked --package pipe-tests --test presets
