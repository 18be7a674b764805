"""Export of a scene and its force laws as an input deck of LAMMPS.

The deck follows the manual of LAMMPS (pair_style granular, fix wall/gran). It was tested with the release of 22 July
2025.
"""

from __future__ import annotations

import math
from os import PathLike
from typing import Any

from granular._engine import check, signature
from granular._engine.files import write_text
from granular.laws.contact_law import PairLaw, instance, resolve
from granular.laws.dashpot import restitution_pulling
from granular.scene import Scene, checked

__all__ = ["lammps"]
__dir__ = __all__.copy
DECK_HEADER = """\
# Written by granular. SI units; the line of balls is the x axis, upwards is +x. No friction.
# Run: lmp -in THIS_FILE, with -var dt 1e-8 -var steps 1000000 for other numbers than the two below.
#
# Conventions of the two programs, and their conversion in this file:
#   clipping   Contact forces of granular are never attractive: limit_damping does the same, for pairs and walls.
#              Without it, damped balls separate more slowly.
#   k          hooke takes k in N/m unchanged; hertz takes k/sqrt(R_eff) in Pa.
#   damping    velocity takes gamma in kg/s unchanged; viscoelastic takes gamma/(sqrt(R_eff) m_eff) in 1/(m s);
#              coeff_restitution takes exp(-pi zeta/sqrt(1 - zeta^2)), the restitution of a contact without clipping.
#              With zeta = alpha/sqrt(5), the clipped contact then has the restitution of granular.
#   mass       m_eff = m_i m_j/(m_i + m_j), at a wall the mass of the ball, and R_eff likewise, in both programs.
#   state      LAMMPS stores positions and takes fixed steps, and its forces use velocities half a step old. granular
#              stores gaps and locates the onset and the end of every contact. The difference vanishes with dt.
"""


@signature.face
def lammps(
    scene: Scene, law: Any, path: str | PathLike[str] | None = None, *, t_end: float = 1.0, dt: float = 1e-7
) -> str:
    """Return an input deck with which LAMMPS simulates the scene.

    The contact forces are the same as in `granular.md.simulate`, and are clipped at 0 in the same way. LAMMPS writes
    the number, x and v_x of every ball to files in its working directory: at about a hundred times to ``balls.txt``,
    and at the end to ``last.txt``.

    Parameters
    ----------
    scene : Scene
        Balls of positive radius, walls at rest, and gravity.
    law : force law, or one per pair
        F = k ξ + γ ξ̇, or F = k ξ^(3/2) + D. The damping D is 0, γ √ξ ξ̇, or α √(m_eff k) ξ^¼ ξ̇ with α < √5.
    path : path, optional
        File to which the deck is also written, atomically. By default no file is written.
    t_end : float
        End time in s, rounded to a multiple of `dt`. Defaults to 1.
    dt : float
        Time step in s. Defaults to 1e-7. A hundredth of the shortest contact duration gives about two digits.

    Returns
    -------
    str
        The input deck.

    Raises
    ------
    ValueError
        If LAMMPS cannot represent the scene or the law. This includes rings, pendula, external forces, moving or
        thermal walls, point particles, and all other laws.
    OSError
        If the file cannot be written.

    Notes
    -----
    Every ball has its own atom type, so that each pair can have its own law.
    """
    _check_scene(checked(scene))
    laws = [resolve(instance("law", law_of_pair), pair)
            for law_of_pair, pair in zip(check.per_pair("law", law, scene.n_pairs), scene.pairs, strict=True)]
    step = check.number("dt", dt, above=0.0)
    end = check.number("t_end", t_end, above=0.0)
    steps = max(1, round(check.number("`t_end / dt`", end / step, at_most=1e15)))
    text = "\n".join([DECK_HEADER, f"variable dt index {step!r}", f"variable steps index {steps}",
                      *_ball_lines(scene), *_force_lines(scene, laws), *_run_lines(scene), ""])
    if path is not None:
        write_text(path, text)
    return text


