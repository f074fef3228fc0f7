import sys
from i2ris.arm import Arm, OtherInterface
from i2ris.payload import INTERFACE_VERSION

try:
    with Arm(sys.argv[1]):
        pass
    raise AssertionError('it speaks another version')
except OtherInterface as error:
    both = 'interface version 99, this package %d: use the same release for both'
    assert both % INTERFACE_VERSION in str(error), error
from i2ris.link import Link
try:
    Link.check_iceoryx2('0.9.1')
    raise AssertionError('another wheel')
except OtherInterface as error:
    assert str(error) == 'iceoryx2 0.9.1 is installed, but interface version %d needs ' \
        'iceoryx2 0.10.0: pip install iceoryx2==0.10.0' % INTERFACE_VERSION, error
