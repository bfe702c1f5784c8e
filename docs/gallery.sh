#!/usr/bin/env bash
# Makes the pictures of docs/gallery.md: each scene photographed, solved, and a test image
# of the verification as it was wanted, on the wall as it is, and on the wall compensated.
# Needs `iltm` on the path; takes some minutes.
set -euo pipefail
cd "$(dirname "$0")"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
mkdir -p gallery
for scene in installation painted-corner m-panels-painted dome; do
    file=../host-tools/scenes/$scene.toml
    iltm simulate "$file" -o "$work/$scene" --photos 80
    iltm solve "$work/$scene" -o "$work/$scene.iltm"
    iltm verify "$work/$scene.iltm" -o "$work/$scene-verify"
    iltm simulate "$file" --photograph "$work/$scene-verify" --without drift
    # The verdict may be that the table errs more than it should: shown all the same.
    iltm verify "$work/$scene.iltm" "$work/$scene-verify" --report "$work/$scene-verdict" ||
        [ $? = 31 ]
    for part in wanted before after; do
        cp "$work/$scene-verdict/1-$part.png" "gallery/$scene-$part.png"
    done
done
