#!/usr/bin/env bash
# Runs all tests. Needs Rust and a C linker (Debian: `apt-get install gcc libc6-dev`); cargo fetches the rest.
# The GPU's tests need a Vulkan driver (Debian: `apt-get install mesa-vulkan-drivers libvulkan1` for one in
# software); without one they say so and are skipped.
# Arguments go to `cargo test`, as in `./test.sh -p lazygrid-tests properties`.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")"

sudo=$([ "$(id -u)" = 0 ] || command -v sudo || true)

if ! command -v cc >/dev/null; then
    echo "test.sh: no C linker; installing gcc" >&2
    $sudo apt-get update -qq
    $sudo apt-get install -y -qq gcc libc6-dev
fi

has_vulkan() {
    compgen -G '/usr/share/vulkan/icd.d/*.json' >/dev/null || compgen -G '/etc/vulkan/icd.d/*.json' >/dev/null \
        || [ -n "${VK_DRIVER_FILES:-}${VK_ICD_FILENAMES:-}" ]
}

if [ "$(uname)" = Linux ] && ! has_vulkan && command -v apt-get >/dev/null && { [ "$(id -u)" = 0 ] || [ -n "$sudo" ]; }
then
    { $sudo apt-get update -qq && $sudo apt-get install -y -qq mesa-vulkan-drivers libvulkan1; } >/dev/null 2>&1 || true
fi

if [ $# = 0 ]; then
    set -- --workspace
fi
exec cargo test "$@"
