#!/usr/bin/env bash
# Draws the pictures of README and manual on the emulator, with the programs of a release build.
# Needs chromium and rsvg-convert (Debian: chromium, librsvg2-bin).
set -euo pipefail
cd "$(dirname "$0")/../.."
programs=${I2RIS_PROGRAMS:-$PWD/target/release}
export PATH="$programs:$PATH" I2RIS_DOMAIN=manual-pictures
images=$PWD/tools/manual/src/images
mkdir -p "$images"
work=$(mktemp -d)
trap 'kill $(jobs -p) 2>/dev/null; wait; rm -rf "$work"' EXIT

i2ris start --snake config/snakes/steel.toml --no-monitor --folder "$work" > "$work/start.log" 2>&1 &
until grep -q '^ready:' "$work/start.log"; do
  kill -0 $! || { cat "$work/start.log"; exit 1; }
  sleep 0.2
done
i2ris calibrate collect --home --duration-s 100 --output "$work/first.csv"
i2ris calibrate fit "$work/first.csv" --family force-balance \
  --output "$work/first.json" --report "$work/first.html"
# The first figure of the report whose title names the loops.
python3 - "$work/first.html" > "$work/loop.svg" <<'PYTHON'
import re, sys
page = open(sys.argv[1]).read()
figures = re.findall(r"<svg.*?</svg>", page, re.S)
loops = [figure for figure in figures if re.search(r"loop", figure[:2000], re.I)]
style = "".join(re.findall(r"<style>(.*?)</style>", page, re.S))
figure = (loops or figures)[0]
if "xmlns" not in figure[:400]:
    figure = figure.replace("<svg", '<svg xmlns="http://www.w3.org/2000/svg"', 1)
print(re.sub(r"(<svg[^>]*>)", lambda m: m.group(1) + "<style>" + style + "</style>", figure, count=1))
PYTHON
rsvg-convert --width 900 --background-color white "$work/loop.svg" --output "$images/hysteresis-loop.png"

i2ris model use "$work/first.json"
i2ris command circle --radius-deg 10 --period-s 20 --duration-s 40 > "$work/circle.log" 2>&1 &
i2ris status --web 8799 > "$work/monitor.log" 2>&1 &
sleep 14
python3 tools/manual/screenshot.py http://127.0.0.1:8799/?theme=dark 1280 900 "$images/monitor.png"
i2ris disable
