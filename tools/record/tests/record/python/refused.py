import sys
from pathlib import Path
from i2ris.lerobot import DatasetError, plan
try:
    found = plan(Path(sys.argv[1]), 30, sys.argv[3] == "without")
    printed = f"{len(found.episodes)} episodes"
except DatasetError as error:
    printed = str(error)
assert sys.argv[2] in printed, printed
