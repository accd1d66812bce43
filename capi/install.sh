#!/usr/bin/env bash
# Builds and installs the C library. Needs Rust and a C linker.
#
#     capi/install.sh PREFIX [--debug] [--without-gpu]
#
# PREFIX/lib gets the shared and the static library, with files for pkg-config and for CMake's find_package;
# PREFIX/include gets lazygrid.h and lazygrid.hpp. --debug builds faster, for tests. --without-gpu omits the GPU path.
# Without --debug, installed libraries are stripped of debug information. On Linux, root runs ldconfig.
set -euo pipefail

usage() { sed -n '4s/^# *//p' "$0" >&2; exit 2; }

prefix= profile=release options=()
for argument; do
    case $argument in
        --debug) profile=debug ;;
        --without-gpu) options+=(--no-default-features) ;;
        -*) usage ;;
        *) [ -z "$prefix" ] || usage; prefix=$argument ;;
    esac
done
[ -n "$prefix" ] || usage
# Debug builds share the dependencies that tests have built.
[ $profile = debug ] && options+=(-p lazygrid-features) || options+=(--release)
mkdir -p "$prefix"
prefix=$(cd "$prefix" && pwd)
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
cd "$here/.."

cargo build -p lazygrid-capi "${options[@]}"
built=${CARGO_TARGET_DIR:-target}/$profile

version=$(cargo pkgid -p lazygrid-capi | sed 's/.*[#@]//')
IFS=. read -r major minor _ <<<"$version"
[ "$major" = 0 ] && number=0.$minor || number=$major
# `private` lists the libraries that the static library needs.
if [ "$(uname)" = Darwin ]; then
    shared=liblazygrid.$version.dylib soname=liblazygrid.$number.dylib link=liblazygrid.dylib
    private="-framework CoreFoundation -framework Metal -framework QuartzCore -framework Foundation -lobjc -liconv -lm"
else
    shared=liblazygrid.so.$version soname=liblazygrid.so.$number link=liblazygrid.so
    private="-lgcc_s -lutil -lrt -lpthread -lm -ldl -lc"
fi

# fill TEMPLATE TARGET
fill() {
    sed -e "s|@VERSION@|$version|; s|@MAJOR@|$major|; s|@MINOR@|$minor|" \
        -e "s|@SHARED@|$shared|; s|@SONAME@|$soname|; s|@PRIVATE@|$private|" "$here/$1" >"$2"
}

mkdir -p "$prefix"/include "$prefix"/lib/pkgconfig "$prefix"/lib/cmake/lazygrid
install -m 644 "$here"/include/lazygrid.h "$here"/include/lazygrid.hpp "$prefix/include/"
install -m 755 "$built/$link" "$prefix/lib/$shared"
install -m 644 "$built/liblazygrid.a" "$prefix/lib/"
# Debug information is most of the files. Exported functions keep their names.
if [ $profile = release ] && command -v strip >/dev/null; then
    if [ "$(uname)" = Darwin ]; then
        strip -x "$prefix/lib/$shared" && strip -S "$prefix/lib/liblazygrid.a"
    else
        strip --strip-unneeded "$prefix/lib/$shared" && strip --strip-debug "$prefix/lib/liblazygrid.a"
    fi
fi
ln -sf "$shared" "$prefix/lib/$soname"
ln -sf "$soname" "$prefix/lib/$link"
fill lazygrid.pc.in "$prefix/lib/pkgconfig/lazygrid.pc"
for file in lazygrid-config lazygrid-config-version; do
    fill "cmake/$file.cmake.in" "$prefix/lib/cmake/lazygrid/$file.cmake"
done
echo "install.sh: lazygrid $version is in $prefix" >&2
# The dynamic loader of Linux reads a cache of its directories.
if [ "$(uname)" = Linux ]; then
    PATH=$PATH:/usr/sbin:/sbin
    [ "$(id -u)" != 0 ] || ldconfig || true
    if ! ldconfig -p 2>/dev/null | grep " => $prefix/lib/$soname\$" >/dev/null; then
        echo "install.sh: the loader does not search $prefix/lib; link programs with -Wl,-rpath,$prefix/lib" >&2
    fi
fi
