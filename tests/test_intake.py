"""The queue of uploads on disk, and the worker that takes from it."""

import json
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Event
from time import monotonic, sleep

import pytest

from pipeline.errors import Fault, FaultsError, InputError, OutsideError
from sitegen.intake import MAX_ATTEMPTS, Intake, KeyUsedError, QueueFullError
from sitegen.intake_records import Details, Report, Upload
from sitegen.intake_worker import Worker
from sitegen.readers import ReadPredictions


@pytest.fixture
def queue(tmp_path: Path) -> Iterator[Intake]:
    with Intake(tmp_path / "incoming") as opened:
        yield opened


def put(intake: Intake, name: str, data: bytes = b"", key: str = "", kind: str = "submit") -> Upload:
    details = Details.model_validate({"kind": kind, "name": name, "file_name": f"{name}.csv"})
    with intake.arriving(1_000) as arriving:
        arriving.write(data or name.encode())
        return intake.add(arriving, details, key)


def names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir() if path.is_dir()}


def test_first_come_first_served_across_restarts(tmp_path: Path) -> None:
    with Intake(tmp_path) as intake:
        for name in ("c", "a", "b"):
            put(intake, name)
        first = intake.take()
        assert first and first.details.name == "c" and first.state == "working"
        b = put(intake, "b")
        assert intake.place(b) == 2  # the one in work goes before it too
    with Intake(tmp_path) as intake:  # as after a kill: what was in work is first again
        put(intake, "d")
        order = []
        while taken := intake.take():
            order.append(taken.details.name)
            intake.finish(taken, "accepted", Report())
    assert order == ["c", "a", "b", "d"]
    with Intake(tmp_path) as intake:
        assert intake.take() is None
        assert put(intake, "e").number == 5


def test_what_is_finished_is_reported_and_its_bytes_are_gone(queue: Intake) -> None:
    upload = put(queue, "a", b"bytes")
    assert queue.file(upload).read_bytes() == b"bytes"
    taken = queue.take()
    assert taken
    fault = Fault("a.csv", 3, "rank", "'x'", "a number", "Mend it.", 4)
    queue.finish(taken, "refused", Report(message="no", faults=(fault,)))
    found = queue.find(upload.upload_id)
    assert found and found.state == "refused"
    assert queue.report(found) == Report(message="no", faults=(fault,))
    assert sorted(path.name for path in (queue.folder / upload.upload_id).iterdir()) == [
        "report.json",
        "upload.json",
    ]


def test_what_does_not_arrive_whole_is_not_there(queue: Intake) -> None:
    with pytest.raises(ZeroDivisionError), queue.arriving(10) as arriving:
        arriving.write(b"half")
        raise ZeroDivisionError
    with pytest.raises(ValueError, match="more than 3 bytes"), queue.arriving(3) as arriving:
        arriving.write(b"1234")
    assert names(queue.folder) == set() and queue.waiting() == 0


def test_what_a_kill_left_behind_is_cleared(tmp_path: Path) -> None:
    with Intake(tmp_path) as intake:
        done = put(intake, "a")
        intake.take()
        intake.finish(done, "accepted", Report())
        waiting = put(intake, "b")
        (tmp_path / done.upload_id / "file").write_bytes(b"killed before it was removed")
    for name in (".new-half", ".gone-half"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "file").write_bytes(b"x")
    (tmp_path / "not-an-id").mkdir()
    (tmp_path / ("x" * 22)).mkdir()  # an id by its form, but nothing in it
    outside = tmp_path.parent / "outside"
    outside.mkdir()
    (outside / "kept").touch()
    (tmp_path / ".new-link").symlink_to(outside)
    with Intake(tmp_path) as intake:
        assert names(tmp_path) - {".new-link"} == {done.upload_id, waiting.upload_id, "not-an-id", "x" * 22}
        assert (outside / "kept").exists()
        assert not (tmp_path / done.upload_id / "file").exists()
        assert intake.waiting() == 1


