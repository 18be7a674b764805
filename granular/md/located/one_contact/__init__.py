"""Isolated contacts: a contact without disturbance is solved as one event.

Start with: `meet`.
Support modules: `flanks`, `inside`, `maps`, `tables`.
"""
