#!/bin/sh
# The end-to-end suite over a kernel's vcan0, emulator and host side by side. Arguments go to pytest.
exec python -m pytest tests/e2e -m "vcan and not soak" "$@"