def _check_scene(scene: Scene) -> None:
    """Raise `ValueError` for a scene that the input deck cannot represent."""
    walls = scene.is_wall
    unsupported = {
        "a ring": scene.ring, "pendula": scene.pendulum > 0.0, "external_force": scene.external_force is not None,
        "a wall that is shaken": scene.driven, "a thermal wall": scene.heated,
        "a wall that moves": (scene.velocity[walls] != 0.0).any(),
        "a ball of radius 0": (scene.radius[~walls] == 0.0).any(),
    }
    check.raise_if_true({
        f"`scene` must have only balls with radii, walls at rest and gravity for LAMMPS, got {what}.": holds
        for what, holds in unsupported.items()
    })


def _ball_lines(scene: Scene) -> list[str]:
    """Return the lines of the input deck for the box and the balls."""
    x, radius, largest = scene.position.tolist(), scene.radius.tolist(), float(scene.radius.max())
    low, high = x[0] - radius[0], x[-1] + radius[-1]
    balls = (~scene.is_wall).nonzero()[0].tolist()
    lines = ["units si", "atom_style sphere", "boundary s f f", "newton off", "comm_modify vel yes",
             f"neighbor {largest!r} nsq", "neigh_modify every 1 delay 0 check yes",
             f"region box block {low - largest!r} {high + largest!r}" + 2 * f" {-4.0 * largest!r} {4.0 * largest!r}",
             f"create_box {len(balls)} box"]
    for number, i in enumerate(balls, 1):
        lines += [f"create_atoms {number} single {x[i]!r} 0.0 0.0",
                  f"set atom {number} diameter {2.0 * radius[i]!r} mass {scene.mass.item(i)!r} "
                  f"vx {scene.velocity.item(i)!r}"]
    return lines


def _force_lines(scene: Scene, laws: list[PairLaw]) -> list[str]:
    """Return the lines of the input deck for the contact forces of all pairs.

    LAMMPS also needs coefficients for balls that are not neighbours. Their values have no effect.
    """
    x, floor = scene.position.tolist(), int(scene.is_wall[0])
    descriptions = [f"{_lammps_law(law)} tangential linear_nohistory 0.0 0.0 limit_damping" for law in laws]
    lines = ["pair_style granular", f"pair_coeff * * {descriptions[0]}"]
    for c, description in enumerate(descriptions):
        if scene.is_wall[c : c + 2].any():
            plane = f"{x[0]!r} NULL" if scene.is_wall[c] else f"NULL {x[-1]!r}"
            lines.append(f"fix wall{c} all wall/gran granular {description} xplane {plane}")
        else:
            lines.append(f"pair_coeff {c + 1 - floor} {c + 2 - floor} {description}")
    return lines


def _lammps_law(law: PairLaw) -> str:
    """Return the force law of a pair in the syntax of LAMMPS.

    Raises `ValueError` for laws that do not exist in LAMMPS.
    """
    k, p, gamma, d = law.form or (0.0, 0.0, 0.0, 0.0)
    root, m_eff = math.sqrt(law.pair.r_eff), law.pair.m_eff
    if p == 1.0 and d == 0.0:
        return f"hooke {k!r} {gamma!r} damping velocity"
    if p == 1.5 and gamma == 0.0:
        return f"hertz {k / root!r} 0.0 damping velocity"
    if p == 1.5 and d == 0.5:
        return f"hertz {k / root!r} {gamma / (root * m_eff)!r} damping viscoelastic"
    if p == 1.5 and d == 0.25 and (restitution := restitution_pulling(gamma / math.sqrt(5.0 * m_eff * k))):
        return f"hertz {k / root!r} {restitution!r} damping coeff_restitution"
    raise ValueError(f"The law of pair {law.pair.name} must exist in LAMMPS, got {law.law!r}. Use F = k ξ + γ ξ̇, or "
                     "F = k ξ^(3/2) + D with D = 0, γ √ξ ξ̇ or α √(m_eff k) ξ^¼ ξ̇ (α < √5).")


def _run_lines(scene: Scene) -> list[str]:
    """Return the lines of the input deck for gravity, integration and output."""
    columns, digits = "id x vx", "sort id format float %.17g"
    return [*([f"fix pull all gravity {scene.gravity!r} vector -1 0 0"] if scene.gravity else []),
            "fix move all nve/sphere", "timestep ${dt}", "variable every equal ceil(v_steps/100)",
            f"dump rows all custom ${{every}} balls.txt {columns}", f"dump_modify rows {digits}", "run ${steps}",
            f"write_dump all custom last.txt {columns} modify {digits}"]
