#!/usr/bin/env bash
# A study on the emulator: ten trials, five scripted operators with and without compensation of the
# hysteresis, each in an order of its own; targets to reach, then one to follow. Writes the study and its report into
# the folder that is named. About ten minutes. `cargo build --release --workspace --examples --bins` makes
# what it needs.
set -euo pipefail
cd "$(dirname "$0")/../.."
study=$(realpath -m "${1:?usage: study.sh FOLDER}")
programs=${I2RIS_PROGRAMS:-$PWD/target/release}
export PATH="$programs:$programs/examples:$PATH" I2RIS_DOMAIN=study-$$ I2RIS_STUDY=$study
work=$(mktemp -d)
trap 'kill $(jobs -p) 2>/dev/null || true; wait; rm -rf "$work"' EXIT

i2ris start --snake config/snakes/steel.toml --no-monitor --folder "$work" > "$work/start.log" 2>&1 &
until grep -q '^ready:' "$work/start.log"; do
  kill -0 $! || { cat "$work/start.log"; exit 1; }
  sleep 0.2
done

# One recording, two models: with and without memory.
i2ris calibrate collect --home --duration-s 60 --output "$work/first.csv"
i2ris calibrate fit "$work/first.csv" --family linear --output "$work/without.json"
i2ris calibrate fit "$work/first.csv" --family force-balance --output "$work/with.json"

mkfifo "$work/hand"
# A stick that is never off its centre needs no dead zone; a person pushes through it.
sed 's/^name/dead_zone = 0.02\nname/' config/devices/xbox.toml > "$work/hand.toml"
# task PARTICIPANT WORDS...: the task, with the operator at its device.
task() {
  operator "$work/hand" "$1" "$I2RIS_DOMAIN" &
  local operator=$!
  i2ris teleop task "${@:2}" --device "$work/hand" --profile "$work/hand.toml"
  wait "$operator"
}

i2ris record trial new "$study" --condition without,with
mapfile -t orders < <(i2ris record trial list | grep ^participant | sed 's/.*: //; s/,//g')
for participant in 1 2 3 4 5; do
  for condition in ${orders[(participant - 1) % ${#orders[@]}]}; do
    i2ris model use "$work/$condition.json" --enable
    i2ris command state condition
    i2ris record trial start --participant "P0$participant" --condition "$condition" --task reach-and-pursuit
    task "$participant" reach --targets 5 --seed "$participant" --tolerance-deg 0.3 --hold-s 0.8
    i2ris record trial mark pursuit
    task "$participant" pursuit --duration-s 16 --seed "$participant"
    i2ris record trial stop --outcome success
  done
done
i2ris record report "$study"
