"""What all rooms use, without physics of its own.
May be skipped: names of the package only.
"""
