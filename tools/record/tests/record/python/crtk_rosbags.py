import sys
from pathlib import Path
from rosbags.highlevel import AnyReader
seen = {}
with AnyReader([Path(sys.argv[1])]) as reader:
    for connection, stamp, raw in reader.messages():
        message = reader.deserialize(raw, connection.msgtype)
        seen.setdefault(connection.topic, []).append(message)
