"""The `granular` command and the teaching page.

Support modules: `cli/`, `page/`.
"""
