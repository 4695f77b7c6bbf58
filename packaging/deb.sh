#!/usr/bin/env bash
# Makes a Debian package of a program that was built already:  packaging/deb.sh target/release/gestalt out
# DEBFULLNAME and DEBEMAIL say who made it; XZ_LEVEL=1 is faster and larger.
#
# With dpkg-deb and dpkg-shlibdeps, which every Debian that builds has: cargo-deb would do the same and take minutes to build
# itself, on a Raspberry Pi many.
set -euo pipefail
(($# == 2)) || { echo "usage: packaging/deb.sh PROGRAM FOLDER" >&2; exit 2; }
program=$(realpath "$1") out=$(realpath -m "$2")
root=$(realpath "$(dirname "$0")/..")
cd "$root"

maintainer="${DEBFULLNAME:-The Gestalt authors} <${DEBEMAIL:-gestalt@example.org}>"
version=$(sed -n '/^\[workspace.package\]/,/^\[/s/^version = "\(.*\)"/\1/p' Cargo.toml)-1
architecture=$(dpkg --print-architecture)
# The same sources give the same package: no file is younger than the last commit.
export SOURCE_DATE_EPOCH=${SOURCE_DATE_EPOCH:-$(git log -1 --format=%ct 2>/dev/null || date +%s)}
umask 022
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
tree=$work/tree

install -D -m 755 "$program" "$tree/usr/bin/gestalt"
strip --strip-unneeded --remove-section=.comment --remove-section=.note "$tree/usr/bin/gestalt"
install -D -m 644 -t "$tree/lib/systemd/system" packaging/gestalt@.service packaging/gestalt-center@.service
doc=$tree/usr/share/doc/gestalt
install -D -m 644 -t "$doc" README.md SECURITY.md docs/*.md docs/*.json
install -D -m 644 -t "$doc/schemas" docs/schemas/*
install -D -m 644 -t "$doc/examples" configs/{template,footbot,parrot,laptop,fusion-center}.json5
# All in one folder: links to guides lead there, and what the package has not, such as sources and pictures, is named without a link.
doc=$doc perl -i -pe 's{!?\[([^][]*)\]\((?!\w+:|#)(?:docs/|\.\./)?([^)#]*)(#[^)]*)?\)}{-e "$ENV{doc}/$2" ? "[$1]($2" . ($3 // "") . ")" : $1}ge' "$doc"/*.md
# Likewise the commands and guides that examples name.
sed -i 's#configs/#/usr/share/doc/gestalt/examples/#; s#docs/#/usr/share/doc/gestalt/#' "$doc"/examples/*.json5
# The font is part of the program.
{ cat packaging/copyright; sed 's/^$/./; s/^/ /' LICENSE-MIT; echo; sed -n '/^Files:/,$p' peer/draw/fonts/LICENSE | sed 's|^Files: .*|Files: peer/draw/fonts/*|'; } >"$doc/copyright"
chmod 644 "$doc/copyright"
gzip -9n <CHANGELOG.md >"$doc/changelog.gz"
gzip -9n >"$doc/changelog.Debian.gz" <<CHANGELOG
gestalt ($version) unstable; urgency=medium

  * A package of this release; changelog.gz says what is new.

 -- $maintainer  $(date -Ru -d "@$SOURCE_DATE_EPOCH")
CHANGELOG

"$program" man "$tree/usr/share/man/man1" >/dev/null
gzip -9n "$tree"/usr/share/man/man1/*.1
completions=$tree/usr/share
install -d "$completions"/{bash-completion/completions,zsh/vendor-completions,fish/vendor_completions.d}
"$program" completions bash >"$completions/bash-completion/completions/gestalt"
"$program" completions zsh >"$completions/zsh/vendor-completions/_gestalt"
"$program" completions fish >"$completions/fish/vendor_completions.d/gestalt.fish"

install -d "$work/debian" "$tree/DEBIAN"
touch "$work/debian/control"
depends=$(cd "$work" && dpkg-shlibdeps -O "$tree/usr/bin/gestalt" 2>/dev/null | sed -n 's/^shlibs:Depends=//p')
install -m 755 packaging/{postinst,prerm,postrm} "$tree/DEBIAN"
cat >"$tree/DEBIAN/control" <<CONTROL
Package: gestalt
Version: $version
Architecture: $architecture
Maintainer: $maintainer
Installed-Size: $(du -sk --exclude=DEBIAN "$tree" | cut -f1)
Depends: adduser, $depends
Section: science
Priority: optional
Description: swarm of robots that reads hand gestures together
 Each robot sees a person's hand badly: from its own angle, with its own
 camera. It forms an opinion, gossips it over Zenoh, and the swarm settles on
 one decision, which any Zenoh client can hear. The person says whether it was
 right, and every robot learns.
 .
 This package has the program "gestalt" and the service gestalt@NAME, which
 runs the robot that /etc/gestalt/NAME.json5 describes, and gestalt-center@NAME
 for a fusion centre.
CONTROL
(cd "$tree" && find . -path ./DEBIAN -prune -o -type f -printf '%P\0' | sort -z | xargs -0 md5sum >DEBIAN/md5sums)
chmod 644 "$tree/DEBIAN/md5sums" "$tree/DEBIAN/control"

mkdir -p "$out"
package=$out/gestalt_${version}_$architecture.deb
dpkg-deb --root-owner-group -Zxz "-z${XZ_LEVEL:-6}" --build "$tree" "$package" >/dev/null
echo "$package"
