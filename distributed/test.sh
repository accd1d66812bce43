#!/usr/bin/env bash
# Runs the tests of several ranks in about two minutes on two cores; in four, unless `./test.sh` has built with the same
# features. Needs an MPI, a C compiler and libclang (Debian: libopenmpi-dev openmpi-bin libclang-dev); without them it
# reports a skip, or fails with LAZYGRID_REQUIRE_MPI=1. Tests of ranks with GPUs are skipped without a GPU, or fail with
# LAZYGRID_REQUIRE_GPU=1. `cargo test -p lazygrid-ranks` needs no MPI.
#
#     distributed/test.sh              all tests on 1, 2, 3, 5 and 8 ranks, then the command
#     distributed/test.sh 3 answers    the cases whose names contain `answers`, on 3 ranks
#     distributed/test.sh --features lazygrid-cli/arrow …    with the builds of `./test.sh --all --features lazygrid-cli/arrow`
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/mpi"

say() { echo "distributed/test.sh: $*" >&2; }

missing=()
command -v mpirun >/dev/null || missing+=(openmpi-bin)
command -v mpicc >/dev/null || missing+=(libopenmpi-dev)
# bindgen also needs clang's headers.
compgen -G '/usr/lib/llvm-*/lib/clang/*/include/stddef.h' >/dev/null || [ -n "${LIBCLANG_PATH:-}" ] \
    || missing+=(libclang-dev)
if [ ${#missing[@]} -gt 0 ]; then
    say "SKIPPED: nothing of MPI was tested; \`apt-get install ${missing[*]}\` installs what is missing on Debian"
    [ -z "${LAZYGRID_REQUIRE_MPI:-}" ]
    exit
fi

# For containers, which often run as root with fewer cores than ranks: waiting ranks yield.
export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 OMPI_MCA_mpi_yield_when_idle=1
export OMPI_MCA_rmaps_base_oversubscribe=1 OMPI_MCA_hwloc_base_binding_policy=none
export OMPI_MCA_btl_vader_single_copy_mechanism=none

features=()
case ${1:-} in
    --features) features=(--features "${2:?which features}") && shift 2 ;;
    -*) say "unknown option $1" && exit 2 ;;
esac

host=$(rustc -vV | sed -n 's/^host: //p')
runner=CARGO_TARGET_$(tr 'a-z-' 'A-Z_' <<<"$host")_RUNNER

# suite RANKS ARGUMENT…
suite() {
    local ranks=$1
    shift
    env "$runner=mpirun --oversubscribe -n $ranks" cargo test --quiet ${features[@]+"${features[@]}"} --test suite -- "$@"
}

if [ $# -gt 0 ]; then
    suite "$@"
    exit
fi

cargo test --quiet ${features[@]+"${features[@]}"} --lib --bins
for ranks in 1 2 3 5 8; do
    suite "$ranks"
done

# A panic on one rank ends the waiting others, with an exit code that is not 0.
code=0
said=$(LAZYGRID_TEST_MPI_PANIC=1 timeout 300 env "$runner=mpirun --oversubscribe -n 3" \
    cargo test --quiet ${features[@]+"${features[@]}"} --test suite 2>&1) || code=$?
if [ $code = 0 ] || [ $code = 124 ] || ! grep -q 'a panic on rank 2, as was asked for' <<<"$said"; then
    say "a panic on one of three ranks ended with code $code: $said"
    exit 1
fi
say "a panic on one rank ended the job with code $code"

cargo test --quiet ${features[@]+"${features[@]}"} --test command --test simulate --test gpu
# The build for nodes without GPUs.
cargo check --quiet --no-default-features --features command
