"""Isolated contacts: a contact without disturbance is solved as one event.

Main line: `meet`.
A first reader may skip: `inside`, `maps`, `tables`.
"""
