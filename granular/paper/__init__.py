"""The figures of Müller & Pöschel, Phys. Rev. E 83, 041304 (2011), and some the paper does not have.
May be skipped: figures of the paper, beside the engines.

>>> from granular import paper
>>> sorted(paper.FIGURES)[:3]
['breakdown', 'counts', 'forces']

Each figure is two functions: one computes its data with the public API, one draws them. `make` writes both.
"""

from granular.paper.figures import FIGURES, PaperFigure, make

__all__ = ["FIGURES", "PaperFigure", "make"]
