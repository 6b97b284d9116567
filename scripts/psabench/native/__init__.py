"""libpsabench and libpsabench-nav through ctypes."""
