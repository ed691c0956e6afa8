"""The check of a benchmark's data: each finding from the smallest data that show it, then the command."""

import json
import shutil
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import av
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from pipeline.data.clip_facts import CACHE, ClipFacts
from pipeline.data.clip_hash import NearCopy
from pipeline.errors import InputError
from pipeline.records import Box, Kind, TrackBox, TruthHazard
from pipeline.tables import TRUTH
from sitegen.cli import app
from sitegen.data_check import check_data
from sitegen.data_check_run import FILE_NAME, Inputs, alike, inputs_of, stored_check, verbless
from sitegen.data_figures import box_facts, label_figures, text_figures, truth_figures
from sitegen.data_findings import CheckInput, Finding, Severity
from tests.clips import write_clip
from tests.site_fixtures import EVIL, WordEmbedder, make_benchmark

RESULT = CliRunner()


def row(video: str, text: str = "A cat crosses the road", label: str = "Cat", **more: object) -> TruthHazard:
    return replace(TruthHazard(video, "h1", label, text), **more)


def clip(video: str, **more: object) -> ClipFacts:
    made = ClipFacts(
        *(video, f"{video}.mp4", 1_000, 0, f"sha of {video}", True, "", "", "mov,mp4,m4a", "h264"),
        *("yuv420p", 640, 360, 25.0, 100, 100),
    )
    return replace(made, **more)


TRUTH_OF_THREE = (row("v1"), row("v2", "A dog runs along", "Dog"), row("v3", "", ""))
CLIPS_OF_THREE = (clip("v1"), clip("v2"), clip("v3"))


def check(
    truth: Sequence[TruthHazard] = TRUTH_OF_THREE,
    clips: Sequence[ClipFacts] | None = CLIPS_OF_THREE,
    boxes: Sequence[TrackBox] | None = None,
    **more: object,
) -> dict[str, Finding]:
    facts = None if boxes is None else box_facts(boxes)
    found = check_data(CheckInput(truth, facts, clips, **more))
    return {one.kind: one for one in found if one.kind != "labels that occur once"}


def box(video: str, frame: int, track: str, kind: Kind = Kind.CHALLENGE) -> TrackBox:
    return TrackBox(video, frame, track, kind, Box(0, 0, 10, 10))


def test_nothing_is_found_in_good_data() -> None:
    assert check() == {}
    boxes = [box(name, 5, "1", Kind.TRAFFIC) for name in ("v1", "v2", "v3")]
    assert check(boxes=boxes) == {}


CLIP_CASES = {
    "unreadable clip": ({"problem": "the file is empty"}, Severity.ERROR),
    "damaged clip": ({"damage": "2 packets cannot be decoded"}, Severity.WARNING),
    "header counts wrong": ({"claimed_frames": 99}, Severity.WARNING),
    "uneven frame times": ({"is_variable_rate": True}, Severity.WARNING),
    "sound": ({"has_audio": True}, Severity.WARNING),
    "not for browsers": ({"pixel_format": "yuv444p"}, Severity.WARNING),
    "another size": ({"width_px": 320}, Severity.NOTE),
    "another frame rate": ({"fps_hz": 30.0}, Severity.NOTE),
    "private metadata": ({"tags": (("com.apple.quicktime.location.ISO6709", "+1+2/"),)}, Severity.WARNING),
    "truth in metadata": ({"tags": (("title", "the DOGS"),)}, Severity.ERROR),
}


@pytest.mark.parametrize("kind", CLIP_CASES)
def test_what_is_odd_about_a_clip(kind: str) -> None:
    odd, severity = CLIP_CASES[kind]
    found = check(clips=(clip("v1"), clip("v2", **odd), clip("v3")))
    assert list(found) == [kind]
    assert found[kind].severity is severity and found[kind].where == ("v2",) and found[kind].mend


