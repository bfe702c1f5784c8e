#!/usr/bin/env bash
# Installs what the tests need, builds everything, and passes all checks:
# formatting, clippy, documentation, tests, the firmware's in an emulator among
# them. Needs a Debian-like machine or one that has Rust and QEMU already. The last
# line is the number of tests passed and failed.
set -euo pipefail
cd "$(dirname "$0")/.."

say() { printf '\n== %s\n' "$*"; }

as_root() {
    if [ "$(id -u)" = 0 ]; then "$@"; else sudo "$@"; fi
}

# Debian's own Rust is new enough on every release that has `rustc-web` or a
# `rustc` of at least the workspace's `rust-version`.
install_packages() {
    say "installing $*"
    as_root apt-get update -qq
    DEBIAN_FRONTEND=noninteractive as_root apt-get install -y -qq --no-install-recommends "$@"
}

wanted=$(sed -n 's/^rust-version = "\(.*\)"/\1/p' Cargo.toml)

new_enough() {
    command -v cargo >/dev/null && command -v rustc >/dev/null || return 1
    local have
    have=$(rustc --version | cut -d' ' -f2)
    [ "$(printf '%s\n%s\n' "$wanted" "$have" | sort -V | head -n 1)" = "$wanted" ]
}

missing=()
command -v cc >/dev/null || missing+=(gcc libc6-dev)
new_enough || missing+=(cargo-web rustc-web)
command -v git >/dev/null || missing+=(git)
command -v qemu-system-arm >/dev/null || missing+=(qemu-system-arm)
# A desktop without a screen, and what a window on it needs.
command -v Xvfb >/dev/null || missing+=(xvfb libx11-xcb1 libxcursor1 libxi6 libxkbcommon-x11-0 libxrandr2)
# A desktop of several displays.
command -v Xvnc >/dev/null || missing+=(tigervnc-standalone-server)
# Players, and Vulkan and OpenGL in software, for tables on a PC.
command -v ffmpeg >/dev/null || missing+=(ffmpeg)
command -v mpv >/dev/null || missing+=(mpv)
ls /usr/share/vulkan/icd.d/lvp_icd.*.json >/dev/null 2>&1 || missing+=(mesa-vulkan-drivers)
ls /usr/share/glvnd/egl_vendor.d/*mesa.json >/dev/null 2>&1 || missing+=(libegl-mesa0)
ls /usr/lib/*/dri/swrast_dri.so >/dev/null 2>&1 || missing+=(libgl1-mesa-dri)
if [ ${#missing[@]} -gt 0 ]; then
    command -v apt-get >/dev/null || {
        echo "error: this needs Rust $wanted or newer, a C linker, git, qemu-system-arm, Xvfb, Xvnc, ffmpeg, mpv and Mesa's Vulkan; missing: ${missing[*]}. Install them and run this again" >&2
        exit 1
    }
    install_packages "${missing[@]}"
    hash -r
fi
new_enough || {
    echo "error: Rust is $(rustc --version 2>/dev/null || echo missing), $wanted or newer is needed; run \`rustup update\`" >&2
    exit 1
}

# `mpirun iltm solve`; libclang reads MPI's headers. Where they cannot be had, what is tested
# with them is left out, and said to be.
has_mpi() {
    command -v mpirun >/dev/null && command -v mpicc >/dev/null &&
        ls /usr/lib/llvm-*/lib/libclang*.so* >/dev/null 2>&1
}
if ! has_mpi && command -v apt-get >/dev/null; then
    install_packages libopenmpi-dev openmpi-bin libclang-dev || say "MPI cannot be installed"
    hash -r
fi

# rustfmt and clippy come with rustup's default profile and with Debian's Rust in
# packages of their own.
for component in rustfmt clippy; do
    if ! cargo "${component/rustfmt/fmt}" --version >/dev/null 2>&1; then
        if command -v rustup >/dev/null; then
            rustup component add "$component"
        elif [ "$component" = rustfmt ]; then
            install_packages rustfmt-web
        else
            install_packages rust-web-clippy
        fi
    fi
done

firmware=runtime/firmware
say "firmware"
# Where this fails, the tests that need the firmware fail and say why.
"$firmware/build.sh" || echo "the firmware cannot be built here" >&2

say "formatting"
cargo fmt --all --check
cargo fmt --manifest-path "$firmware/Cargo.toml" --check
cargo fmt --manifest-path tests/mutations/Cargo.toml --check

say "clippy"
features=(--features iltm/gpu)
if has_mpi; then features+=(--features iltm/mpi); fi
cargo clippy --workspace --all-targets --locked "${features[@]}" -- -D warnings
# The firmware's own checks need a Rust with a core library for its target; where
# there is none, core is built with the firmware, and only the firmware.
has_target=
[ -d "$(rustc --print sysroot)/lib/rustlib/thumbv7em-none-eabihf/lib" ] && has_target=yes
if [ $has_target ]; then
    # Both boards with all stages, and one with gain alone.
    for stages in mps2-an500,stages mps2-an386,stages mps2-an500; do
        (cd "$firmware" && cargo clippy --release --lib --bins --locked \
            --no-default-features --features "$stages" -- -D warnings)
    done
fi

say "documentation"
RUSTDOCFLAGS="-D warnings" cargo doc --workspace --no-deps --locked --quiet "${features[@]}"
if [ $has_target ]; then
    (cd "$firmware" && RUSTDOCFLAGS="-D warnings" cargo doc --lib --no-deps --locked --quiet)
fi

say "tests"
# Property tests try the same cases on every run, so that one passes or fails by what
# was changed; another seed, or none, explores.
export PROPTEST_RNG_SEED=${PROPTEST_RNG_SEED-1}
logs=$(mktemp -d)
trap 'rm -rf "$logs"' EXIT
status=0
# One build for all tests. The page of the quick start builds the tool without MPI and without its
# part for graphics processors, and its test runs that.
tests=(cargo test --workspace --locked --no-fail-fast "${features[@]}")
"${tests[@]}" --no-run
# The printed commands wait for devices and players most of the time: beside the other tests.
"${tests[@]}" --test printed_commands -- followed:: >"$logs/pages" 2>&1 &
"${tests[@]}" -- --skip followed:: 2>&1 | tee "$logs/tests" || status=$?
wait $! || status=$?
cat "$logs/pages"
has_mpi || say "no MPI here: what is tested with it is left out"

count() { sed -n "s/^test result:.* \([0-9]\+\) $1;.*/\1/p" "$logs"/* | awk '{ sum += $1 } END { print sum + 0 }'; }
printf '\n%s passed, %s failed\n' "$(count passed)" "$(count failed)"
exit "$status"
