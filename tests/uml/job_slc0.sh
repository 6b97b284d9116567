#!/bin/sh
# The end-to-end suite over slc0: the kernel's own slcan line discipline on the emulator's pseudo-terminal. Arguments go to pytest.
slcand -o -c -s8 -F "$PSA_SERIAL" slc0 & # s8: 1 Mbit/s
for _ in 1 2 3 4 5 6 7 8 9 10; do [ -e /sys/class/net/slc0 ] && break; sleep 0.2; done
ip link set slc0 txqueuelen 1000 up || { echo "slc0: slcand made no interface on $PSA_SERIAL" >&2; exit 125; }
python -m pytest tests/e2e -m "slc0 and not soak" "$@"
rc=$?
kill $!
exit $rc
