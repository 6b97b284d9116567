"""Campaigns: a procedure with thousands of virtual instruments, on all cores, kept in the store of results.

A campaign is a list of cases (`cases`), each a series in the store (`store`). `runner` finds the runs that are
not there yet, has workers (`workers`) compute them by a chain (`chains`), and stores each part as it comes; `claims`
and `page` read the store.
"""
