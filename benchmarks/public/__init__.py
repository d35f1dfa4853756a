"""Public benchmarks: published numbers with whole inputs, beside those of this program.

A module is one benchmark. Its docstring states the problem whole, in Markdown. It has a NAME, a
SOURCE where the numbers can be looked up, and a function `rows()`, which computes.
"""
