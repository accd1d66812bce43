#!/usr/bin/env bash
# Runs all tests. Needs Rust and a C linker (Debian: `apt-get install gcc libc6-dev`); cargo fetches the rest.
# Arguments go to `cargo test`, as in `./test.sh -p lazygrid-tests properties`.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")"

if ! command -v cc >/dev/null; then
    echo "test.sh: no C linker; installing gcc" >&2
    sudo=$([ "$(id -u)" = 0 ] || command -v sudo || true)
    $sudo apt-get update -qq
    $sudo apt-get install -y -qq gcc libc6-dev
fi

if [ $# = 0 ]; then
    set -- --workspace
fi
exec cargo test "$@"
