#!/usr/bin/env bash
# Builds the wheel of the Python package, installs it in a fresh environment, and runs its tests, type checks and examples
# there. Needs Rust, and Python 3.10 or later with venv; pip fetches the rest. Where there is no such Python it says so and
# ends: LAZYGRID_REQUIRE_PYTHON=1 turns that into a failure.
#
#     python/test.sh               the wheel of a quick build
#     python/test.sh --release     the wheel that is published, as `pip wheel python/` makes it
#     python/test.sh --features lazygrid-cli/arrow     with the builds of `./test.sh --all --features lazygrid-cli/arrow`
#
# LAZYGRID, the path of the Rust command, is compared with the package where it is set; else the package's own is.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")"

say() { echo "python/test.sh: $*" >&2; }

skip() {
    say "skipped: $*"
    [ -z "${LAZYGRID_REQUIRE_PYTHON:-}" ]
    exit
}

usable='import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 10))'
for python in ${PYTHON:-} python3.13 python3.12 python3.11 python3.10 python3 none; do
    "$python" -c "$usable" 2>/dev/null && break
done
[ "$python" != none ] || skip "no Python 3.10 or later with venv; on Debian \`apt-get install python3-venv\`"

room=$(mktemp -d)
trap 'rm -rf "$room"' EXIT
"$python" -m venv "$room/tools" && "$python" -m venv "$room/fresh"
say "with $("$python" --version), in $room"
"$room/tools/bin/pip" install --quiet --disable-pip-version-check "maturin>=1.16,<2"
"$room/tools/bin/maturin" build --quiet --locked --interpreter "$room/fresh/bin/python" --out "$room/wheel" "$@"

in_room=$room/fresh/bin
"$in_room/pip" install --quiet --disable-pip-version-check "$(echo "$room"/wheel/lazygrid-*.whl)[test]" typing_extensions
"$in_room/python" -m pytest --quiet -p no:cacheprovider
"$in_room/python" -m mypy --cache-dir "$room/mypy"
"$in_room/python" -m mypy.stubtest --ignore-disjoint-bases lazygrid._lazygrid
for example in examples/*.py; do
    say "$example"
    "$in_room/python" "$example"
done
# PyTorch's own wheel is half a gigabyte, and brings two of CUDA along: it is made use of where the system has it.
if /usr/bin/python3 -c "import torch, venv, ensurepip" 2>/dev/null; then
    say "examples/torch_relax.py, with the system's PyTorch"
    /usr/bin/python3 -m venv --system-site-packages "$room/torch"
    "$room/torch/bin/pip" install --quiet --disable-pip-version-check --no-deps "$room"/wheel/lazygrid-*.whl
    "$room/torch/bin/python" examples/torch_relax.py
else
    say "skipped: examples/torch_relax.py; on Debian \`apt-get install python3-torch\`"
fi
# On few spheres, for its answers and not for its times.
"$in_room/python" bench/compare.py --spheres 500 --rounds 1 >/dev/null
