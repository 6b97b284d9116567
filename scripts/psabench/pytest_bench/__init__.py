"""A bench for pytest: the fixture `bench`, the marker `scenario`, and what is kept of a test that fails."""
