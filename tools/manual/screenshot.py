"""Takes a picture of a page that keeps changing: screenshot.py URL WIDTH HEIGHT FILE.png

`chromium --screenshot` resizes the page just before it takes the picture, so that plots are stretched. This
speaks with the browser by a pipe, sets the size first, and waits in real time.
"""
import base64
import json
import os
import subprocess
import sys
import tempfile
import time

url, width, height, file = sys.argv[1:]
theirs_in, ours_out = os.pipe()
ours_in, theirs_out = os.pipe()


def pass_pipes():
    """The browser reads from descriptor 3 and writes to 4; moved out of the way first."""
    source, sink = os.dup2(theirs_in, 13), os.dup2(theirs_out, 14)
    os.dup2(source, 3)
    os.dup2(sink, 4)


folder = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
browser = subprocess.Popen(
    ["chromium", "--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--no-first-run",
     "--disable-background-networking", f"--user-data-dir={folder.name}", "--remote-debugging-pipe"],
    preexec_fn=pass_pipes, close_fds=False, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
os.close(theirs_in)
os.close(theirs_out)
received, number, session = b"", 0, None


def call(method, **parameters):
    """Calls a method of the DevTools protocol and waits for its result."""
    global received, number
    number += 1
    message = {"id": number, "method": method, "params": parameters}
    if session:
        message["sessionId"] = session
    os.write(ours_out, json.dumps(message).encode() + b"\0")
    while True:
        while b"\0" not in received:
            chunk = os.read(ours_in, 1 << 20)
            if not chunk:
                raise SystemExit("chromium ended")
            received += chunk
        first, received = received.split(b"\0", 1)
        answer = json.loads(first)
        if answer.get("id") == number:
            if "error" in answer:
                raise SystemExit(f"{method}: {answer['error']['message']}")
            return answer["result"]


target = call("Target.createTarget", url="about:blank")["targetId"]
session = call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
call("Page.enable")
call("Emulation.setDeviceMetricsOverride", width=int(width), height=int(height), deviceScaleFactor=1, mobile=False)
call("Page.navigate", url=url)
time.sleep(5)
picture = call("Page.captureScreenshot", format="png")["data"]
with open(file, "wb") as png:
    png.write(base64.b64decode(picture))
browser.kill()
browser.wait()
