# The table equals that of Rust, as another test checks; here its lookup is tested.
from types import SimpleNamespace
from i2ris.operation import progress
from i2ris.reasons import PROGRESS_FLAGS

for command, state, flags, expected in [
    ('enable', 'ENABLED', '', 'done'), ('enable', 'DISABLED', 'busy', 'busy'),
    ('enable', 'FAULT', 'busy', 'broken off'), ('resume', 'PAUSED', '', 'broken off'),
    ('disable', 'DISABLED', 'off', 'done'), ('disable', 'FAULT', 'homed', 'ended'),
    ('home', 'DISABLED', 'homed', 'done'), ('home', 'DISABLED', 'homed broken_off', 'broken off'),
    ('unhome', 'DISABLED', 'homed', 'ended'), ('acknowledge', 'FAULT', '', 'broken off'),
    ('condition', 'ENABLED', 'model', 'ended'), ('condition', 'ENABLED', '', 'done'),
    ('condition', 'ENABLED', 'model memory_known', 'done'), ('move', 'ENABLED', 'model', 'done'),
    ('pause', 'PAUSED', 'at_rest', 'done'), ('hold', 'ENABLED', 'holding', 'busy'),
    ('hold', 'PAUSED', 'holding at_rest', 'done'), ('hold', 'ENABLED', 'at_rest', 'broken off'),
]:
    it = SimpleNamespace(state=state, **{name: name in flags.split() for name in PROGRESS_FLAGS})
    assert progress(command, it) == expected, (command, state, flags)
