#!/usr/bin/env bash
# Measures how rounding of positions adds to diffusion: the same particles and random numbers at several distances from the
# origin, compared with the run at the origin. Lengths are in steps, √(2·D·Δt) along each axis.
# Usage: simulator/compare/positions.sh [PARTICLES [STEPS]]
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."

particles=${1:-300} steps=${2:-1000000}
lazygrid=${CARGO_TARGET_DIR:-target}/release/lazygrid
[ -n "${SKIP_BUILD:-}" ] || cargo build --quiet --release -p lazygrid-cli

scratch=$(mktemp -d)
trap 'rm -r "$scratch"' EXIT
for distance in 0 1e3 1e4 1e5 1e6 1e7; do
    cat >"$scratch/run.toml" <<TOML
time-step = 1
steps = $steps
[[species]]
name = "A"
diffusion = 0.5
[[transmitter]]
name = "tx"
center = [$distance, $distance, $distance]
release = [{ species = "A", count = $particles }]
[output]
every = $steps
frames = ["xyz"]
frames-every = $steps
TOML
    "$lazygrid" simulate "$scratch/run.toml" --output "$scratch/run" --overwrite --threads 1 >/dev/null 2>"$scratch/said"
    # The last frame, by id: id, species, x, y, z, radius.
    tail -n "$particles" "$scratch/run/frames.xyz" >"$scratch/$distance.xyz"
    paste "$scratch/0.xyz" "$scratch/$distance.xyz" | awk -v d="$distance" -v steps="$steps" '
        { half = NF / 2
          for (k = 3; k <= 5; k++) { moved = $(half + k) - d; all += moved * moved; off = moved - $k; wrong += off * off; n++ } }
        END { printf "%8s  mean square displacement / exact %.4f  rounding, root mean square per axis %.4g steps\n", d, all / n / steps, sqrt(wrong / n) }'
done
