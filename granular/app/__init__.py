"""The `granular` command and the teaching page.

A first reader may skip: `cli/`, `page/`.
"""
