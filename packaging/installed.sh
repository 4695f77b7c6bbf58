#!/usr/bin/env bash
# Installs a package in a fresh Debian 12 and runs a round of two robots there:  packaging/installed.sh out/gestalt_*.deb
#
# Needs root, debootstrap and a mirror. DEBIAN_ROOT=FOLDER takes one that debootstrap made before, and leaves it behind.
set -euo pipefail
(($# == 1)) || { echo "usage: packaging/installed.sh PACKAGE.deb" >&2; exit 2; }
package=$(realpath "$1")
if [[ -n ${DEBIAN_ROOT:-} ]]; then
  root=$DEBIAN_ROOT
else
  root=$(mktemp -d)
  # The root folder of that Debian: whoever runs the robots there must be able to enter it.
  chmod 755 "$root"
  debootstrap --variant=minbase bookworm "$root" >"$root.log" 2>&1 || { tail "$root.log" >&2; exit 1; }
fi
cleanup() {
  for process in "${robots[@]:-}"; do [[ -z $process ]] || kill "$process" 2>/dev/null || true; done
  for folder in dev proc; do mountpoint -q "$root/$folder" && umount "$root/$folder"; done
  [[ -n ${DEBIAN_ROOT:-} ]] || rm -rf --one-file-system "$root" "$root.log"
}
robots=()
trap cleanup EXIT
mount -t proc proc "$root/proc"
mount --bind /dev "$root/dev"
cp /etc/resolv.conf "$root/etc/resolv.conf"
cp "$package" "$root/tmp/gestalt.deb"

inside() { chroot "$root" env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin LANG=C.UTF-8 DEBIAN_FRONTEND=noninteractive "$@"; }
# A user of the package: robots need no other rights.
as_gestalt() { inside setpriv --reuid=gestalt --regid=gestalt --init-groups "$@"; }

inside apt-get update -qq
inside apt-get install -y -qq --no-install-recommends /tmp/gestalt.deb >/dev/null
inside dpkg --audit
inside gestalt --version
# Before any robot has started.
as_gestalt gestalt trust request 1 /var/lib/gestalt/keys

for robot in 1 2; do
  inside sh -c "sed 's/id: 1, name: \"footbot-1\"/id: $robot/' /usr/share/doc/gestalt/examples/footbot.json5 >/etc/gestalt-$robot.json5"
  inside gestalt config --check /etc/gestalt-$robot.json5
done
port=$((20000 + RANDOM % 10000))
as_gestalt gestalt peer -c /etc/gestalt-1.json5 --no-multicast-scouting -l tcp/127.0.0.1:$port >"$root/tmp/1.log" 2>&1 &
robots+=($!)
as_gestalt gestalt peer -c /etc/gestalt-2.json5 --no-multicast-scouting -l tcp/127.0.0.1:0 -e tcp/127.0.0.1:$port >"$root/tmp/2.log" 2>&1 &
robots+=($!)

for _ in $(seq 60); do
  grep -q 'linked to robot' "$root/tmp/1.log" && break
  sleep 1
done
# A round may end undecided: two robots see little. One of five does not.
for _ in 1 2 3 4 5; do
  as_gestalt gestalt teach open --no-multicast-scouting -e tcp/127.0.0.1:$port || true
  sleep 2
  if grep -q 'decided:' "$root/tmp/1.log" && grep -q 'decided:' "$root/tmp/2.log"; then
    grep -h 'decided:' "$root"/tmp/[12].log
    inside gestalt doctor --no-multicast-scouting -e tcp/127.0.0.1:$port
    echo "installed, and two robots decided"
    exit 0
  fi
done
echo "two robots did not decide:" >&2
cat "$root"/tmp/[12].log >&2
exit 1
