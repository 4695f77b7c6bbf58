# `make demo` and `make test` need Rust, git and build-essential; everything else they install themselves.
SHELL := /bin/bash
.SHELLFLAGS := -euo pipefail -c
# rust-toolchain.toml pins the toolchain; where rustup neither has it nor can fetch it, the stable one that is there serves.
ifeq ($(shell cargo --version 2>/dev/null),)
export RUSTUP_TOOLCHAIN := stable
endif
.PHONY: demo test attack fuzz miri bench lint eyes deb deb-test packages test-packages

# OpenCV's smallest set of headers, libjpeg-turbo's, what the bindings are generated with, and what the whole-swarm tests drive.
PACKAGES := libopencv-imgproc-dev libopencv-imgcodecs-dev libopencv-videoio-dev libopencv-objdetect-dev libturbojpeg0-dev \
            libclang1-14 clang pkg-config
TEST_PACKAGES := iproute2 libsvm-tools valgrind chromium libenki-dev cmake g++ systemd \
                 dpkg-dev lintian python3-numpy python3-venv python3-websockets python3-cryptography mypy

# $(call install,PACKAGES): those of them that are missing.
define install
missing=(); for package in $(1); do \
  dpkg-query -W -f='$${Status}' "$$package" 2>/dev/null | grep -q 'ok installed' || missing+=("$$package"); done; \
if (($${#missing[@]})); then \
  as_root=(); ((EUID == 0)) || as_root=(sudo); \
  echo "installing $${missing[*]}"; \
  "$${as_root[@]}" apt-get update -qq; \
  "$${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "$${missing[@]}" >/dev/null; \
fi
endef

packages:
	@$(call install,$(PACKAGES))

test-packages: packages
	@$(call install,$(TEST_PACKAGES))

# A heterogeneous swarm of real Zenoh peers that knows no gesture looks, decides, is told what it was, and learns.
# Leaves its pictures and a recording in out/. It is sealed with keys of its own: SEALED=1 keeps them in out/keys, SEALED=0 seals nothing.
SEAL := $(if $(filter 1,$(SEALED)),--keys out/keys,$(if $(filter 0,$(SEALED)),--open))
demo: packages
	cargo build -p gestalt-peer --bin gestalt
	mkdir -p out
	rm -f out/run.mcap
	target/debug/gestalt swarm --robots footbot:6,parrot:2 --topology random --rounds 30 --pause 300ms \
	  --learn nothing --web 0 --picture out/round.png --curve out/curve.png --record out/run.mcap $(SEAL)
	$(if $(filter 1,$(SEALED)),target/debug/gestalt trust roster out/keys)

# Ends with the sum of all runners, and with what was skipped, and why. What GESTALT_REQUIRE names fails instead of being skipped, of
# namespaces,queues,mount,browser,data,enki,valgrind,systemd,debian,axe,prometheus,websockets,cryptography,rospy,rclpy,zenoh.
# Many tests wait for rounds and deadlines: two threads a core. What they print goes to a file that one follows until they end: a
# pipe ends only with the last process that a test that died may have left. They are a job (-m) that ends when one interrupts.
test: test-packages
	@export RUST_TEST_THREADS=$$((2 * $$(nproc))); \
	mkdir -p out; : >out/test.log; \
	set -m; \
	{ cargo test --workspace --lib --bins --tests --examples --no-fail-fast || failed=1; \
	  cargo test --workspace --doc --no-fail-fast || failed=1; exit $${failed:-0}; } >out/test.log 2>&1 & \
	tests=$$!; \
	set +m; \
	trap 'kill -- -$$tests; exit 1' INT TERM; \
	tail --quiet --lines=+1 --sleep-interval=0.5 --follow --pid=$$tests out/test.log & \
	passed=0; wait $$tests || passed=$$?; \
	wait $$!; \
	awk -f .ci/summary.awk out/test.log; \
	exit $$passed

# Plays every attack of SECURITY.md against emulated swarms and prints what comes of each; fails if one comes to something else
# than its line says. Needs Rust alone. ATTACKS="A7 17 --seeds 5" plays some.
attack:
	cargo run -p gestalt-attack --bin attack -- $(ATTACKS)

# Trains the weights of the learned eyes anew, from the pictures in GESTALT_DATA, one folder or several: about an hour on two
# cores. Then, what they make of each set when trained without it: EYES="--leave-one-out". See peer/vision/weights/README.md.
GESTALT_DATA ?= ../shared/data
eyes: packages
	mkdir -p out/eyes
	RUSTFLAGS="-C target-cpu=native" \
	cargo run --release --manifest-path peer/training/Cargo.toml -- $(addprefix --data ,$(GESTALT_DATA)) --out out/eyes $(EYES)

# A Debian package of a release build, in out/. See docs/install.md.
deb: packages
	@$(call install,dpkg-dev)
	cargo build --release -p gestalt-peer --bin gestalt
	packaging/deb.sh target/release/gestalt out

# Installs it in a fresh Debian 12, made by debootstrap in a temporary folder, and runs a round of two robots there. Needs root.
deb-test: deb
	@$(call install,debootstrap)
	packaging/installed.sh out/gestalt_*.deb

# Every speed the README states, with its yardstick in the same run.
bench: packages
	cargo bench --workspace

# Each fuzz target for a minute on one core, guided by coverage: libFuzzer, on the stable compiler. What it learns stays in
# out/fuzz. FUZZ_SECONDS=7200 for longer, FUZZ="mind inbox" for some.
FUZZ ?= envelope json roster proof key frame inbox mind finals
FUZZ_SECONDS ?= 60
COVERAGE := -C passes=sancov-module -C llvm-args=-sanitizer-coverage-level=4 -C llvm-args=-sanitizer-coverage-pc-table \
            -C llvm-args=-sanitizer-coverage-inline-8bit-counters -C llvm-args=-sanitizer-coverage-trace-compares
HOST := $(shell rustc -vV | sed -n 's/^host: //p')
fuzz: packages
	RUSTFLAGS="$(COVERAGE) -C codegen-units=1 -C debug-assertions -C overflow-checks" \
	cargo build --release -p gestalt-fuzz --features libfuzzer --bin guided --target $(HOST)
	for target in $(FUZZ); do \
	  mkdir -p out/fuzz/$$target; \
	  GESTALT_FUZZ=$$target target/$(HOST)/release/guided -max_total_time=$(FUZZ_SECONDS) -max_len=4096 -timeout=10 \
	    -artifact_prefix=out/fuzz/$$target- -print_final_stats=1 out/fuzz/$$target tests/fuzz/corpus/$$(echo $$target | sed s,finals,mind,) || exit 1; \
	done

# The C interface under Miri, the interpreter that knows what unsafe code may not do. It needs a nightly toolchain:
# rustup component add miri rust-src --toolchain nightly
miri:
	RUSTUP_TOOLCHAIN=nightly cargo miri test -p gestalt-c --lib --test calls

lint: packages
	cargo fmt --check
	cargo clippy --workspace --all-targets -- -D warnings
	cargo clippy -p gestalt-peer --no-default-features -- -D warnings
	RUSTDOCFLAGS="-D warnings" cargo doc --workspace --no-deps
	@if ! cargo deny --version >/dev/null 2>&1; then echo "skipped: cargo deny is not installed"; \
	else cargo deny check; fi
