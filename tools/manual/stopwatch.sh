#!/usr/bin/env bash
# A stopwatch over the first hour: the commands of "In short" of the manual, from a fresh folder
# to a circle that the emulated snake follows by a calibration of its own. Prints commands and minutes,
# without the build. Options after the script's name go to `i2ris calibrate`.
set -euo pipefail
root=$(cd "$(dirname "$0")/../.." && pwd)
programs=${I2RIS_PROGRAMS:-$root/target/release}
export PATH="$programs:$PATH" I2RIS_DOMAIN=stopwatch-$$
mapfile -t commands < <(sed -n '/^## In short/,/^## /p' "$root/tools/manual/src/first-hour.md" |
  sed -n '/^```sh/,/^```/p' | grep '^i2ris ')
build=$(sed -n '/^## Build/,/^## /p' "$root/tools/manual/src/first-hour.md" | grep -cE '^(cargo|export) ')
work=$(mktemp -d)
cd "$work"
trap 'kill $(jobs -p) 2>/dev/null; wait; rm -rf "$work"' EXIT

began=$(date +%s)
echo "\$ ${commands[0]}    (terminal 1)"
touch start.log
${commands[0]} --no-monitor > start.log 2>&1 &
until grep -q '^ready:' start.log; do
  kill -0 $! || { cat start.log; exit 1; }
  sleep 0.2
done
echo "\$ ${commands[1]}    (terminal 2; --home answers its question)"
${commands[1]} --home "$@"
ended=$(date +%s)
typed=$((build + ${#commands[@]}))
echo
echo "commands typed: $typed ($build for the build, ${#commands[@]} after it; target 6)"
echo "minutes without the build: $(awk "BEGIN { printf \"%.1f\", ($ended - $began) / 60 }") (target 15)"
