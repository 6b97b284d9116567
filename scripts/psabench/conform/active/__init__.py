"""Tests that ask the board themselves."""
