#!/usr/bin/env bash
# Builds the firmware: build.sh [BOARD] [BIN], by default mps2-an500 and firmware.
# ILTM_FIRMWARE_STAGES names the stages, with commas between them, none if it is
# empty; by default all. ILTM_FIRMWARE_FEATURES names features beside board and stages.
# Finds a Rust that can build for the board, installing what is missing: rustup's
# target, or else Debian's packages. The last line on standard output is the path
# of the ELF file; everything else goes to standard error.
set -euo pipefail
cd "$(dirname "$0")"

board=${1:-mps2-an500}
bin=${2:-firmware}
target=thumbv7em-none-eabihf

case $board in
mps2-an500) cpu=cortex-m7 ;;
mps2-an386) cpu=cortex-m4 ;;
*)
    echo "error: there is no board \`$board\`; the boards are mps2-an500 and mps2-an386" >&2
    exit 2
    ;;
esac

as_root() {
    if [ "$(id -u)" = 0 ]; then "$@"; else sudo "$@"; fi
}

# Whether the cargo on the path comes with a core library for the target.
has_target() {
    local root
    root=$(rustc --print sysroot 2>/dev/null) && [ -d "$root/lib/rustlib/$target/lib" ]
}

# Debian's Rust has no core library for the target, but its source: core is built
# with the firmware, which takes an option of unstable Rust.
debian_rust() {
    [ -x /usr/bin/cargo ] && [ -x /usr/bin/rustc ] &&
        [ -d "$(/usr/bin/rustc --print sysroot)/lib/rustlib/src/rust/library/core" ] &&
        command -v arm-none-eabi-ld >/dev/null
}

route=
if [ "${ILTM_FIRMWARE_RUST:-}" = debian ]; then
    route=debian
elif has_target; then
    route=rustup
elif command -v rustup >/dev/null && rustup target add "$target" >&2; then
    route=rustup
else
    route=debian
fi

if [ $route = debian ] && ! debian_rust; then
    command -v apt-get >/dev/null || {
        echo "error: no Rust for $target: run \`rustup target add $target\` where rustup has network access, or use a Debian-like machine with rustc-web, cargo-web, rust-web-src and binutils-arm-none-eabi" >&2
        exit 1
    }
    echo "installing Debian's Rust and linker for $target" >&2
    {
        as_root apt-get update -qq
        DEBIAN_FRONTEND=noninteractive as_root apt-get install -y -qq --no-install-recommends \
            rustc-web cargo-web rust-web-src binutils-arm-none-eabi
    } >&2
    debian_rust || {
        echo "error: Debian's packages are installed, but core's source or arm-none-eabi-ld is missing" >&2
        exit 1
    }
fi

# A folder for each board and route: each has flags of its own, and cargo would
# build everything anew at every change between them. Firmware of some stages only has
# one too, so that nobody takes it for the whole.
stages=${ILTM_FIRMWARE_STAGES-stages}
more=${ILTM_FIRMWARE_FEATURES:-}
features=$board${stages:+,$stages}${more:+,$more}
case $stages in
stages) some= ;;
stages,neighbours) some=-several ;;
'') some=-lean ;;
*) some=-some ;;
esac
folder=$board$some${more:+-$more}
# The one of SHA-512's two implementations that is smaller by 32 KB; also in
# .cargo/config.toml, which these flags replace.
flags="-C target-cpu=$cpu --cfg sha2_backend_soft=\"compact\""
# A panic says where it happened: without these, the image would hold the folders of
# whoever built it, and its size would depend on how long their names are.
runtime=$(cd .. && pwd -P)
flags+=" --remap-path-prefix=$runtime=runtime --remap-path-prefix=${CARGO_HOME:-$HOME/.cargo}/registry/src="
options=(--release --locked --target "$target" --no-default-features --features "$features" --bin "$bin")
if [ $route = debian ]; then
    folder=$PWD/target/debian-$folder
    RUSTC_BOOTSTRAP=1 RUSTC=/usr/bin/rustc RUSTFLAGS="$flags -C linker=arm-none-eabi-ld" \
        CARGO_TARGET_DIR=$folder \
        /usr/bin/cargo build "${options[@]}" -Zbuild-std=core >&2
else
    folder=$PWD/target/$folder
    RUSTFLAGS=$flags CARGO_TARGET_DIR=$folder cargo build "${options[@]}" >&2
fi
echo "$folder/$target/release/$bin"
