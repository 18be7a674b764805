"""The teaching page and the player: one HTML file each that needs no network, no server and no framework.

`assemble` puts a file together from the parts shipped beside it and writes it: ``shell`` (frame, style, time bar,
charts), ``physics`` (both engines for linear contacts, event-located, in JavaScript), ``live`` (the teaching page),
``player`` (the page without physics that shows recorded runs). `opening` is what the teaching page opens with,
`recording` makes a recorded run small enough to embed, and says what it was made of.

A first reader may skip: `assemble`, `opening`, `recording`.
"""

from granular.app.page.assemble import live_page, player_page

__all__ = ["live_page", "player_page"]