def test_codecs_that_browsers_play() -> None:
    for codec, container, name in (("hevc", "mov,mp4", "v2.mp4"), ("h264", "matroska,webm", "v2.mkv")):
        odd = clip("v2", codec=codec, container=container, file=name)
        assert "not for browsers" in check(clips=(clip("v1"), odd, clip("v3")))
    good = clip("v2", codec="vp9", container="matroska,webm", file="v2.webm")
    assert check(clips=(clip("v1"), good, clip("v3"))) == {}


def test_coverage() -> None:
    found = check(clips=(clip("v1"), clip("v2"), clip("extra")))
    assert found["truth without video"].where == ("v3",)
    assert found["truth without video"].severity is Severity.ERROR
    assert found["video without truth"].where == ("extra",)
    found = check(boxes=[box("v1", 3, "1", Kind.TRAFFIC), box("x", 3, "1")])
    assert found["no boxes"].where == ("v2", "v3") and found["boxes without truth"].where == ("x",)
    assert check(TRUTH_OF_THREE[:2], CLIPS_OF_THREE[:2])["no-hazard share"].severity is Severity.NOTE
    calm = check((row("v1", "", ""), row("v2", "", ""), row("v3")))["no-hazard share"]
    assert calm.severity is Severity.WARNING and "67%" in calm.message


def test_frames_and_tracks() -> None:
    def of(boxes: Sequence[TrackBox], **more: object) -> set[str]:
        full = [*boxes, *(box(name, 5, "t", Kind.TRAFFIC) for name in ("v1", "v2", "v3"))]
        return set(check((row("v1", **more), *TRUTH_OF_THREE[1:]), boxes=full))

    good = [box("v1", 10, "7"), box("v1", 20, "7")]
    assert of(good, track_id="7", first_frame=10, last_frame=99) == set()
    assert of(good, track_id="7", last_frame=100) == {"frames beyond the clip"}
    assert of(good, track_id="7", first_frame=21, last_frame=30) == {"track elsewhere"}
    assert of(good, track_id="8") == {"unknown track", "undescribed hazard track"}
    assert of([], track_id="t") == {"hazard boxed as traffic"}
    assert of([*good, box("v1", 100, "7")], track_id="7") == {"boxes beyond the clip"}


def test_copies() -> None:
    found = check(clips=(clip("v1"), clip("v2", sha256="sha of v1"), clip("v3")))
    assert found["duplicate clips"].where == ("v1", "v2")
    pairs = [NearCopy("v1", "v2", 3.0, 0.2, False), NearCopy("v2", "v3", 1.0, 0.0, True)]
    found = check(pairs=pairs)
    assert found["near-duplicate clips"].where == ("v1", "v2", "v3")
    assert "one mirrored" in found["near-duplicate clips"].message
    found = check(clips=(*CLIPS_OF_THREE, clip("v1", file="v1.webm", sha256="other")))
    assert found["one id, several files"].where == ("v1.mp4", "v1.webm")


WORD_CASES = {
    "short description": ("A dog", "Dog"),
    "long description": (" ".join(["dog"] * 91), "Dog"),
    "same description": ("a cat CROSSES the road.", "Dog"),
    "unseen characters": ("A dog\u200b runs along", "Dog"),
    "broken characters": ("A d\ufffdg runs along", "Dog"),
    "untidy text": ("A dog  runs along", "Dog"),
    "mixed scripts": ("А dog runs along", "Dog"),
    "label spellings": ("Two cats run along", "cats"),
    "no label": ("A dog runs along", ""),
}


@pytest.mark.parametrize("kind", WORD_CASES)
def test_what_is_odd_about_words(kind: str) -> None:
    text, label = WORD_CASES[kind]
    found = check((row("v1"), row("v2", text, label), row("v3", "", "")))
    assert list(found) == [kind]
    assert "v2" in found[kind].where


def test_one_label_that_rules() -> None:
    truth = [row(f"v{n}", f"A {name} runs along", "Cat") for n, name in enumerate("abcd")]
    truth += [row("v8", "A dog runs along", "Dog"), row("v9", "", "")]
    assert check(truth, None)["one label rules"].where == ("v0", "v1", "v2", "v3")