def test_the_same_again_is_the_same_upload(queue: Intake) -> None:
    first = put(queue, "a", b"1")
    assert put(queue, "a", b"1").upload_id == first.upload_id
    assert put(queue, "a", b"2").upload_id != first.upload_id
    assert put(queue, "b", b"1").upload_id != first.upload_id
    assert put(queue, "a", b"1", kind="check").upload_id != first.upload_id
    taken = queue.take()
    assert taken
    queue.finish(taken, "accepted", Report())
    assert put(queue, "a", b"1").upload_id == first.upload_id


def test_what_was_refused_may_be_sent_again(queue: Intake) -> None:
    first = put(queue, "a", key="once")
    queue.take()
    queue.finish(first, "refused", Report())
    assert put(queue, "a", key="once").upload_id == first.upload_id  # the same request, repeated
    assert put(queue, "a").upload_id != first.upload_id


def test_a_key_stands_for_one_content(queue: Intake) -> None:
    put(queue, "a", key="once")
    with pytest.raises(KeyUsedError):
        put(queue, "b", key="once")
    text = "".join(path.read_text() for path in queue.folder.glob("*/upload.json"))
    assert "once" not in text


def test_many_at_once_are_each_there_once(queue: Intake) -> None:
    wanted = [f"n{number}" for number in range(20)]
    with ThreadPoolExecutor(8) as pool:
        uploads = list(pool.map(lambda name: put(queue, name), wanted * 2))
    assert len({upload.upload_id for upload in uploads}) == 20
    assert len({upload.number for upload in uploads}) == 20
    taken = []
    while upload := queue.take():
        taken.append(upload.number)
    assert taken == sorted(taken) and len(taken) == 20
    assert names(queue.folder) == {upload.upload_id for upload in uploads}


def test_the_queue_is_bounded_by_count_and_bytes(tmp_path: Path) -> None:
    with Intake(tmp_path / "a", max_waiting=2) as intake:
        put(intake, "a")
        put(intake, "b")
        with pytest.raises(QueueFullError):
            put(intake, "c")
        taken = intake.take()
        assert taken
        intake.finish(taken, "good", Report())
        put(intake, "c")
    with Intake(tmp_path / "b", max_bytes=1_500) as intake, intake.arriving(1_000):
        assert intake.waiting() == 0
        with pytest.raises(QueueFullError):  # bytes on their way count
            put(intake, "a")


def test_only_the_newest_that_are_done_are_kept(tmp_path: Path) -> None:
    with Intake(tmp_path, keep_finished=2) as intake:
        for name in "abcd":
            put(intake, name)
        uploads = []
        while upload := intake.take():
            intake.finish(upload, "good", Report())
            uploads.append(upload)
        assert names(tmp_path) == {upload.upload_id for upload in uploads[2:]}
        assert intake.find(uploads[0].upload_id) is None


def test_one_server_at_a_time_holds_the_queue(queue: Intake) -> None:
    with pytest.raises(InputError, match="another server"):
        Intake(queue.folder)


def test_what_kills_the_server_again_and_again_is_put_aside(tmp_path: Path) -> None:
    for _ in range(MAX_ATTEMPTS):
        with Intake(tmp_path) as intake:
            put(intake, "bad")
            taken = intake.take()
            assert taken and taken.details.name == "bad"
    with Intake(tmp_path) as intake:
        put(intake, "next")
        taken = intake.take()
        assert taken and taken.details.name == "next"
        found = intake.find(put(intake, "next").upload_id)
        assert found and found.number == 2


READ = ReadPredictions((), "csv", "0" * 64, ())


