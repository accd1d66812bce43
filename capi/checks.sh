# Functions of the scripts that test C and Java, which source this file. `name` is the script's name.

say() { echo "$name: $*" >&2; }

# have COMMAND-OR-FILE PACKAGE…: succeeds if the command or file exists, or the packages could be installed.
have() {
    local wanted=$1 sudo
    shift
    { command -v "$wanted" >/dev/null || [ -e "$wanted" ]; } && return
    sudo=$([ "$(id -u)" = 0 ] || command -v sudo || true)
    if ! command -v apt-get >/dev/null || { [ "$(id -u)" != 0 ] && [ -z "$sudo" ]; }; then
        return 1
    fi
    say "$wanted is missing: installing $*"
    { $sudo apt-get update -qq && $sudo apt-get install -y -qq --no-install-recommends "$@"; } >/dev/null
    command -v "$wanted" >/dev/null || [ -e "$wanted" ]
}

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
