"""Numbers for other programs: tables, and files that others read.
May be skipped: files, no physics.
"""
