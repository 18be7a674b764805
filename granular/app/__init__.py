"""The `granular` command and the teaching page.
May be skipped: names of the package only.
"""