def test_words_of_the_truth_in_names() -> None:
    named = (row("dogs_07", "A dog runs along", "Dog"), row("v1"), row("v2", "", ""))
    found = check(named, None)
    assert found["truth in file names"].where == ("dogs_07",)
    # What every name has is no leak, and neither are stop words and short runs of letters.
    assert check(
        [row(f"road_{n}", f"A {w} on the road", w) for n, w in enumerate(["cat", "dog", "ox"])], None
    )
    usual = [row(f"road_{n}", f"A {w} on the road", w) for n, w in enumerate(["cat", "dog", "ox"])]
    assert "truth in file names" not in check([*usual, row("the_ox", "The ox is here", "Bull")], None)


def test_videos_in_order_of_label() -> None:
    def of(labels: str) -> set[str]:
        rows = [
            row(f"v{n:02}", f"A {n} {label} runs along" if label != "-" else "", label.replace("-", ""))
            for n, label in enumerate(labels)
        ]
        return {one.kind for one in check_data(CheckInput(rows))}

    assert "videos in order of label" in of("aaaaaabbbbbb----")
    assert "videos in order of label" not in of("ab-ab-ababab--ab")
    assert "videos in order of label" not in of("aabb")


@given(st.lists(st.text(max_size=40), max_size=6))
def test_no_text_is_too_strange(texts: list[str]) -> None:
    rows = [row(f"v{n}", text, text[:9]) for n, text in enumerate(texts)]
    found = check_data(CheckInput(rows, {}, []))
    assert found == check_data(CheckInput(rows[::-1], {}, [])) or len(set(texts)) < len(texts)


def test_figures_by_hand() -> None:
    figures = truth_figures([*TRUTH_OF_THREE, row("v1", "A cat's bag", "cat", hazard_id="h2", track_id="1")])
    assert (figures.videos, figures.hazards, figures.no_hazard_videos) == (3, 3, 1)
    assert (figures.several_hazards, figures.with_track, figures.with_frames) == (1, 1, 0)
    assert figures.labels.counts == (("cat", 2), ("dog", 1)) and figures.labels.singletons == 1
    assert figures.labels.entropy_bits == pytest.approx(0.9182958)
    text = text_figures(["A cat sits", "a CAT sits there now"])
    assert (text.lengths, text.mean_words, text.median_words) == (((3, 1), (5, 1)), 4.0, 4.0)
    assert (text.tokens, text.vocabulary, text.type_token_ratio) == (8, 5, 0.625)
    assert text.common == (("cat", 2), ("sits", 2), ("now", 1))
    assert label_figures([]).counts == () and label_figures(["a", "a"]).evenness == 0
    assert label_figures(["a", "b", "c", "d"]).entropy_bits == 2.0


def test_what_models_see() -> None:
    near = [row("v1", "a cat on the wet road by the old bridge at night in the cold rain")]
    near += [row("v2", near[0].description + " rain"), row("v3", "dogs everywhere today")]
    assert [(first, second) for first, second, _ in alike(near, WordEmbedder())] == [("v1", "v2")]
    assert [one.video_id for one in verbless([row("v1"), row("v2", "A black cat")])] == ["v2"]


def test_a_kept_result_knows_its_data(tmp_path: Path) -> None:
    benchmark = make_benchmark(tmp_path / "b", 1)
    inputs = inputs_of(TRUTH.read(benchmark.truth), benchmark.boxes, {"v1": "1" * 64, "other": "2" * 64})
    assert inputs == inputs_of(TRUTH.read(benchmark.truth), benchmark.boxes, {"v1": "1" * 64})
    assert stored_check(benchmark.root, inputs) is None
    finding = {"severity": "note", "kind": "k", "where": ["v1"], "message": EVIL, "mend": ""}
    made = {"schema_version": 1, "is_decoded": True, "findings": [finding]}
    kept = {name: getattr(inputs, name) for name in Inputs.__slots__}
    path = benchmark.root / FILE_NAME
    path.write_text(json.dumps({**made, "inputs": kept}), encoding="utf-8")
    check = stored_check(benchmark.root, inputs)
    assert check and check.is_current and check.findings[0].message == EVIL
    other = stored_check(benchmark.root, replace(inputs, truth_sha256="0"))
    assert other and not other.is_current
    for wrong in ("", "[]", "{", '{"schema_version": 2}', json.dumps({**made, "inputs": 3}), "\x00"):
        path.write_text(wrong, encoding="utf-8")
        with pytest.raises(InputError, match="data check"):
            stored_check(benchmark.root, inputs)


