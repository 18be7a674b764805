"""The teaching page and the player: single HTML files without network access.

`assemble` joins the parts in these subfolders: ``shell`` (frame, style, time bar, charts), ``physics`` (both engines
for linear contacts with event location, in JavaScript), ``live`` (the teaching page), ``player`` (recorded runs).
`opening` has the initial states of the teaching page, `recording` reduces a run to a size that a page can embed.

Support modules: `assemble`, `opening`, `recording`, `renaming` (short names), `script` (tokens).
"""

from granular.app.page.assemble import live_page, player_page

__all__ = ["live_page", "player_page"]
