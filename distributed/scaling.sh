#!/usr/bin/env bash
# Times steps on 1, 2, 4 … ranks, and prints a line of JSON for each: first with as many spheres per rank (weak scaling),
# then with as many in all (strong scaling). Has the requirements of distributed/test.sh.
#
#     distributed/scaling.sh 8                          up to 8 ranks here
#     LAUNCH='srun -n' distributed/scaling.sh 512       in an allocation of a cluster
#     PER_RANK=2000000 distributed/scaling.sh 64 --scene gaussian --backend gpu
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
most=${1:?how many ranks at most}
shift

cargo build --release --manifest-path "$here/mpi/Cargo.toml"
command=${CARGO_TARGET_DIR:-$here/../target}/release/lazygrid-mpi
launch=${LAUNCH:-mpirun --oversubscribe -n}
per_rank=${PER_RANK:-1000000}

for how in --per-rank --spheres; do
    for ((ranks = 1; ranks <= most; ranks *= 2)); do
        # A launcher with its options is several words.
        # shellcheck disable=SC2086
        $launch "$ranks" "$command" bench-scaling "$how" "$([ $how = --spheres ] && echo $((per_rank * 8)) || echo "$per_rank")" "$@"
    done
done
