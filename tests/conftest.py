"""For all tests: Ctrl-C reaches the programs that tests start.

A runner in the background (`make test &` in a script, many CI runners) starts us with SIGINT ignored; programs would
inherit that, and the tests that press Ctrl-C would wait for ever.
"""

import signal

signal.signal(signal.SIGINT, signal.default_int_handler)
