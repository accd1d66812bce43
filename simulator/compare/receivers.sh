#!/usr/bin/env bash
# Times whole steps with 1 to 10 000 absorbing receivers in a periodic box, in turn, optionally also with another build.
# RECEIVERS, EDGE (of the box), DIFFUSION and KIND (of receivers) in the environment change the scene, and BACKEND=gpu the
# backend. Prints milliseconds of processor time per step, medians of rounds, and their ratio to the first number of receivers.
# Usage: simulator/compare/receivers.sh [PARTICLES [ROUNDS [STEPS [OTHER-LAZYGRID]]]]
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."

edge=${EDGE:-100} diffusion=${DIFFUSION:-100} kind=${KIND:-absorbing} backend=${BACKEND:-cpu}
read -ra counts <<<"${RECEIVERS:-1 4 8 10 16 32 100 1000 10000}"
particles=${1:-20000} rounds=${2:-5} steps=${3:-100} other=${4:-} warm=10
lazygrid=${CARGO_TARGET_DIR:-target}/release/lazygrid
[ -n "${SKIP_BUILD:-}" ] || cargo build --quiet --release -p lazygrid-cli

scratch=$(mktemp -d)
trap 'rm -r "$scratch"' EXIT
for receivers in "${counts[@]}"; do
    python3 - "$particles" "$receivers" "$edge" "$diffusion" "$kind" >"$scratch/$receivers.toml" <<'PYTHON'
import sys
particles, receivers = map(int, sys.argv[1:3])
edge, diffusion = map(float, sys.argv[3:5])
half = edge / 2
side = next(k for k in range(1, 100) if k ** 3 >= receivers)
print(f"""
time-step = 1e-4
steps = 1
[boundary]
kind = "periodic"
low = [{-half}, {-half}, {-half}]
high = [{half}, {half}, {half}]
[[species]]
name = "A"
diffusion = {diffusion}
[[transmitter]]
name = "tx"
shape = {{ kind = "box", size = [{edge}, {edge}, {edge}] }}
release = [{{ species = "A", count = {particles} }}]
[output]
every = 1000000""")
for k in range(receivers):
    x, y, z = [(c + 0.5) * edge / side - half for c in (k % side, k // side % side, k // side // side)]
    print(f'[[receiver]]\nname = "r{k}"\ncenter = [{x}, {y}, {z}]\nradius = 0.5\nkind = "{sys.argv[5]}"')
PYTHON
done

# Seconds of processor time of a run, which other load hardly changes.
run() {
    local TIMEFORMAT=%3U
    { time "$1" simulate "$scratch/$2.toml" --output "$scratch/run" --overwrite --backend "$backend" --threads 1 --steps "$3" >/dev/null 2>"$scratch/said"; } 2>&1
}

echo "$particles particles, $steps steps after $warm, $backend, one thread; ms per step" >&2
for ((round = 0; round < rounds; round++)); do
    for receivers in "${counts[@]}"; do
        for build in "$lazygrid" $other; do
            first=$(run "$build" "$receivers" "$warm")
            last=$(run "$build" "$receivers" $((warm + steps)))
            name=$([ "$build" = "$lazygrid" ] && echo this || echo other)
            echo "$name $receivers $(awk "BEGIN { print ($last - $first) / $steps * 1e3 }")"
        done
    done
done | awk '
    { key = $1 " " $2; n[key]++; all[key, n[key]] = $3 + 0; if (!(key in seen)) { seen[key] = 1; order[++keys] = key } }
    function median(key,    count, i, j, t) {
        count = n[key]
        for (i = 1; i <= count; i++) for (j = i + 1; j <= count; j++)
            if (all[key, j] < all[key, i]) { t = all[key, i]; all[key, i] = all[key, j]; all[key, j] = t }
        return (all[key, int((count + 1) / 2)] + all[key, int((count + 2) / 2)]) / 2
    }
    END {
        for (k = 1; k <= keys; k++) {
            split(order[k], parts, " ")
            m = median(order[k])
            if (!(parts[1] in one)) one[parts[1]] = m
            printf "%-6s %6d receivers %10.3f ms  %8.2f x\n", parts[1], parts[2], m, m / one[parts[1]]
        }
    }'
