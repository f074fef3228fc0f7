#!/usr/bin/env bash
# A stopwatch over the first hour and the second day: the commands of "In short" of the manual, from a
# fresh folder to a circle that the emulated snake follows by a calibration of its own, and then those
# of "The second day" after everything was stopped. Prints commands and times, without the build.
# Options after the script's name go to `i2ris calibrate` on the first day.
set -euo pipefail
root=$(cd "$(dirname "$0")/../.." && pwd)
programs=${I2RIS_PROGRAMS:-$root/target/release}
export PATH="$programs:$PATH" I2RIS_DOMAIN=stopwatch-$$
chapter=$root/tools/manual/src/first-hour.md
commands_of() { sed -n "/^## $1/,/^## /p" "$chapter" | sed -n '/^```sh/,/^```/p' | grep '^i2ris '; }
mapfile -t first < <(commands_of 'In short')
mapfile -t second < <(commands_of 'The second day')
build=$(sed -n '/^## Build/,/^## /p' "$chapter" | grep -cE '^(cargo|export) ')
work=$(mktemp -d)
cd "$work"
trap 'kill $(jobs -p) 2>/dev/null; wait; rm -rf "$work"' EXIT

# Starts the robot in the background, and steers from here.
day() {
  local start=$1 calibrate=$2
  shift 2
  began=$(date +%s)
  echo "\$ $start    (terminal 1)"
  : > start.log
  $start --no-monitor > start.log 2>&1 &
  until grep -q '^ready:' start.log; do
    kill -0 $! || { cat start.log; exit 1; }
    sleep 0.2
  done
  echo "\$ $calibrate    (terminal 2; --home answers its question)"
  $calibrate --home "$@"
  seconds=$(($(date +%s) - began))
}

day "${first[@]}" "$@"
typed=$((build + ${#first[@]}))
echo
echo "commands typed: $typed ($build for the build, ${#first[@]} after it; target 6)"
echo "minutes without the build: $(awk "BEGIN { printf \"%.1f\", $seconds / 60 }") (target 15)"
kill $!
wait $! || true
echo
day "${second[@]}"
echo
echo "second day: ${#second[@]} commands (target 3), $seconds s (target 30)"
