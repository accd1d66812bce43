# Functions of the scripts that test C and Java, which source this file. `name` is the script's name.

say() { echo "$name: $*" >&2; }

. tests/install.sh

passed=0 skipped=0
# passes NAME COMMAND…: runs a test, and ends the script if it fails.
passes() {
    local what=$1
    shift
    say "$what"
    "$@" || { say "$what failed: $*"; echo "$passed passed, 1 failed, $skipped skipped"; exit 1; }
    passed=$((passed + 1))
}
skip() { say "skipped: $*"; skipped=$((skipped + 1)); }
