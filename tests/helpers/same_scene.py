"""Whether two scenes are equal bit for bit."""

from granular.scene import Scene


def assert_same_scene(a: Scene, b: Scene) -> None:
    for name in ("mass", "radius", "gap", "velocity"):
        assert getattr(a, name).tobytes() == getattr(b, name).tobytes(), name
    assert (a.gravity, a.origin) == (b.gravity, b.origin)