class Desk:
    """A worker with callables that note what they are asked."""

    def __init__(self, intake: Intake, seconds: float = 0.0) -> None:
        self.accepted: list[str] = []
        self.builds: list[int] = []
        self.go = Event()
        self.go.set()
        self.seconds = seconds
        self.worker = Worker(
            intake,
            read=self.read,
            check=lambda upload, path, read: Report(message=f"checked {upload.details.name}"),
            accept=self.accept,
            rebuild=lambda: self.builds.append(len(self.accepted)),
            build_every=60.0,
            root=intake.folder.parent,
        )

    def read(self, upload: Upload, path: Path) -> ReadPredictions:
        self.go.wait(5)
        sleep(self.seconds)
        if upload.details.name == "faulty":
            raise FaultsError([Fault(str(path), 1, "rank", f"x at {path}", "y", "Mend it.")])
        if upload.details.name == "wrong":
            raise InputError(f"{path.parent.parent.parent}/submissions: no.")
        if upload.details.name == "missing":
            raise OutsideError("The embedder is not installed.")
        if upload.details.name == "broken":
            raise KeyError("secret detail")
        return READ

    def accept(self, upload: Upload, path: Path, read: ReadPredictions) -> Report:
        assert path.is_file() and read is READ
        self.accepted.append(upload.details.name)
        return Report(slug=upload.details.name)


def finished(intake: Intake, upload: Upload) -> tuple[str, Report]:
    """The state and the report of an upload, as soon as it is done."""
    until = monotonic() + 30
    while monotonic() < until:
        found = intake.find(upload.upload_id)
        assert found
        if not found.is_waiting:
            report = intake.report(found)
            assert report
            return found.state, report
        sleep(0.01)
    raise AssertionError("not done in time")


def test_the_worker_goes_on_whatever_happens(queue: Intake, capsys: pytest.CaptureFixture[str]) -> None:
    desk = Desk(queue)
    sent = {name: put(queue, name) for name in ("faulty", "wrong", "missing", "broken", "fine")}
    checked = put(queue, "checked", kind="check")
    desk.worker.start()
    state, report = finished(queue, sent["faulty"])
    assert state == "refused"
    assert report.faults == (Fault("faulty.csv", 1, "rank", "x at faulty.csv", "y", "Mend it."),)
    state, report = finished(queue, sent["wrong"])
    assert (state, report.message) == ("refused", "submissions: no.")
    for name in ("missing", "broken"):
        state, report = finished(queue, sent[name])
        assert state == "failed" and "on the server went wrong" in report.message
        assert "secret" not in report.message
    assert finished(queue, sent["fine"]) == ("accepted", Report(slug="fine"))
    assert finished(queue, checked) == ("good", Report(message="checked checked"))
    assert desk.worker.stop(5) and desk.accepted == ["fine"]
    log = capsys.readouterr().err
    assert "KeyError: 'secret detail'" in log and "The embedder is not installed." in log


def test_the_site_is_built_once_after_a_burst(queue: Intake) -> None:
    desk = Desk(queue)
    uploads = [put(queue, f"n{number}") for number in range(10)]
    assert desk.worker.is_behind
    desk.worker.start()
    for upload in uploads:
        assert finished(queue, upload)[0] == "accepted"
    until = monotonic() + 30
    while desk.worker.is_behind and monotonic() < until:
        sleep(0.01)
    assert desk.builds == [10]
    desk.worker.stop(5)


def test_a_stop_finishes_the_one_in_work_and_leaves_the_rest(queue: Intake) -> None:
    desk = Desk(queue)
    desk.go.clear()
    first, second = put(queue, "a"), put(queue, "b")
    desk.worker.start()
    assert not desk.worker.stop(0.1)
    desk.go.set()
    assert desk.worker.stop(5) and not desk.worker.is_alive
    assert finished(queue, first)[0] == "accepted"
    left = queue.find(second.upload_id)
    assert left and left.state == "queued"


def test_upload_json_holds_no_path(queue: Intake) -> None:
    upload = put(queue, "../../x")
    held = json.loads((queue.folder / upload.upload_id / "upload.json").read_text())
    assert held["details"]["file_name"] == "../../x.csv"
    assert queue.file(upload).parent.parent == queue.folder
