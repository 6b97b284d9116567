"""PMKA."""
