"""Recordings in place of a bench: logs of the CAN bus, lines of a board; opened in a thread, moved by the page."""
