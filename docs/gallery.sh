#!/usr/bin/env bash
# Makes the pictures of docs/gallery.md: each scene photographed, solved and verified, and one
# image of the verification, finer than the cells, as the camera sees it: as it was wanted, on
# the wall as it is, and on the wall compensated.
# Needs `iltm` on the path; takes some minutes.
set -euo pipefail
cd "$(dirname "$0")"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
mkdir -p gallery
cp ../host-tools/scenes/*.png "$work"
for scene in installation painted-corner m-panels-painted; do
    # A camera that sees pixels of the projector rather than its cells alone, with 12 bits.
    file=$work/$scene.toml
    sed -e 's/^width = .*/width = 640/' -e 's/^height = .*/height = 480/' \
        -e 's/^bits = .*/bits = 12/' -e 's/^full_well = .*/full_well = 60000.0/' \
        "../host-tools/scenes/$scene.toml" > "$file"
    rows=$(sed -n 's/^rows = //p' "$file")
    cols=$(sed -n 's/^cols = //p' "$file")
    response=$(sed -n '/^\[camera\]/,$ s/^response = "\(.*\)"$/\1/p' "$file")
    iltm patterns -o "$work/$scene" --rows "$rows" --cols "$cols" \
        --projector $((20 * cols))x$((20 * rows)) --photos 80 --camera "${response:-linear}"
    iltm simulate "$file" --photograph "$work/$scene"
    iltm solve "$work/$scene" -o "$work/$scene.iltm"
    iltm verify "$work/$scene.iltm" -o "$work/$scene-verify"
    iltm simulate "$file" --photograph "$work/$scene-verify" --without drift
    iltm verify "$work/$scene.iltm" "$work/$scene-verify" --report "$work/$scene-verdict"
    for part in wanted before after; do
        cp "$work/$scene-verdict/fine-$part.png" "gallery/$scene-$part.png"
    done
done
