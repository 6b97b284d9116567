"""Conformance: what a board and its host must do, and the tests of it.

requirements.py reads proto/requirements*.yaml; proof.py ties a test to the requirements that it proves.
"""
