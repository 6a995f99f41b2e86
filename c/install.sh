#!/usr/bin/env bash
# Builds the library for C and installs it: c/install.sh PREFIX
#
# Into PREFIX/lib the shared and the static library, pkg-config's and CMake's descriptions, into PREFIX/include the headers for C and C++.
set -euo pipefail
[ $# = 1 ] || { echo "usage: c/install.sh PREFIX" >&2; exit 2; }
mkdir -p "$1"
prefix=$(cd "$1" && pwd)
cd "$(dirname "$0")"

cargo build --release --locked
built=${CARGO_TARGET_DIR:-target}/release
version=$(sed -n 's/^version = "\(.*\)"/\1/p' Cargo.toml | head -n 1)
interface=$(echo "$version" | awk -F. '{ print $1 == 0 ? $1 "." $2 : $1 }')

install -d "$prefix/include" "$prefix/lib/pkgconfig" "$prefix/lib/cmake/kalmems"
install -m 644 include/kalmems.h include/kalmems.hpp "$prefix/include"
install -m 644 "$built/libkalmems_c.a" "$prefix/lib"
install -m 755 "$built/libkalmems_c.so" "$prefix/lib/libkalmems_c.so.$version"
ln -sf "libkalmems_c.so.$version" "$prefix/lib/libkalmems_c.so.$interface"
ln -sf "libkalmems_c.so.$interface" "$prefix/lib/libkalmems_c.so"
filled() {
    sed -e "s|@PREFIX@|$prefix|" -e "s|@VERSION@|$version|" "$1"
}
filled packaging/kalmems.pc.in >"$prefix/lib/pkgconfig/kalmems.pc"
cp packaging/kalmemsConfig.cmake "$prefix/lib/cmake/kalmems"
filled packaging/kalmemsConfigVersion.cmake.in >"$prefix/lib/cmake/kalmems/kalmemsConfigVersion.cmake"
echo "installed kalmems $version into $prefix"
