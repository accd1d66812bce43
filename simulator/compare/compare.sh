#!/usr/bin/env bash
# Times whole steps (move, find, react) of lazygrid, Smoldyn 2.74 and ReaDDy 2.0.14 on one thread, in turn.
# Prints milliseconds per step, by the clock and of processor time, and how many times as fast lazygrid is.
# RECEIVERS in the environment is the number of absorbing receivers; ReaDDy has none.
# Needs Python 3.11 with venv; installs both from PyPI into target/compare.
# Usage: simulator/compare/compare.sh [MOLECULES [ROUNDS [STEPS]]]
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."

molecules=${1:-100000} rounds=${2:-3} steps=${3:-30} receivers=${RECEIVERS:-0} warm=5
target=${CARGO_TARGET_DIR:-target}
venv=$target/compare
lazygrid=$target/release/lazygrid

if [ ! -x "$venv/bin/python" ]; then
    python3 -m venv "$venv"
    "$venv/bin/pip" install --quiet smoldyn==2.74 readdy==2.0.14 numpy
fi
[ -n "${SKIP_BUILD:-}" ] || cargo build --quiet --release -p lazygrid-bench

scratch=$(mktemp -d)
trap 'rm -r "$scratch"' EXIT
"$venv/bin/python" - "$molecules" "$receivers" >"$scratch/scenario.toml" <<'PYTHON'
import sys
molecules, receivers = map(int, sys.argv[1:])
edge = (molecules * 3.141592653589793 / 6 / 0.05) ** (1 / 3)
half = edge / 2
print(f"""
time-step = 0.00125
steps = 1
[output]
every = 1000000
[boundary]
kind = "periodic"
low = [{-half}, {-half}, {-half}]
high = [{half}, {half}, {half}]
[[species]]
name = "A"
diffusion = 1
[[species]]
name = "B"
diffusion = 1
[[reaction]]
equation = "A + B -> 0"
binding-radius = 1
[[transmitter]]
name = "all"
shape = {{ kind = "box", size = [{edge}, {edge}, {edge}] }}
release = [{{ species = "A", count = {molecules // 2} }}, {{ species = "B", count = {molecules // 2} }}]
""")
side = next(k for k in range(100) if k ** 3 >= receivers)
for k in range(receivers):
    center = [(c + 0.5) * edge / side - half for c in (k % side, k // side % side, k // side // side)]
    print(f'[[receiver]]\nname = "r{k}"\ncenter = {center}\nradius = 0.5\nkind = "absorbing"')
PYTHON

# Seconds of a run, by the clock and of processor time.
run() {
    local TIMEFORMAT='%3R %3U %3S'
    { time "$lazygrid" simulate "$scratch/scenario.toml" --output "$scratch/run" --overwrite --threads 1 --steps "$1" \
        >/dev/null 2>"$scratch/said"; } 2>&1
}

echo "$molecules molecules, $receivers receivers, $steps steps after $warm, one thread; ms per step" >&2
for ((round = 0; round < rounds; round++)); do
    first=$(run $warm)
    last=$(run $((warm + steps)))
    echo "lazygrid $first $last" | awk -v n="$steps" '{ print $1, ($5 - $2) / n * 1e3, ($6 + $7 - $3 - $4) / n * 1e3 }'
    for peer in smoldyn readdy; do
        [ "$peer" = readdy ] && [ "$receivers" != 0 ] && continue
        "$venv/bin/python" simulator/compare/peer.py $peer "$molecules" $warm "$steps" "$receivers" 2>/dev/null |
            awk -v peer=$peer -v n="$steps" '/^SECONDS/ { print peer, $2 / n * 1e3, $3 / n * 1e3 }'
    done
done | awk '
    { name = $1; if (!(name in n)) order[++names] = name; n[name]++; wall[name, n[name]] = $2; cpu[name, n[name]] = $3 }
    function median(of, name,    count, i, j, t, all) {
        count = n[name]
        for (i = 1; i <= count; i++) all[i] = of[name, i] + 0
        for (i = 1; i <= count; i++) for (j = i + 1; j <= count; j++)
            if (all[j] < all[i]) { t = all[i]; all[i] = all[j]; all[j] = t }
        return (all[int((count + 1) / 2)] + all[int((count + 2) / 2)]) / 2
    }
    # Time over that of lazygrid, round by round.
    function ratio(of, name,    k) {
        for (k = 1; k <= n[name]; k++) times[name, k] = of[name, k] / of["lazygrid", k]
        return median(times, name)
    }
    END {
        for (k = 1; k <= names; k++) {
            name = order[k]
            printf "%-8s %8.2f ms (%5.1f x), processor time %8.2f ms (%5.1f x)\n", name, median(wall, name), ratio(wall, name),
                median(cpu, name), ratio(cpu, name)
        }
    }'
