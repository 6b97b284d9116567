"""LCM: the types of proto/lcm, event logs, and what goes out on LCM channels.

`read_frames(path)` gives the CAN frames of an LCM log as python-can messages, `read_events(path)` all of its events.
The types are read from proto/lcm (`types`), the log format is read and written here (`event_log`): none of it needs
liblcm. Only a network address (udpm://) does (`channel`).
"""
