"""Isolated contacts: a contact without disturbance is solved as one event.

Start with: `meet`.
Support modules: `inside`, `maps`, `tables`.
"""
