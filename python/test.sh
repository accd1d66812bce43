#!/usr/bin/env bash
# Builds the wheel of the Python package, installs it in a fresh environment, and runs its tests, type checks and examples
# there. Needs Rust, and Python 3.10 or later with venv; pip fetches the rest. Without such a Python it reports a skip, or
# fails with LAZYGRID_REQUIRE_PYTHON=1.
#
#     python/test.sh               a build in the dev profile
#     python/test.sh --release     a release build, like `pip wheel python/`
#     python/test.sh --features lazygrid-cli/arrow     with the builds of `./test.sh --all --features lazygrid-cli/arrow`
#
# Tests compare the package with the Rust command at the path LAZYGRID; by default with the package's own command.
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

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"$python" -m venv "$work/tools" && "$python" -m venv "$work/fresh"
say "with $("$python" --version), in $work"
"$work/tools/bin/pip" install --quiet --disable-pip-version-check "maturin>=1.16,<2"
"$work/tools/bin/maturin" build --quiet --locked --interpreter "$work/fresh/bin/python" --out "$work/wheel" "$@"

bin=$work/fresh/bin
"$bin/pip" install --quiet --disable-pip-version-check "$(echo "$work"/wheel/lazygrid-*.whl)[test]" typing_extensions
"$bin/python" -m pytest --quiet -p no:cacheprovider
"$bin/python" -m mypy --cache-dir "$work/mypy"
"$bin/python" -m mypy.stubtest --ignore-disjoint-bases lazygrid._lazygrid
for example in examples/*.py; do
    say "$example"
    "$bin/python" "$example"
done
# PyTorch is used only if the system has it: its wheel takes half a gigabyte, and CUDA two more.
if /usr/bin/python3 -c "import torch, venv, ensurepip" 2>/dev/null; then
    say "examples/torch_relax.py, with the system's PyTorch"
    /usr/bin/python3 -m venv --system-site-packages "$work/torch"
    "$work/torch/bin/pip" install --quiet --disable-pip-version-check --no-deps "$work"/wheel/lazygrid-*.whl
    "$work/torch/bin/python" examples/torch_relax.py
else
    say "skipped: examples/torch_relax.py; on Debian \`apt-get install python3-torch\`"
fi
# Few spheres: checks the answers of the benchmark, not its times.
"$bin/python" bench/compare.py --spheres 500 --rounds 1 >/dev/null
