"""The host suite: good and bad boards are simulated for a program, and what it reports is checked."""
