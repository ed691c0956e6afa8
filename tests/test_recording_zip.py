"""Recordings as zips: exported the same, and nothing is believed that comes in."""

import zipfile
from pathlib import Path

import pytest

import pipeline.recording_zip as zips
from pipeline.errors import CooolerError, FaultsError, InputError
from pipeline.recording import Record, Recording
from pipeline.recording_zip import export, import_zip
from tests.test_recording import answer, request


def filled(folder: Path, count: int = 5) -> Recording:
    recording = Recording(folder)
    for place in range(count):
        recording.keep(request(f"question {place}"), answer(f"answer {place}"))
    return recording


def test_an_export_is_the_same_whenever_it_is_made_and_comes_back(tmp_path: Path) -> None:
    recording = filled(tmp_path / "a")
    (tmp_path / "a" / "00").mkdir(exist_ok=True)
    (tmp_path / "a" / "00" / "junk.json").write_text("{}")
    exported = export(recording, tmp_path / "one.zip")
    assert (exported.count, [path.name for path in exported.corrupt]) == (5, ["junk.json"])
    assert import_zip(tmp_path / "one.zip", tmp_path / "b") == 5
    assert import_zip(tmp_path / "one.zip", tmp_path / "b") == 0
    export(Recording(tmp_path / "b"), tmp_path / "two.zip")
    assert (tmp_path / "one.zip").read_bytes() == (tmp_path / "two.zip").read_bytes()
    assert Recording(tmp_path / "b").find(request("question 3")) == answer("answer 3")
    with zipfile.ZipFile(tmp_path / "one.zip") as archive:
        assert archive.namelist() == sorted(archive.namelist())
    with pytest.raises(InputError, match="no recorded answer"):
        export(Recording(tmp_path / "none"), tmp_path / "none.zip")
    assert not (tmp_path / "none.zip").exists()


def test_an_import_never_replaces_an_answer(tmp_path: Path) -> None:
    export(filled(tmp_path / "a", 1), tmp_path / "a.zip")
    mine = Recording(tmp_path / "b")
    mine.keep(request("question 0"), answer("mine"))
    assert import_zip(tmp_path / "a.zip", tmp_path / "b") == 0
    assert mine.find(request("question 0")) == answer("mine")


GOOD = Record(request=request(), answer=answer())
LATIN = GOOD.as_bytes().replace(b"hello", b"h\xe9llo")
HOSTILE = {
    "climbs": {"../evil.json": GOOD.as_bytes()},
    "absolute": {"/tmp/" + GOOD.name: GOOD.as_bytes()},
    "elsewhere": {"x/" + GOOD.name: GOOD.as_bytes()},
    "wrong shard": {("00" if GOOD.name[:2] != "00" else "11") + GOOD.name[2:]: GOOD.as_bytes()},
    "other suffix": {GOOD.name[:-5] + ".py": GOOD.as_bytes()},
    "other content": {GOOD.name: Record(request=request("other"), answer=answer()).as_bytes()},
    "no JSON": {GOOD.name: b"\x80\x04."},
    "latin-1": {GOOD.name: LATIN},
    "deep": {GOOD.name: b"[" * 100_000},
    "a key more": {GOOD.name: GOOD.as_bytes().replace(b'"format"', b'"x": {}, "format"')},
    "long answer": {GOOD.name: GOOD.as_bytes().replace(b'"hi"', b'"' + b"a" * (1 << 18) + b'a"')},
    "NaN": {GOOD.name: GOOD.as_bytes().replace(b"0.25", b"NaN")},
    "bomb": {GOOD.name: b" " * (17 << 20)},
}


@pytest.mark.parametrize("entries", HOSTILE.values(), ids=HOSTILE)
def test_a_hostile_zip_adds_nothing(entries: dict[str, bytes], tmp_path: Path) -> None:
    fine = Record(request=request("fine"), answer=answer())
    with zipfile.ZipFile(tmp_path / "evil.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(fine.name, fine.as_bytes())
        for name, data in entries.items():
            archive.writestr(name, data)
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(FaultsError, match="Nothing was added"):
        import_zip(tmp_path / "evil.zip", tmp_path / "in")
    assert sorted(tmp_path.rglob("*")) == before


def test_zips_that_lie_about_themselves(tmp_path: Path, monkeypatch) -> None:
    export(filled(tmp_path / "a"), tmp_path / "a.zip")
    whole = (tmp_path / "a.zip").read_bytes()
    path = tmp_path / "b.zip"
    for place in range(0, len(whole), 7):
        for data in (whole[:place], whole[:place] + bytes([whole[place] ^ 0x41]) + whole[place + 1 :]):
            path.write_bytes(data)
            try:
                import_zip(path, tmp_path / "in")
            except CooolerError as error:
                assert str(path) in str(error)
    for found in (tmp_path / "in").rglob("*.json"):  # whatever came in is sound
        assert Record.model_validate_json(found.read_bytes()).name.endswith(found.name)
    monkeypatch.setattr(zips, "MAX_RECORDS", 4)
    with pytest.raises(InputError, match="found 5 entries; expected at most 4"):
        import_zip(tmp_path / "a.zip", tmp_path / "c")
    monkeypatch.setattr(zips, "MAX_RECORDS", 5)
    monkeypatch.setattr(zips, "MAX_TOTAL_BYTES", 1_000)
    with pytest.raises(InputError, match="expected at most 1000"):
        import_zip(tmp_path / "a.zip", tmp_path / "c")
    with pytest.raises(InputError, match="not readable as a zip"):
        import_zip(tmp_path / "nowhere.zip", tmp_path / "c")
