"""`psabench panel`: a local web page for a bench.

A thin face: the bench is a `shell.Session`, so the page says the lines that a person would type, and shows what came.
One thread has the bench (`worker`), one serves pages (`server`); `guard` decides who may talk to it at all.
"""
