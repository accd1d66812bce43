# Installs Debian packages for the scripts that run tests, which source this file from the root and define `say`.

# install_packages PACKAGE…: fails without apt-get, or without the rights to run it.
install_packages() {
    local sudo
    sudo=$([ "$(id -u)" = 0 ] || command -v sudo || true)
    if ! command -v apt-get >/dev/null || { [ "$(id -u)" != 0 ] && [ -z "$sudo" ]; }; then
        say "$* cannot be installed here"
        return 1
    fi
    say "installing $*"
    { $sudo apt-get update -qq && $sudo apt-get install -y -qq --no-install-recommends "$@"; } >/dev/null
}

# have COMMAND-OR-FILES PACKAGE…: succeeds if the command or a file of the pattern exists, or the packages could be installed.
have() {
    local wanted=$1
    shift
    { command -v "$wanted" || compgen -G "$wanted"; } >/dev/null && return
    say "$wanted is missing"
    install_packages "$@" || return
    { command -v "$wanted" || compgen -G "$wanted"; } >/dev/null
}
