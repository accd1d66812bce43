#!/usr/bin/env bash
# Runs all tests. Needs Rust and a C linker (Debian: `apt-get install gcc libc6-dev`); cargo fetches the rest.
# The GPU's tests need a Vulkan driver (Debian: `apt-get install mesa-vulkan-drivers libvulkan1` for one in
# software); without one they say so and are skipped. On Debian both are installed where they are missing.
#
#     ./test.sh                  all tests; what the GPU does also on SwiftShader and Tint, where these are installed
#     ./test.sh --swiftshader    only what the GPU does, on SwiftShader (Debian: `apt-get install chromium-common`)
#     ./test.sh ARGUMENT…        `cargo test` with these, as in `./test.sh -p lazygrid-tests properties`
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")"

say() { echo "test.sh: $*" >&2; }

# install PACKAGE…
install() {
    local sudo
    sudo=$([ "$(id -u)" = 0 ] || command -v sudo || true)
    if ! command -v apt-get >/dev/null || { [ "$(id -u)" != 0 ] && [ -z "$sudo" ]; }; then
        say "$* cannot be installed here"
        return 1
    fi
    say "installing $*"
    { $sudo apt-get update -qq && $sudo apt-get install -y -qq "$@"; } >/dev/null
}

has_vulkan() {
    compgen -G '/usr/share/vulkan/icd.d/*.json' >/dev/null || compgen -G '/etc/vulkan/icd.d/*.json' >/dev/null \
        || [ -n "${VK_DRIVER_FILES:-}${VK_ICD_FILENAMES:-}" ]
}

swiftshader=/usr/lib/chromium/vk_swiftshader_icd.json

# A driver with subgroups of 4, which takes subnormal numbers for zero and ends no loop by itself. What is left out is
# large, and would only be the same again.
on_swiftshader() {
    export VK_DRIVER_FILES=$swiftshader LAZYGRID_SUBJECTS=gpu LAZYGRID_REQUIRE_GPU=1 PROPTEST_CASES=$1
    shift
    say "on SwiftShader: $*"
    "$@"
}

command -v cc >/dev/null || install gcc libc6-dev
if [ "$(uname)" = Linux ] && ! has_vulkan; then
    install mesa-vulkan-drivers libvulkan1 || say "no Vulkan driver: the GPU's tests are skipped"
fi

if [ "${1:-}" = --swiftshader ]; then
    on_swiftshader 2 cargo test --workspace --test suite --test=gpu_{kernels,periodic} --  SELECT
elif [ $# != 0 ]; then
    exec cargo test "$@"
fi
