"""CAN logs in the formats of other tools, and the live view: the same channels in a file and on a WebSocket."""
