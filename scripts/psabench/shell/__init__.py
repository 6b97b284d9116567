"""The shell of the bench: `psabench shell`, `psabench run script`.

A line is `object.verb value... name=value...`: words, not Python, so that the table of commands that the emulator runs
(name, arguments with unit and range, one sentence) is all the grammar there is. Pure and tested without a bench: words,
units, vocabulary, grammar, complete, fields, registers, render, expect, transcript. With a bench: session, own. At the
rim: terminal (prompt_toolkit), script (files, pipes).
"""
