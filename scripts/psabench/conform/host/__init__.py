"""The host suite: good and bad boards are played to somebody's program, and what it tells is judged."""
