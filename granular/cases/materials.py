"""Materials: Young's modulus, Poisson's ratio and density, with their ranges.

>>> import granular as gr
>>> pair = gr.Pair(m_eff=0.01, r_eff=0.005, index=0)
>>> law = gr.TsujiHertz.from_material(*gr.materials.steel, restitution=0.9, pair=pair)
>>> unlike = gr.Hertz.from_material(*gr.materials.both("steel", "glass"), pair=pair)      # lower, upper

In files ``material = "steel"``, or ``["steel", "glass"]``, replaces ``young`` and ``poisson`` in [law]. The command
takes ``--material steel --law TsujiHertz`` instead of a stiffness.

**The numbers describe a kind of material, not your ball.** Source of the ranges: the tables of moduli, Poisson's ratios
and densities of J. M. Gere, *Mechanics of Materials* (appendix H). Each number lies inside its range and belongs to the
commonest sort. Young's moduli of metals are accurate to a few per cent, of glass to a fifth. Young's moduli of nylon
and rubber also depend on rate, temperature and (nylon) moisture, so that a static value is too low for an impact. Such
tables do not contain ε, which depends on speed and size and has to be measured. For some whole balls see
`granular.balls`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from granular._engine import check, signature

__all__ = ["MATERIALS", "Material", "aluminium", "both", "brass", "glass", "named", "nylon", "rubber", "steel"]
__dir__ = __all__.copy


@signature.face
@dataclass(frozen=True)
class Material:
    """Material of a body. It unpacks to (young, poisson) for `from_material` of laws.

    Parameters
    ----------
    young : float
        Young's modulus in Pa.
    poisson : float
        Poisson's ratio in [0, 0.5].
    density : float
        Density in kg/m³.
    young_range : (float, float)
        Smallest and largest Young's modulus in Pa of this kind of material.
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
"""Carbon steel. Bearing balls (AISI 52100) have 205 to 210 GPa, stainless 193 GPa."""
glass = Material(70e9, 0.22, 2500.0, (48e9, 83e9))
"""Soda-lime glass, with ν from 0.17 to 0.27. Lead glass is softer and denser."""
brass = Material(100e9, 0.34, 8500.0, (96e9, 110e9))
"""Brass with 60 to 80 % copper."""
aluminium = Material(70e9, 0.33, 2700.0, (70e9, 79e9))
"""Aluminium alloys. Alloys with copper or zinc have 72 to 73 GPa."""
nylon = Material(2.8e9, 0.40, 1100.0, (2.1e9, 3.4e9))
"""Dry nylon 6-6 at room temperature.

The modulus of moist, warm nylon is less than half of this value.
"""
rubber = Material(2e6, 0.48, 1100.0, (0.7e6, 4e6))
"""Soft rubber under slow strain. Hard sorts have up to 100 MPa.

ν is so close to 1/2 that further digits have no meaning.
"""
MATERIALS = {"steel": steel, "glass": glass, "brass": brass, "aluminium": aluminium, "nylon": nylon, "rubber": rubber}
"""Materials by name."""


@signature.face
def named(material: str | Material) -> Material:
    """Return a material of `MATERIALS` by name. A `Material` is returned unchanged."""
    return material if isinstance(material, Material) else MATERIALS[
        check.choice("material", material, list(MATERIALS))]


@signature.face
def both(lower: str | Material, upper: str | Material) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the Young's moduli and Poisson's ratios for the contact of two materials.

    The result has two items: the moduli in Pa as (lower, upper), and Poisson's ratios as (lower, upper). This is the
    form that `from_material` of laws accepts.
    """
    lower_material, upper_material = named(lower), named(upper)
    return (lower_material.young, upper_material.young), (lower_material.poisson, upper_material.poisson)
