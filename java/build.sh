#!/usr/bin/env bash
# Builds the jar: target/java/lazygrid-VERSION.jar, with the native library of this machine inside.
#
#     java/build.sh [--debug] [--without-gpu]     passed on to capi/install.sh
#
# Needs Rust, a JDK 17 or later, and JNA 5 (JNA_JAR, by default Debian's /usr/share/java/jna.jar). The class for Java 22 and
# later is compiled by a javac of 22 or later, or by Eclipse's compiler ecj with a Java 22 runtime (JAVA22_HOME). With
# neither, the jar lacks this class and calls through JNA in all versions, and the script prints a message.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

say() { echo "java/build.sh: $*" >&2; }

jna=${JNA_JAR:-/usr/share/java/jna.jar}
[ -e "$jna" ] || { say "$jna is missing; set JNA_JAR, or install libjna-java on Debian"; exit 1; }
work=${CARGO_TARGET_DIR:-$PWD/target}/java
rm -rf "$work"
mkdir -p "$work/classes"

capi/install.sh "$work/prefix" "$@"
version=$(cargo pkgid -p lazygrid-capi | sed 's/.*[#@]//')
processor=$(uname -m)
case $(uname) in
    Darwin) system=macos file=liblazygrid.dylib ;;
    *) system=linux file=liblazygrid.so ;;
esac
mkdir -p "$work/classes/native/$system-${processor/arm64/aarch64}"
cp -L "$work/prefix/lib/$file" "$work/classes/native/$system-${processor/arm64/aarch64}/"

# shellcheck disable=SC2046 # no name has a blank
javac -Xlint:all -Werror --release 17 -cp "$jna" -d "$work/classes" $(find java/src/main/java -name '*.java')

newer=(java/src/main/java22/io/github/lazygrid/*.java)
classes22=$work/classes/META-INF/versions/22
if [ "$(javac -version 2>&1 | sed 's/javac \([0-9]*\).*/\1/')" -ge 22 ]; then
    javac -Xlint:all,-restricted -Werror --release 22 -cp "$work/classes" -d "$classes22" "${newer[@]}"
elif [ -n "${JAVA22_HOME:-}" ] && command -v ecj >/dev/null; then
    # The compiler knows no newer class files than those of Java 17; the classes that it looks up are the runtime's.
    ecj -proc:none -nowarn --system "$JAVA22_HOME" -source 17 -target 17 -cp "$work/classes" -d "$classes22" "${newer[@]}"
else
    say "without java.lang.foreign: there is neither a javac of 22 or later, nor ecj and JAVA22_HOME"
fi

cat >"$work/manifest" <<MANIFEST
Multi-Release: true
Automatic-Module-Name: io.github.lazygrid
Implementation-Title: lazygrid
Implementation-Version: $version
MANIFEST
jar --create --file "$work/lazygrid-$version.jar" --manifest "$work/manifest" -C "$work/classes" .
say "$work/lazygrid-$version.jar"
