"""A contact that nobody disturbs is one event.
May be skipped: names of the package only.
"""
