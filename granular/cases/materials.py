"""Materials: Young's modulus, Poisson's ratio and density of what balls are made of, and how far these are known.

>>> import granular as gr
>>> pair = gr.Pair(m_eff=0.01, r_eff=0.005, index=0)
>>> law = gr.TsujiHertz.from_material(*gr.materials.steel, restitution=0.9, pair=pair)
>>> unlike = gr.Hertz.from_material(*gr.materials.both("steel", "glass"), pair=pair)      # lower, upper

In files ``material = "steel"``, or ``["steel", "glass"]``, stands in [law] for ``young`` and ``poisson``; the command
takes ``--material steel --law TsujiHertz`` in place of a stiffness.

**The numbers are those of a kind, not of your ball.** Source of the ranges: the tables of moduli, Poisson's ratios and
densities of J. M. Gere, *Mechanics of Materials* (appendix H), each number one inside its range, that of the commonest
sort. E of metals is good to a few per cent, of glass to a fifth; of nylon and rubber it also depends on rate,
temperature and (nylon) moisture, so that a static value is too low for an impact. What a ball *returns* is in no such
table: ε depends on speed and size and has to be measured; for some whole balls see `granular.balls`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from granular._engine import check

__all__ = ["MATERIALS", "Material", "aluminium", "both", "brass", "glass", "named", "nylon", "rubber", "steel"]
__dir__ = __all__.copy


@check.face
@dataclass(frozen=True)
class Material:
    """What a body is made of; it unpacks to (young, poisson), which a law's `from_material` begins with.

    Parameters
    ----------
    young : float
        Young's modulus in Pa.
    poisson : float
        Poisson's ratio in [0, 0.5].
    density : float
        In kg/m³.
    young_range : (float, float)
        Least and largest Young's modulus of its kind in Pa.
    """

    young: float
    poisson: float
    density: float
    young_range: tuple[float, float]

    def __post_init__(self) -> None:
        check.number("poisson", self.poisson, at_least=0.0, at_most=0.5)
        for name in ("young", "density"):
            check.number(name, getattr(self, name), above=0.0)

    def __iter__(self) -> Iterator[float]:
        return iter((self.young, self.poisson))


steel = Material(200e9, 0.29, 7850.0, (190e9, 210e9))
"""Carbon steel; bearing balls (AISI 52100) have 205 to 210 GPa, stainless ones 193 GPa."""
glass = Material(70e9, 0.22, 2500.0, (48e9, 83e9))
"""Soda-lime glass; ν from 0.17 to 0.27, lead glass is softer and denser."""
brass = Material(100e9, 0.34, 8500.0, (96e9, 110e9))
"""From 60 to 80 % copper."""
aluminium = Material(70e9, 0.33, 2700.0, (70e9, 79e9))
"""Alloys; those with copper and zinc have 72 to 73 GPa."""
nylon = Material(2.8e9, 0.40, 1100.0, (2.1e9, 3.4e9))
"""Dry nylon 6-6 at room temperature; moist and warm less than half of it."""
rubber = Material(2e6, 0.48, 1100.0, (0.7e6, 4e6))
"""Soft rubber, slowly strained; hard sorts have up to 100 MPa. ν is so close to 1/2 that more digits mean nothing."""
MATERIALS = {"steel": steel, "glass": glass, "brass": brass, "aluminium": aluminium, "nylon": nylon, "rubber": rubber}
"""Materials by name."""


@check.face
def named(material: str | Material) -> Material:
    """Return a material of `MATERIALS` by its name, or the material itself."""
    return material if isinstance(material, Material) else MATERIALS[
        check.choice("material", material, list(MATERIALS))]


@check.face
def both(lower: str | Material, upper: str | Material) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return (young, poisson) of the contact of two materials, each (lower, upper), for a law's `from_material`."""
    one, two = named(lower), named(upper)
    return (one.young, two.young), (one.poisson, two.poisson)
