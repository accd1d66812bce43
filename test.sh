#!/usr/bin/env bash
# Runs the tests. Needs Rust and a C linker (Debian: `apt-get install gcc libc6-dev`); cargo fetches the rest.
# The GPU's tests need a Vulkan driver (Debian: `apt-get install mesa-vulkan-drivers libvulkan1` for one in
# software); without one they say so and are skipped. On Debian both are installed where they are missing.
#
#     ./test.sh                  all tests; then what the GPU does on SwiftShader too, where that is installed
#     ./test.sh --quick          what is short, for daily work
#     ./test.sh --swiftshader    only what the GPU does, on SwiftShader (Debian: `apt-get install chromium-common`)
#     ./test.sh ARGUMENT…        `cargo test` with these, as in `./test.sh --workspace --test suite properties`
#
# Tint, which looks at every WGSL text, is among all tests where it is installed: `npm ci --prefix kernels/tint`.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")"
# Mesa's driver complains in each process where this is not set.
export XDG_RUNTIME_DIR=${XDG_RUNTIME_DIR:-/tmp}

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

# A driver with subgroups of 4, which takes subnormal numbers for zero and ends no loop by itself. Here run each
# kernel, and with few cases of each property what the suite has of arbitrary spheres, tables and results: scenes of a
# kind would only be the same again, and take long. Arguments choose packages and features.
swiftshader=/usr/lib/chromium/vk_swiftshader_icd.json
on_swiftshader() {
    say "on SwiftShader:"
    export VK_DRIVER_FILES=$swiftshader LAZYGRID_REQUIRE_GPU=1 LAZYGRID_TEST_VARIANTS=gpu PROPTEST_CASES=2
    cargo test "$@" --test gpu -- kernels:: skin::
    cargo test "$@" --test suite -- properties:: interactions:: results:: cell_reuse::
}

command -v cc >/dev/null || install gcc libc6-dev
if [ "$(uname)" = Linux ] && ! has_vulkan; then
    install mesa-vulkan-drivers libvulkan1 || say "no Vulkan driver: the GPU's tests are skipped"
fi

# Always the whole workspace: for fewer packages, dependencies would be built again with fewer features.
case ${1:-} in
    "")
        cargo test --workspace
        if [ -e $swiftshader ]; then
            on_swiftshader --workspace
        else
            say "skipped: SwiftShader is not installed; \`apt-get install chromium-common\` does that on Debian"
        fi
        [ -d kernels/tint/node_modules ] \
            || say "skipped: Tint is not installed; \`npm ci --prefix kernels/tint\` does that"
        ;;
    --quick)
        PROPTEST_CASES=4 cargo test --workspace --lib --bins --test=suite --test=cli --test=loops --test=reflection -- \
            --skip animation:: --skip memory_limits:: --skip page:: --skip simulate:: --skip the_gpu_is_all_right
        ;;
    --swiftshader)
        shift
        on_swiftshader "${@:---workspace}"
        ;;
    *) cargo test "$@" ;;
esac
