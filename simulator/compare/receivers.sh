#!/usr/bin/env bash
# Whole steps with 1 to 10 000 absorbing receivers in a periodic box, in turn, and beside another build where one is named.
# Prints milliseconds per step, medians of rounds, and their ratio to those with one receiver.
# Usage: simulator/compare/receivers.sh [PARTICLES [ROUNDS [STEPS [OTHER-LAZYGRID]]]]
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."

particles=${1:-20000} rounds=${2:-5} steps=${3:-100} other=${4:-} warm=10
lazygrid=${CARGO_TARGET_DIR:-target}/release/lazygrid
[ -n "${SKIP_BUILD:-}" ] || cargo build --quiet --release -p lazygrid-cli

scratch=$(mktemp -d)
trap 'rm -r "$scratch"' EXIT
for receivers in 1 10 100 1000 10000; do
    python3 - "$particles" "$receivers" >"$scratch/$receivers.toml" <<'PYTHON'
import sys
particles, receivers = map(int, sys.argv[1:])
side = next(k for k in range(1, 100) if k ** 3 >= receivers)
print(f"""
time-step = 1e-4
steps = 1
[boundary]
kind = "periodic"
low = [-50, -50, -50]
high = [50, 50, 50]
[[species]]
name = "A"
diffusion = 100
[[transmitter]]
name = "tx"
shape = {{ kind = "box", size = [100, 100, 100] }}
release = [{{ species = "A", count = {particles} }}]
[output]
every = 1000000""")
for k in range(receivers):
    x, y, z = [(c + 0.5) * 100 / side - 50 for c in (k % side, k // side % side, k // side // side)]
    print(f'[[receiver]]\nname = "r{k}"\ncenter = [{x}, {y}, {z}]\nradius = 0.5\nkind = "absorbing"')
PYTHON
done

# Nanoseconds of a run of this many steps.
run() {
    local start end
    start=$(date +%s%N)
    "$1" simulate "$scratch/$2.toml" --output "$scratch/run" --overwrite --threads 1 --steps "$3" >/dev/null
    end=$(date +%s%N)
    echo $((end - start))
}

echo "$particles particles, $steps steps after $warm, one thread; ms per step" >&2
for ((round = 0; round < rounds; round++)); do
    for receivers in 1 10 100 1000 10000; do
        for build in "$lazygrid" $other; do
            # The loop over thousands of receivers that came before takes minutes.
            [ "$build" = "$lazygrid" ] || [ "$receivers" -le 1000 ] || continue
            count=$steps before=$warm
            [ "$build" = "$lazygrid" ] || [ "$receivers" -lt 100 ] || { count=$((300 / receivers + 1)) before=1; }
            first=$(run "$build" "$receivers" "$before")
            last=$(run "$build" "$receivers" $((before + count)))
            name=$([ "$build" = "$lazygrid" ] && echo this || echo other)
            echo "$name $receivers $(awk "BEGIN { print ($last - $first) / $count / 1e6 }")"
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
            if (parts[2] == 1) one[parts[1]] = m
            printf "%-6s %6d receivers %10.3f ms  %8.2f x\n", parts[1], parts[2], m, m / one[parts[1]]
        }
    }'
