"""Films of a comparison as files: .gif and .mp4, every picture in them, nothing left where one fails."""

import shutil

import numpy as np
import pytest


@pytest.mark.rotating
def test_a_film(tmp_path, cradle) -> None:
    image = pytest.importorskip("PIL.Image")
    pytest.importorskip("matplotlib")
    cradle.animate(tmp_path / "film.gif", seconds=0.5, fps=10)
    with image.open(tmp_path / "film.gif") as film:
        assert film.n_frames == 5
        first = np.asarray(film.convert("RGB"), int)
        film.seek(3)
        assert np.abs(np.asarray(film.convert("RGB"), int) - first).max() > 100


def test_a_film_for_slides(tmp_path, cradle) -> None:
    pytest.importorskip("matplotlib")
    if shutil.which("ffmpeg") is None:
        pytest.skip("ffmpeg is not installed: no .mp4 is made here")
    cradle.animate(tmp_path / "film.mp4", seconds=0.5, fps=10)
    assert (tmp_path / "film.mp4").read_bytes()[4:8] == b"ftyp"


@pytest.mark.rotating
def test_every_picture_reaches_ffmpeg_and_nothing_is_left_where_it_fails(tmp_path, cradle, monkeypatch) -> None:
    pytest.importorskip("matplotlib")
    stand_in = tmp_path / "ffmpeg"
    stand_in.write_text('#!/bin/sh\nfor last; do :; done\ncat > "$last"\n')
    stand_in.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:/usr/bin:/bin")
    cradle.animate(tmp_path / "film.mp4", seconds=0.5, fps=10)
    pictures = np.frombuffer((tmp_path / "film.mp4").read_bytes(), np.uint8).reshape(5, 540, 960, 4)
    assert all(np.ptp(np.abs(one.astype(int) - pictures[0])) > 100 for one in pictures[1:])
    stand_in.write_text("#!/bin/sh\ncat > /dev/null\necho no such codec >&2\nexit 1\n")
    with pytest.raises(OSError, match="ffmpeg could not write the film: no such codec"):
        cradle.animate(tmp_path / "other.mp4", seconds=0.5, fps=10)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["ffmpeg", "film.mp4"]


def test_films_refuse_what_they_cannot_do(tmp_path, cradle, monkeypatch) -> None:
    with pytest.raises(ValueError, match=r"The suffix of film\.avi must be one of \.gif, \.mp4, got '\.avi'\."):
        cradle.animate(tmp_path / "film.avi")
    with pytest.raises(ValueError, match=r"`seconds` must be a finite number above 0, got 0\."):
        cradle.animate(tmp_path / "film.gif", seconds=0)
    monkeypatch.setenv("PATH", "")
    with pytest.raises(ValueError, match=r"requires ffmpeg, which is not installed\. Use a name that ends in \.gif"):
        cradle.animate(tmp_path / "film.mp4")
