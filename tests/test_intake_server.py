"""The upload server as it runs: many uploads at once, a kill, real checks and submissions."""

import json
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from time import monotonic, sleep

import pytest

from pipeline.benchmark import open_benchmark
from pipeline.errors import ConfigError, OutsideError
from sitegen import ledger
from sitegen.about import Sender
from sitegen.intake_records import Details, Upload
from sitegen.intake_server import accept
from sitegen.intake_worker import in_ledger
from sitegen.readers import read_predictions
from sitegen.submissions import load_all, store, withdraw
from tests.intake_process import CSV, ROOT, Server, running, small_benchmark
from tests.site_fixtures import make_benchmark

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="stops by signals")


@pytest.fixture(scope="module")
def real(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    folder = tmp_path_factory.mktemp("real") / "b"
    make_benchmark(folder, 1)
    with running(folder, "real") as server:
        yield server


def test_fifty_at_once_and_a_kill_in_the_middle(tmp_path: Path) -> None:
    folder = small_benchmark(tmp_path / "b")
    names = [f"System {number}" for number in range(50)]

    def sent(name: str) -> str:
        return server.send(kind="submit", name=name, file=f"{CSV}v1,2,{name}\n".encode())

    with running(folder, "fast") as server:
        with ThreadPoolExecutor(50) as pool:
            ids = list(pool.map(sent, names))
        assert len(set(ids)) == 50
        until = monotonic() + 60
        while len(ledger.read(folder / "submissions")) < 3 and monotonic() < until:
            sleep(0.005)
        os.kill(server.process.pid, signal.SIGKILL)
        server.process.wait()
    before = [entry.name for entry in ledger.read(folder / "submissions")]
    assert 3 <= len(before) < 50
    with running(folder, "fast") as server:
        assert [server.done(upload_id)["state"] for upload_id in ids] == ["accepted"] * 50
        assert sent(names[7]) == ids[7]  # a client that asks once more
    entries = ledger.read(folder / "submissions")  # raises when the chain is broken
    assert sorted(entry.name for entry in entries) == sorted(names)
    assert len(load_all(folder / "submissions")) == 50
    assert not list((folder / "submissions").glob(".*"))


def test_a_check_tells_scores_and_stores_nothing(real: Server) -> None:
    told = real.done(real.send(kind="check", file=CSV.encode()))
    assert told["state"] == "good" and told["format"] == "csv" and told["page"] == ""
    scores = told["scores"]
    assert 0 < scores["metrics"]["besm"]["value"] <= 1 and scores["band"] == 1
    assert told["warnings"] == ["1 of 2 videos with a hazard have no prediction and count as 0: zz-gone."]
    page = real.get(f"/upload/{told['id']}")
    assert f"{scores['metrics']['besm']['value']:.4f}" in page and "Rank 1 of" in page
    assert 'http-equiv="refresh"' not in page
    assert not (real.folder / "submissions" / "ledger.jsonl").exists()


def test_a_submission_is_scored_and_shown(real: Server) -> None:
    status, headers, _ = real.post(
        "/upload", kind="submit", name="Über system", notes="a\r\nb", file=CSV.encode()
    )
    assert status == 303 and headers["location"].startswith("upload/")
    upload_id = headers["location"].partition("/")[2]
    assert 'http-equiv="refresh"' in real.get(f"/upload/{upload_id}")
    told = real.done(upload_id)
    assert told["state"] == "accepted" and told["page"] == "/submissions/uber-system.html"
    until = monotonic() + 60
    while "../submissions/uber-system.html" not in (page := real.get(f"/upload/{upload_id}")):
        assert monotonic() < until, page
        sleep(0.1)
    assert 'http-equiv="refresh"' not in page
    assert "Über system" in real.get(told["page"]) and "Über system" in real.get("/")
    (entry,) = ledger.read(real.folder / "submissions")
    assert (
        entry.original_sha256 == told["sha256"] and entry.besm == told["scores"]["metrics"]["besm"]["value"]
    )


def test_every_fault_comes_back_as_text(real: Server) -> None:
    bad = 'video_id,rank,description\nv1,1,A cat\n<script>,x,"<img src=x onerror=alert(1)>"\nv1,1,\n'
    name = "../../<script>alert(2)</script>.csv"
    told = real.done(real.send(kind="submit", name="<b>Bold</b>", file=(name, bad.encode())))
    assert told["state"] == "refused" and told["file_name"] == name
    faults = {(fault["row"], fault["column"]) for fault in told["faults"]}
    assert {(2, "video_id"), (2, "rank"), (3, "description")} <= faults
    assert all(fault["file"] == name and fault["mend"] for fault in told["faults"])
    page = real.get(f"/upload/{told['id']}")
    assert "&lt;script&gt;" in page and "&lt;b&gt;Bold&lt;/b&gt;" in page
    for evil in ("<script>alert", "<script>,", "<b>Bold", str(real.folder)):
        assert evil not in page and evil not in json.dumps(told["faults"]).replace(name, "")


def test_a_file_that_takes_too_much_is_refused_and_the_work_goes_on(real: Server) -> None:
    rows = "".join(f"v1,{number},A cat\n" for number in range(1, 2_000_000))
    rows += 'v1,2000000,"A\ncat"\n'  # so that every cell has to be looked at
    heavy = real.send(kind="submit", name="Heavy", file=f"video_id,rank,description\n{rows}".encode())
    light = real.send(kind="check", name="Light", file=CSV.encode())
    told = real.done(heavy)
    assert told["state"] == "refused" and len(told["faults"]) == 1
    assert "900 MB" in told["faults"][0]["expected"]
    assert real.done(light)["state"] == "good"


def test_the_form_reads_without_scripts_and_says_what_is_wrong(real: Server) -> None:
    status, headers, body = real.ask("GET", "/upload")
    assert status == 200 and "form-action 'self'" in headers["content-security-policy"]
    assert headers["x-content-type-options"] == "nosniff"
    for field in ("file", "name", "authors", "url", "agents", "licence", "notes", "format", "caption_column"):
        assert f'name="{field}"' in body.decode()
    status, _, body = real.post("/upload", kind="submit", name="", authors='"><i>x', url="ftp://x", file=b"x")
    page = body.decode()
    assert status == 400 and "name: nothing" in page and "&#34;&gt;&lt;i&gt;x" in page
    status, _, body = real.post("/upload", kind="check", name="\u202e", url="ftp://x", file=b"x")
    assert status == 400 and "name" in body.decode() and "web address" in body.decode()


def test_a_name_that_was_made_to_lead_here_is_refused(real: Server) -> None:
    assert real.post(headers={"Host": "evil.example"}, kind="check", file=b"x")[0] == 403


def test_what_a_kill_left_stored_but_unnoted_is_recognised(tmp_path: Path) -> None:
    benchmark = open_benchmark(small_benchmark(tmp_path / "b"))
    given = tmp_path / "given.csv"
    given.write_text(CSV)
    read = read_predictions(given)
    store(benchmark.submissions, Sender("System A", date="2026-01-02"), read, given)

    def upload(name: str, sha256: str) -> Upload:
        details = Details(kind="submit", name=name)
        return Upload(
            upload_id="x" * 22, number=1, details=details, size=1, sha256=sha256, received="2026-01-02"
        )

    found = in_ledger(benchmark, upload("System A", read.sha256))
    assert found and found.slug == "system-a"
    assert in_ledger(benchmark, upload("System A", "0" * 64)) is None
    assert in_ledger(benchmark, upload("System-A", read.sha256)) is None
    withdraw(benchmark.submissions, "System A", "asked", "2026-01-03")
    assert in_ledger(benchmark, upload("System A", read.sha256)) is None


def test_without_the_extra_it_says_how_to_install_it(tmp_path: Path) -> None:
    code = (
        "import sys\nfrom pathlib import Path\nsys.modules['starlette'] = None\n"
        "from pipeline.benchmark import open_benchmark\nfrom sitegen.intake_server import accept\n"
        f"accept(open_benchmark(Path({str(small_benchmark(tmp_path / 'b'))!r})), Path('site'))"
    )
    run = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert "pip install 'coooler[server]'" in run.stderr.splitlines()[-1]


def test_what_cannot_be_served_is_said_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    benchmark = open_benchmark(small_benchmark(tmp_path / "b"))
    monkeypatch.delenv("NO_SUCH_TOKEN", raising=False)
    with pytest.raises(ConfigError, match="NO_SUCH_TOKEN is empty"):
        accept(benchmark, benchmark.site, token_env="NO_SUCH_TOKEN")
    with (
        socket.create_server(("127.0.0.1", 0)) as taken,
        pytest.raises(OutsideError, match="choose another"),
    ):
        accept(benchmark, benchmark.site, port=taken.getsockname()[1])
