"""Numerical stability where it hurts: what was tried, what is guaranteed, and what happened.

A `Case` says how a guarantee is checked, and how it is broken on purpose: a check that such a fault passes is none.
`exact` is the core's method in exact fractions; every other file has the cases of one part of the project.
"""
