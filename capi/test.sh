#!/usr/bin/env bash
# Tests the C and C++ library as programs use it: header against library, programs built through pkg-config and CMake,
# shared and static, with AddressSanitizer and under valgrind.
#
#     capi/test.sh                  all tests
#     capi/test.sh --without-gpu    a library without the GPU path, which builds faster; skips the sizes of releases
#
# Needs Rust. On Debian it installs missing packages, with a message: gcc, g++, pkg-config, cmake, valgrind, ns-3.
# Elsewhere it skips tests of missing tools with a message. The counts of the program for ns-3 are compared with those of
# LAZYGRID, the path of the Rust command, by default that in the target folder.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

name=capi/test.sh
. capi/checks.sh

options=() features=()
case ${1:-} in
    "") ;;
    --without-gpu) options=(--without-gpu) features=(--no-default-features) ;;
    *) sed -n '5,6s/^# *//p' "$0" >&2; exit 2 ;;
esac
have cc gcc libc6-dev || { say "a C compiler is needed"; exit 1; }
have c++ g++ || { say "a C++ compiler is needed"; exit 1; }

target=${CARGO_TARGET_DIR:-$PWD/target}
work=$target/capi-test
rm -rf "$work"
mkdir -p "$work"
strict=(-Wall -Wextra -Wpedantic -Werror -g)

passes "the header against the library" cargo test -p lazygrid-capi -p lazygrid-features "${features[@]}"
passes "install" capi/install.sh "$work/first" --debug "${options[@]}"
# A moved installation must still be found.
mv "$work/first" "$work/prefix"
prefix=$work/prefix

exported() { nm -D --defined-only "$prefix/lib/liblazygrid.so" | awk '$2 == "T" { print $3 }' | sort; }
declared() { sed -n "s/^LAZYGRID_API.*[ *]\(lazygrid_[a-z0-9_]*\)(.*/\1/p" capi/include/lazygrid.h | sort -u; }
symbols() { diff <(exported) <(declared); }
soname() { readelf -d "$prefix/lib/liblazygrid.so" | grep -q 'soname: \[liblazygrid.so.[0-9]'; }
if [ "$(uname)" = Linux ] && have readelf binutils; then
    passes "what the library exports is what the header declares" symbols
    passes "the library has a SONAME" soname
else
    skip "exports and SONAME are looked at on Linux, with binutils"
fi

