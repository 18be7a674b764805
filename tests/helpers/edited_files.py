"""Files of saved runs, edited at random in every way in which a file may be wrong; and what became of each."""

import copy
import io
import json
import warnings
import zipfile

import numpy as np

import granular as gr
from granular.run import saved_run
from tests.helpers import saved_scenes

PLAIN = {"hard": {"engine": "sorted", "max_events": 400},
         "soft": {"engine": "plain", "max_events": 400, "max_steps": 900}}
VALUES = [0, 1, -1, 2, 1e308, -1e-308, 10**400, 1.5, True, None, "", "x", "\x1b[31m\u202e", [], [1.0], {},
          {"class": "x"}]
NUMBERS = [np.nan, np.inf, -np.inf, 0.0, -1.0, 1e300, -1e300, 1e-300, 2**31, -(2**31), 2**62, 1, -2, 7, 1000]


def stored(path):
    """Words and arrays of a file."""
    with np.load(path) as file:
        arrays = {name: file[name] for name in file.files}
    return json.loads(str(arrays.pop("words"))), arrays


def packed(words, arrays, signed):
    """The bytes of a file, with the digest that belongs to it if it is to be `signed`."""
    if signed and isinstance(words, dict) and words.get("format") == 3:
        words = words | {"digest": saved_run.digest_of(words, arrays)}
    out = io.BytesIO()
    np.savez_compressed(out, words=np.array(json.dumps(words)), **arrays)
    return out.getvalue()


def flipped(rng, whole):
    """Some bytes are others."""
    data = bytearray(whole)
    for _ in range(int(rng.integers(1, 9))):
        data[int(rng.integers(len(data)))] ^= int(rng.integers(1, 256))
    return bytes(data)


def rebuilt(rng, whole):
    """A member of the archive is there twice, stored otherwise, renamed, or holds other bytes of an array."""
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(whole)) as old, zipfile.ZipFile(out, "w") as new:
        infos = old.infolist()
        chosen, how = int(rng.integers(len(infos))), int(rng.integers(4))
        for i, info in enumerate(infos):
            data, name = old.read(info), info.filename
            if i == chosen and how == 0:
                data = flipped(rng, data[: int(rng.integers(1, len(data) + 1))])
            if i == chosen and how == 1:
                name = "\x1b[2J../" + name
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                for _ in range(1 + (i == chosen and how == 2)):
                    new.writestr(name, data, zipfile.ZIP_BZIP2 if i == chosen and how == 3 else zipfile.ZIP_DEFLATED)
    return out.getvalue()


def paths(value, so_far=()):
    """All places in words."""
    yield so_far
    inner = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, one in inner:
        yield from paths(one, (*so_far, key))


def reworded(rng, words):
    """Another value at some place of the words, one more, or one less."""
    words = copy.deepcopy(words)
    places = list(paths(words))[1:]
    *way, last = places[int(rng.integers(len(places)))]
    inside = words
    for key in way:
        inside = inside[key]
    how = int(rng.integers(4))
    if how == 0:
        del inside[last]
    elif how == 1 and isinstance(inside, dict):
        inside["more"] = VALUES[int(rng.integers(len(VALUES)))]
    elif how == 2 and isinstance(inside[last], (int, float)) and abs(inside[last]) < 1e300:
        inside[last] = float(rng.choice([0.0, -1.0, 1.1, 1e9, np.nan])) * inside[last]
    else:
        inside[last] = VALUES[int(rng.integers(len(VALUES)))]
    return words


def remade(rng, arrays):
    """One array with other entries, of another kind or shape, or missing."""
    name = sorted(arrays)[int(rng.integers(len(arrays)))]
    old, how = arrays[name], int(rng.integers(7))
    if how == 0:
        return {key: value for key, value in arrays.items() if key != name}
    if how == 1:
        return arrays | {name: np.array(["x", "\x1b]0;"]) if rng.random() < 0.5 else np.zeros((3, 3, 3))}
    if how == 2 and old.dtype.names is None and old.dtype.kind in "fib":
        with np.errstate(all="ignore"):
            return arrays | {name: old.astype(rng.choice(["f4", "i4", "i8", "f8", "U9", "?", "c16"]))}
    if how == 3:
        return arrays | {name: np.concatenate([np.ravel(old)] * 2) if rng.random() < 0.5 else np.ravel(old)[:-1]}
    new = old.copy()
    target = new
    if new.dtype.names:
        target = new[rng.choice(new.dtype.names)]
    if target.size == 0 or target.dtype.kind not in "fiub":
        return arrays | {name: np.zeros(3)}
    at = np.unravel_index(int(rng.integers(target.size)), target.shape)
    value = NUMBERS[int(rng.integers(len(NUMBERS)))] if how < 6 else float(target[at]) * (1.0 + rng.normal() * 1e-3)
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        target[at] = np.array(value, dtype=object).astype(float).astype(target.dtype)
    return arrays | {name: new}


def edited(rng, path):
    """The bytes of the file `path` after one to three edits, and what was done."""
    whole = path.read_bytes()
    how = rng.choice(["flip", "cut", "rebuild", "words", "array", "words signed", "array signed"],
                     p=[0.08, 0.04, 0.08, 0.1, 0.1, 0.25, 0.35])
    if how == "flip":
        return how, flipped(rng, whole)
    if how == "cut":
        return how, whole[: int(rng.integers(len(whole)))]
    if how == "rebuild":
        return how, rebuilt(rng, whole)
    words, arrays = stored(path)
    for _ in range(int(rng.integers(1, 4))):
        if how.startswith("words") and isinstance(words, dict) and words:
            words = reworded(rng, words)
        elif arrays:
            arrays = remade(rng, arrays)
    return how, packed(words, arrays, how.endswith("signed"))


def fate(kind, name, data, file, ends):
    """Write `data` into `file`, load it, go on with it: how far it came, and the sentence that refused it.

    Raises what is no sentence of granular's; `ends` holds how the runs end that nobody has edited.
    """
    file.write_bytes(data)
    engine, _, _, _, end, _ = saved_scenes.of(kind, name)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of numbers that are too large, in files that were signed anew
        try:
            back = gr.Trajectory.load(file, **saved_scenes.given(kind, name))
        except (ValueError, TypeError) as error:
            return "refused on load", _sentence(error)
        str(back.message), repr(back), back.first_disturbed
        try:
            run = engine.resume(back, t_end=end, **PLAIN[kind])
        except (ValueError, TypeError) as error:
            return "refused by resume", _sentence(error)
    same = ends.setdefault((kind, name), run) is run or (
        run.gap[-1].tobytes() == ends[kind, name].gap[-1].tobytes()
        and run.velocity[-1].tobytes() == ends[kind, name].velocity[-1].tobytes())
    return "the same run" if same else "another run", ""


def _sentence(error):
    said = str(error)
    assert said, repr(error)
    assert said.isprintable(), ascii(said)
    assert len(said) < 1200, said
    assert type(error) in (ValueError, TypeError) or type(error).__module__.startswith("granular."), repr(error)
    assert said[-1] in ".?)", said
    return said
