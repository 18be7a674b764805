"""Nothing public is lost unseen: names, parameters, attributes, columns, results and counters against a stored list.

The list is keyed by public names such as "gr.walls", so that it does not depend on where modules are; modules that
only the reference manual documents have their last name. ``python tests/docs/test_public_names.py`` adds new
names to the list, and keeps names that are lost: remove those by hand.
"""

import dataclasses
import inspect
import json
import re
from importlib import import_module
from pathlib import Path

import granular as gr
from granular.run.trajectory import CONTACT
from granular.studies.sweeps.results import RESULTS

STORED = Path(__file__).parents[1] / "reference" / "public_names.json"
API = Path(__file__).parents[2] / "docs" / "api"


def modules():
    """Public names of modules, such as "gr.walls", and the modules; "gr" is the package."""
    public = {f"gr.{name}": getattr(gr, name) for name in gr.__all__}
    return {"gr": gr} | {name: thing for name, thing in public.items() if inspect.ismodule(thing)}


def documented():
    """Modules of the reference manual that are not public by a name of their own."""
    pages = (page.read_text(encoding="utf-8") for page in sorted(API.glob("*.md")))
    found = [import_module(name) for page in pages for name in re.findall(r"automodule:: (\S+)", page)]
    assert len(found) > 30
    return {module.__name__.rpartition(".")[2]: module for module in found if module not in modules().values()}


def names(module):
    """Names of a module: its ``__all__``, or those defined in it."""
    listed = getattr(module, "__all__", None)
    defined = (name for name, thing in vars(module).items() if getattr(thing, "__module__", "") == module.__name__)
    return sorted(listed or (name for name in defined if not name.startswith("_")))


def inside(thing):
    """Parameters of a function; fields, methods and properties of a class."""
    if inspect.isclass(thing):
        fields = [field.name for field in dataclasses.fields(thing)] if dataclasses.is_dataclass(thing) else []
        return sorted({name for name in [*fields, *dir(thing)] if not name.startswith("_")})
    return list(inspect.signature(thing).parameters) if inspect.isfunction(thing) else []


def runs():
    """One run of every engine."""
    scene, law, rule = gr.scenes.three_balls(), gr.LinearDashpot(1e3, 0.1), gr.ConstantRestitution(0.5)
    yield "edmd", gr.edmd.simulate(scene, rule, t_end=0.4, engine="sorted")
    yield "edmd, merge", gr.edmd.simulate(scene, rule, t_end=0.4, engine="sorted", collapse="merge")
    yield "edmd, collapse", gr.edmd.simulate(scene, rule, engine="sorted")
    yield "edmd, watched", gr.edmd.simulate(scene, rule, t_end=0.4, engine="sorted", watch=law)
    yield "md located", gr.md.simulate(scene, law, t_end=0.4, engine="plain")
    yield "md located, own law", gr.md.simulate(scene, gr.WaltonBraun(1e6, 2e6), t_end=0.4, engine="plain")
    for method in ("verlet", "symplectic-euler", "rk4", "gear5"):
        yield f"md {method}", gr.md.simulate(scene, law, t_end=0.4, method=method, dt=1e-4, engine="plain")


def current():
    """Everything public, as it is now; one text each."""
    found = {"contact log": list(CONTACT.names), "status": [status.name for status in gr.Status],
             "results of a sweep": sorted(RESULTS)}
    for title, module in (modules() | documented()).items():
        found[title] = names(module)
        found |= {f"{title}.{name}": inner for name in found[title] if (inner := inside(getattr(module, name)))}
    found |= {f"stats of {title}": sorted(run.stats) for title, run in runs()}
    compared = gr.compare(gr.scenes.three_balls(), gr.LinearDashpot(1e6, 10.0), t_end=0.4, engine="plain").to_dict()
    found |= {"report": sorted(compared), "report per pair": sorted(compared["pairs"][0])}
    return found


def test_nothing_public_is_lost_or_unlisted():
    stored, now = json.loads(STORED.read_text(encoding="utf-8")), current()
    lost = {key: [x for x in inner if x not in now.get(key, [])] for key, inner in stored.items()}
    new = {key: [x for x in inner if x not in stored.get(key, [])] for key, inner in now.items()}
    assert {key: inner for key, inner in lost.items() if inner or key not in now} == {}, "lost"
    assert {key: inner for key, inner in new.items() if inner} == {}, f"not listed yet: python {__file__}"


if __name__ == "__main__":
    kept = json.loads(STORED.read_text(encoding="utf-8"))
    listed = kept | {key: [*inner, *(x for x in kept.get(key, []) if x not in inner)]
                     for key, inner in current().items()}
    lines = [f"{json.dumps(key)}: {json.dumps(inner)}" for key, inner in listed.items()]
    STORED.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")
