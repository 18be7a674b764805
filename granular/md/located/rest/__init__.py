"""Piles that come to rest, and how that is proved.
May be skipped: names of the package only.
"""