# With other compilers and systems, files may be a third larger than in capi/README.md. Much smaller files mean that its
# numbers are outdated.
# size_is_documented FILE MEGABYTES
size_is_documented() {
    local size documented=$2
    size=$(stat -Lc %s "$1")
    say "$1 has $size bytes, $documented MB are documented"
    awk -v size="$size" -v documented="$documented" 'BEGIN { exit !(size >= documented * 8e5 && size <= documented * 4e6 / 3) }'
}
# sizes_are_documented FOLDER TEXT-BEFORE-THE-SHARED-ONE TEXT-BETWEEN
sizes_are_documented() {
    local text shared static
    text=$(tr '\n' ' ' <capi/README.md)
    text=${text##*"$2"}
    shared=${text%%"$3"*}
    text=${text#*"$3"}
    static=${text%% MB*}
    size_is_documented "$1/lib/liblazygrid.so" "$shared" && size_is_documented "$1/lib/liblazygrid.a" "$static"
}
if [ ${#options[@]} != 0 ]; then
    skip "sizes of releases, which take the time of two optimized builds, are compared without options"
elif [ "$(uname)" = Linux ] && have strip binutils; then
    passes "install of a release" capi/install.sh "$work/release"
    passes "its sizes are about the documented ones" \
        sizes_are_documented "$work/release" "the shared library has " " MB and the static one "
    passes "install of a release without the GPU path" capi/install.sh "$work/small" --without-gpu
    passes "its sizes are about the documented ones" \
        sizes_are_documented "$work/small" "without the GPU path " " and "
else
    skip "sizes are compared on Linux, with binutils"
fi

export PKG_CONFIG_PATH=$prefix/lib/pkgconfig
export LD_LIBRARY_PATH=$prefix/lib${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}

# build NAME STANDARD SOURCE OPTION…: compiles with the options of pkg-config and the shared library.
build() {
    local name=$1 language=$2 source=$3 compiler=cc
    shift 3
    case $language in c++*) compiler=c++ ;; esac
    # shellcheck disable=SC2046 # words of pkg-config are options
    $compiler -std="$language" "${strict[@]}" $(pkg-config --cflags lazygrid) "$source" -o "$work/$name" \
        $(pkg-config --libs lazygrid) -lm -pthread "$@"
}
# build_static NAME STANDARD SOURCE: compiles with the static library.
build_static() {
    local name=$1 language=$2 source=$3 compiler=cc
    case $language in c++*) compiler=c++ ;; esac
    # shellcheck disable=SC2046
    $compiler -std="$language" "${strict[@]}" $(pkg-config --cflags lazygrid) "$source" -o "$work/$name" \
        "$prefix/lib/liblazygrid.a" $(pkg-config --static --libs-only-l lazygrid | sed 's/-llazygrid//')
}
# build_and_run NAME STANDARD SOURCE OPTION…
build_and_run() { build "$@" && "$work/$1"; }

if have pkg-config pkg-config; then
    passes "C" build_and_run contract c99 capi/tests/contract.c
    passes "C, newest standard" build_and_run contract-c17 c17 capi/tests/contract.c
    passes "C, two sets and skins" build_and_run sets c99 capi/tests/sets.c
    passes "C, neighbor lists" build_and_run lists c99 capi/tests/lists.c
    passes "C, doubles and layouts" build_and_run doubles c99 capi/tests/doubles.c
    passes "C, triclinic boxes and exclusions" build_and_run exclusions c99 capi/tests/exclusions.c
    if [ "$(uname)" = Linux ]; then
        passes "C, under limits of memory" build_and_run memory c99 capi/tests/memory.c
    fi
    passes "C++17" build_and_run wrapper c++17 capi/tests/wrapper.cpp
    passes "C++20, with std::span" build_and_run wrapper-20 c++20 capi/tests/wrapper.cpp
    if [ ${#features[@]} = 0 ]; then
        passes "GPU" build_and_run gpu c99 capi/tests/gpu.c
    else
        skip "the GPU, by --without-gpu"
    fi
    passes "example in C" build_and_run steps c99 capi/examples/steps.c
    passes "example in C++" build_and_run species c++17 capi/examples/species.cpp
    # The first program of the README.
    awk '/^```c$/ { inside = 1; next } /^```$/ { if (inside) exit } inside' capi/README.md >"$work/readme.c"
    passes "the README's program" build_and_run readme c99 "$work/readme.c"
    # documented COMMAND SOURCE NAME: runs a command of the documentation without LD_LIBRARY_PATH.
    documented() { cp "$2" "$work/$3" && (cd "$work" && env -u LD_LIBRARY_PATH sh -c "$1"); }
    passes "the example's command in C" \
        documented "$(sed -n 's/^ \*     \(cc .*\)/\1/p' capi/examples/steps.c)" capi/examples/steps.c steps.c
    passes "the example's command in C++" \
        documented "$(sed -n '/^\/\/     run_path=/,/a.out$/s/^\/\/ *//p' capi/examples/species.cpp)" \
        capi/examples/species.cpp species.cpp
    passes "the README's command" \
        documented "$(sed -n 's/^| pkg-config | `\(cc .*\)` |$/\1/p' capi/README.md) && ./a.out" "$work/readme.c" program.c
    passes "C, static" build_static contract-static c99 capi/tests/contract.c
    passes "C, static, runs" "$work/contract-static"

    lazygrid=${LAZYGRID:-$target/debug/lazygrid}
    if ! have /usr/include/ns3/core-module.h libns3-dev; then
        skip "ns-3 is not installed"
    elif ! [ -x "$lazygrid" ]; then
        skip "ns-3, for there is no $lazygrid to compare with: cargo build -p lazygrid-cli"
    else
        passes "the simulator's response" "$lazygrid" simulate capi/examples/ns3/channel.toml --replicas 64 \
            --output "$work/channel"
        passes "ns-3 is built" build ns3 c++17 capi/examples/ns3/channel.cc -O1 -lns3-core
        passes "ns-3's response is the same" "$work/ns3" "$work/channel/mean.csv" 64
    fi

    sanitizers=(-fsanitize=address,undefined -fno-sanitize-recover=all)
    echo 'int main(void) { return 0; }' >"$work/empty.c"
    if cc "${sanitizers[@]}" "$work/empty.c" -o "$work/empty" 2>/dev/null; then
        export ASAN_OPTIONS=detect_leaks=1
        passes "C, AddressSanitizer" build_and_run contract-asan c99 capi/tests/contract.c "${sanitizers[@]}"
        passes "C, two sets, AddressSanitizer" build_and_run sets-asan c99 capi/tests/sets.c "${sanitizers[@]}"
        passes "C, doubles, AddressSanitizer" build_and_run doubles-asan c99 capi/tests/doubles.c "${sanitizers[@]}"
        passes "C, exclusions, AddressSanitizer" \
            build_and_run exclusions-asan c99 capi/tests/exclusions.c "${sanitizers[@]}"
        passes "C++, AddressSanitizer" build_and_run wrapper-asan c++17 capi/tests/wrapper.cpp "${sanitizers[@]}"
    else
        skip "cc has no AddressSanitizer"
    fi

    # The threads of the process's pool never end, so their memory is reachable; only unreachable memory is a leak. Fair
    # scheduling, because valgrind runs one thread at a time, and a waiting thread must not block the others.
    watched() {
        valgrind -q --fair-sched=yes --leak-check=full --show-leak-kinds=definite,indirect \
            --errors-for-leak-kinds=definite,indirect --error-exitcode=9 "$@"
    }
    if have valgrind valgrind; then
        passes "C under valgrind" watched "$work/contract"
        passes "C, doubles, under valgrind" watched "$work/doubles"
        passes "C++ under valgrind" watched "$work/wrapper"
    else
        skip "valgrind is not installed"
    fi
else
    skip "pkg-config is not installed, nor what is built with it"
fi

if have cmake cmake && have make make; then
    passes "CMake finds it" \
        cmake -S capi/examples -B "$work/cmake" -DCMAKE_PREFIX_PATH="$prefix" -DCMAKE_BUILD_TYPE=Debug
    passes "CMake builds" cmake --build "$work/cmake"
    run_all() { (cd "$work/cmake" && ctest --output-on-failure); }
    passes "what CMake built" run_all
    refused() { ! cmake -S capi/examples -B "$work/other" -Dlazygrid_DIR="$work/none" >"$work/other.log" 2>&1; }
    passes "CMake reports a missing installation" refused
else
    skip "cmake is not installed"
fi
echo "$passed passed, 0 failed, $skipped skipped"
