"""Files of saved runs with other words or arrays."""

from tests.helpers import edited_files

ENGINE = {"hard": {"engine": "sorted"}, "soft": {"engine": "plain"}}
DYING = "The file was edited after it was saved"


def rewritten(files, tmp_path, name="hard_floor", *, signed=True, **changes):
    """A file with other words (by name) or arrays (by `state__u`)."""
    words, arrays = edited_files.stored(files / f"{name}.npz")
    for key, value in changes.items():
        where = words if key in words else arrays
        where[key.replace("__", ".")] = value
    path = tmp_path / "edited.npz"
    path.write_bytes(edited_files.packed(words, {key: x for key, x in arrays.items() if x is not None}, signed))
    return path