def _with_sound(path: Path) -> None:
    with av.open(str(path), "w") as output:
        output.metadata["title"] = "deer"
        stream = output.add_stream("libx264", rate=25)
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        sound = output.add_stream("aac", rate=44_100)
        for _ in range(10):
            rgb = np.zeros((48, 64, 3), np.uint8)
            output.mux(stream.encode(av.VideoFrame.from_ndarray(rgb, format="rgb24")))
        output.mux(stream.encode())
        quiet = av.AudioFrame.from_ndarray(np.zeros((1, 1024), np.float32), format="fltp", layout="mono")
        quiet.sample_rate = 44_100
        output.mux(sound.encode(quiet))
        output.mux(sound.encode())


def test_the_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    benchmark = make_benchmark(tmp_path / "b", 3)
    monkeypatch.chdir(benchmark.root)
    shutil.copy(benchmark.videos / "v1.mp4", benchmark.videos / "copy.mp4")
    _with_sound(benchmark.videos / "v2.mp4")
    (benchmark.videos / "v3.mp4").write_bytes(b"nothing")
    done = RESULT.invoke(app, ["data", "check", "--json", "--workers", "1"])
    assert done.exit_code == 1, done.output
    made = json.loads(done.stdout)
    found = {one["kind"]: one["where"] for one in made["findings"]}
    assert found["truth without video"] == ["zz-gone"] and found["video without truth"] == ["copy"]
    assert found["unreadable clip"] == ["v3"] and found["duplicate clips"] == ["copy", "v1"]
    assert found["sound"] == ["v2"] and found["truth in metadata"] == ["v2"]
    assert found["unseen characters"] == ["zz-gone"]
    assert made == json.loads((benchmark.root / FILE_NAME).read_text(encoding="utf-8"))
    assert (benchmark.root / CACHE).is_file()
    plain = RESULT.invoke(app, ["data", "check"])
    assert plain.exit_code == 1 and "truth in metadata" in plain.output and "Traceback" not in plain.output
    assert "\u202e" not in plain.output


def test_files_of_ones_own_and_strictness(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "clips").mkdir()
    for name in ("v1", "v2", "v3"):
        write_clip(tmp_path / "clips" / f"{name}.mp4", 5)
    TRUTH.write(tmp_path / "t.parquet", TRUTH_OF_THREE)
    command = ["data", "check", "--truth", "t.parquet", "--videos", "clips", "--quick"]
    assert RESULT.invoke(app, command).exit_code == 1  # three clips of one content
    shutil.rmtree(tmp_path / "clips")
    (tmp_path / "clips").mkdir()
    for place, name in enumerate(("v1", "v2", "v3"), start=5):
        write_clip(tmp_path / "clips" / f"{name}.mp4", place)
    done = RESULT.invoke(app, command)
    assert done.exit_code == 0, done.output
    assert sorted(path.name for path in tmp_path.iterdir()) == ["clips", "t.parquet"]
    TRUTH.write(tmp_path / "t.parquet", [*TRUTH_OF_THREE[1:], row("v1", "A cat", "Cat")])
    assert RESULT.invoke(app, command).exit_code == 0
    assert RESULT.invoke(app, [*command, "--strict"]).exit_code == 1
    for wrong in (["--videos", "none"], ["--boxes", "none.parquet"], ["--truth", "none.csv"]):
        done = RESULT.invoke(app, [*command, *wrong])
        assert done.exit_code == 1 and not isinstance(done.exception, KeyError)
