#!/bin/sh
# The end-to-end tests over vcan0 that take a minute and more of real time, of the files that are given.
exec python -m pytest -m "vcan and soak" "$@"
