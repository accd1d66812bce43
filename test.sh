#!/usr/bin/env bash
# Runs the tests. Needs Rust and a C linker (Debian: `apt-get install gcc libc6-dev`); cargo fetches the rest.
# GPU tests need a Vulkan driver (Debian: `apt-get install mesa-vulkan-drivers libvulkan1` for a software driver); without
# one they report a skip. On Debian the script installs the linker and the driver if they are missing.
#
#     ./test.sh                  all tests, then the GPU tests on SwiftShader if it is installed
#     ./test.sh --quick          the short tests, for daily work
#     ./test.sh --all ARGUMENT…  all tests, with arguments for cargo, as in `--all --features lazygrid-cli/arrow`
#     ./test.sh --swiftshader    only the GPU tests, on SwiftShader (Debian: `apt-get install chromium-common`)
#     ./test.sh ARGUMENT…        `cargo test` with these arguments, as in `./test.sh --test suite properties`
#
# If Tint is installed (`npm ci --prefix kernels/tint`), all tests include its check of every WGSL text.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")"
# Mesa's driver prints a warning in each process without this variable.
export XDG_RUNTIME_DIR=${XDG_RUNTIME_DIR:-/tmp}

say() { echo "test.sh: $*" >&2; }

. tests/install.sh

has_vulkan() {
    compgen -G '/usr/share/vulkan/icd.d/*.json' >/dev/null || compgen -G '/etc/vulkan/icd.d/*.json' >/dev/null \
        || [ -n "${VK_DRIVER_FILES:-}${VK_ICD_FILENAMES:-}" ]
}

# SwiftShader has subgroups of 4, flushes subnormal numbers to zero, and does not end long loops. Runs each kernel, and the
# tests of the suite with random spheres, tables and results, with few cases per property. The suite's fixed scenes take
# long and would test nothing new. Arguments choose packages and features.
swiftshader=/usr/lib/chromium/vk_swiftshader_icd.json
on_swiftshader() {
    say "on SwiftShader:"
    export VK_DRIVER_FILES=$swiftshader LAZYGRID_REQUIRE_GPU=1 LAZYGRID_TEST_VARIANTS=gpu PROPTEST_CASES=2
    # The driver's compiler often allocates and frees memory. By default glibc returns it to the system, which takes a sixth
    # of the time.
    export MALLOC_TRIM_THRESHOLD_=1073741824 MALLOC_TOP_PAD_=16777216
    cargo test "$@" --test gpu -- kernels:: skin::
    cargo test "$@" --lib -- session::tests::abandoned
    cargo test "$@" --test suite -- properties:: interactions:: results:: cell_reuse::
}

# Runs all tests in two concurrent groups: within a process, tests on a software driver wait for its single queue, and cores
# are idle. `suite workspace` checks that each test is in a group. The output of the second group is printed last.
long_tests=(suite memory allocation_failure gpu gpu_failure)
other_tests=(api without_gpu cli figures kernels loops reflection tint translation gpu_runs ranks validation
    exact f64 settings sequences traffic)
all_tests() {
    local code=0 name long=() other=(--lib --bins --examples)
    for name in "${long_tests[@]}"; do long+=(--test "$name"); done
    for name in "${other_tests[@]}"; do other+=(--test "$name"); done
    cargo test "$@" --no-run
    log=$(mktemp)
    # A process group, so that `end_beside` can end all its processes.
    set -m
    cargo test "$@" "${other[@]}" >"$log" 2>&1 &
    beside=$!
    set +m
    trap end_beside EXIT
    { cargo test "$@" "${long[@]}" && cargo test "$@" --doc; } || code=$?
    [ "$code" = 0 ] && { wait "$beside" || code=$?; }
    end_beside
    return "$code"
}

end_beside() {
    trap - EXIT
    kill -- "-$beside" 2>/dev/null || true
    say "the other group of tests:"
    cat "$log"
    rm "$log"
}

command -v cc >/dev/null || install_packages gcc libc6-dev
if [ "$(uname)" = Linux ] && ! has_vulkan; then
    install_packages mesa-vulkan-drivers libvulkan1 || say "no Vulkan driver: the GPU's tests are skipped"
fi

# Always all default members: a selection of packages would rebuild dependencies with fewer features.
case ${1:-} in
    "")
        all_tests
        if [ -e $swiftshader ]; then
            on_swiftshader
        else
            say "skipped: SwiftShader is not installed; \`apt-get install chromium-common\` does that on Debian"
        fi
        [ -d kernels/tint/node_modules ] \
            || say "skipped: Tint is not installed; \`npm ci --prefix kernels/tint\` does that"
        ;;
    --quick)
        PROPTEST_CASES=4 cargo test --lib --bins --test=suite --test=cli --test=loops --test=reflection -- \
            --skip animation:: --skip memory_limits:: --skip page:: --skip simulate:: --skip the_gpu_is_all_right
        ;;
    --all)
        shift
        all_tests "$@"
        ;;
    --swiftshader)
        shift
        on_swiftshader "$@"
        ;;
    *) cargo test "$@" ;;
esac
