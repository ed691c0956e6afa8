"""Lists of videos: what stands on which page, the links between them, and the data of their search."""

import json
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sitegen.data_shards import BLOCK, SHARD_BYTES, Shards
from sitegen.language import ENGLISH, speaking
from sitegen.listing import PAGE, Group, Listing, by_label, numbers, pages_of, path_of, places_of
from sitegen.page_submission import submission_parts
from sitegen.page_videos import is_long, list_files, list_pages, listings
from sitegen.pager import pager
from sitegen.pages import make_pages
from sitegen.strict import strict_faults
from tests.many_case import made_data, make_site

sizes = st.lists(st.integers(1, 3 * PAGE), min_size=1, max_size=6)


def listing_of(counts: list[int]) -> Listing:
    ids = iter(range(sum(counts)))
    groups = [
        Group(f"g{n}", tuple(f"v{next(ids):05}" for _ in range(count)), f"g{n}")
        for n, count in enumerate(counts)
    ]
    return Listing("labels", tuple(groups))


@given(sizes)
def test_every_video_stands_once_in_order_on_full_pages(counts: list[int]) -> None:
    listing = listing_of(counts)
    pages = list(pages_of(listing))
    assert [one for page in pages for one in page.video_ids] == [
        one for group in listing.groups for one in group.video_ids
    ]
    assert [page.number for page in pages] == list(range(1, listing.pages + 1))
    assert all(len(page.video_ids) == PAGE for page in pages[:-1]) and pages[-1].video_ids
    assert all(section.video_ids for page in pages for section in page.sections)
    assert [page.first for page in pages] == list(range(1, listing.total + 1, PAGE))
    assert pages[-1].last == listing.total
    begun = [section.group for page in pages for section in page.sections if not section.is_rest]
    assert begun == list(listing.groups)


@given(sizes)
def test_a_group_begins_where_its_link_leads(counts: list[int]) -> None:
    listing = listing_of(counts)
    held = {path_of(listing.name, page.number): page for page in pages_of(listing)}
    for group, href in places_of(listing):
        path, _, anchor = href.partition("#")
        begun = [section.group for section in held[path].sections if not section.is_rest]
        assert anchor == group.anchor and group in begun


@given(st.integers(1, 400), st.data())
def test_page_numbers_lead_to_first_last_and_near(pages: int, data: st.DataObject) -> None:
    number = data.draw(st.integers(1, pages))
    found = numbers(number, pages)
    linked = [one for one in found if one is not None]
    assert linked == sorted(set(linked)) and len(linked) <= 9
    assert {1, number, pages} <= set(linked)
    assert {n for n in range(number - 2, number + 3) if 1 <= n <= pages} <= set(linked)
    for place, one in enumerate(found):
        if one is None:
            before, after = found[place - 1], found[place + 1]
            assert before is not None and after is not None and after - before > 2
        elif place and (before := found[place - 1]) is not None:
            assert one == before + 1


def test_page_numbers_by_hand() -> None:
    assert numbers(1, 1) == (1,)
    assert numbers(1, 100) == (1, 2, 3, None, 100)
    assert numbers(5, 100) == (1, 2, 3, 4, 5, 6, 7, None, 100)  # a gap of one page is that page
    assert numbers(50, 100) == (1, None, 48, 49, 50, 51, 52, None, 100)


def test_a_pager_knows_its_neighbours() -> None:
    ends = pager(1, 2, lambda n: f"p{n}")
    assert (ends.previous, ends.following) == ("", "p2")
    assert [(one.text, one.href, one.here) for one in ends.numbers] == [("1", "p1", True), ("2", "p2", False)]
    assert pager(1, 1, str).numbers == ()


@given(st.lists(st.tuples(st.sampled_from("abcd"), st.sampled_from(["Deer", "deer", "cat", "DEER", "ß"]))))
def test_labels_hold_each_of_their_videos_once(pairs: list[tuple[str, str]]) -> None:
    groups = by_label(pairs)
    found = Counter((one, group.title.casefold()) for group in groups for one in group.video_ids)
    assert found == Counter({(one, label.casefold()) for one, label in pairs})
    assert len({group.anchor for group in groups}) == len(groups)
    assert [group.title.casefold() for group in groups] == sorted({label.casefold() for _one, label in pairs})


def test_states_share_out_all_videos(tmp_path: Path) -> None:
    data = made_data(tmp_path)
    lists = {one.name: one for one in listings(data)}
    shared = [
        one for name in ("missed", "partly", "found", "clear") for one in lists[name].groups[0].video_ids
    ]
    assert sorted(shared) == list(data.video_ids) == list(lists["all"].groups[0].video_ids)
    assert len(lists["clear"].groups[0].video_ids) == 450 // 9
    cats = [one for one in data.video_ids if [row.label for row in data.truth[one]] == ["cat"]]
    assert set(cats) <= set(lists["missed"].groups[0].video_ids)
    deer = next(group for group in lists["labels"].groups if group.title.casefold() == "deer")
    assert "v0010" in deer.video_ids  # its second hazard


def test_small_benchmarks_have_one_page_and_no_data(tmp_path: Path) -> None:
    data = made_data(tmp_path, PAGE)
    assert not is_long(data) and not list(list_files(data))
    with speaking(ENGLISH):
        paths = [page.path for page in make_pages(data)]
    assert "videos.html" in paths and not any(path.startswith("list/") for path in paths)
    assert len(submission_parts(data)) == 1


def test_shards_hold_every_video_in_order(tmp_path: Path) -> None:
    data = made_data(tmp_path)
    files = {path: content.decode() for path, content in list_files(data)}
    index = _value(files.pop("data/videos.js"), "videos")
    rows: list[Any] = []
    for number, end in enumerate(index["ends"]):
        text = files.pop(f"data/videos/all/{number}.js")
        part = _value(text, f"videos/all/{number}")
        assert len(text.encode()) <= SHARD_BYTES and len(part) <= BLOCK
        rows += part
        assert len(rows) == end
    assert not files and [row[0] for row in rows] == list(data.video_ids)
    for video_id, row in zip(data.video_ids, rows, strict=True):
        expected = {hazard.label.casefold() for hazard in data.truth[video_id]} - {""}
        if video_id != "v0011":
            assert {index["labels"][code].casefold() for code in row[6]} == expected


def _value(text: str, name: str) -> Any:
    head = f'COOOLER_VIDEOS("{name}",'
    assert text.startswith(head) and text.endswith(");\n")
    return json.loads(text[len(head) : -3])


@given(st.lists(st.integers(1, SHARD_BYTES - 300), max_size=60))
def test_a_shard_is_never_too_large(lengths: list[int]) -> None:
    entries = ["1" * length for length in lengths]
    ends: list[int] = []
    files = list(Shards("F", "x").cut("n", entries, range(len(entries)), ends))
    assert all(len(content) <= SHARD_BYTES for _path, content in files)
    held = [content.decode().partition("[")[2].partition("]")[0] for _path, content in files]
    assert ",".join(held) == ",".join(entries)
    assert ends == sorted(set(ends)) and (ends[-1:] or [0]) == [len(entries)]


def test_a_hidden_truth_shows_ids_only(tmp_path: Path) -> None:
    data = made_data(tmp_path, hidden=True)
    assert [one.name for one in listings(data)] == ["all"]
    with speaking(ENGLISH):
        pages = list(list_pages(data, lambda title, about, root: None))  # type: ignore[arg-type,return-value]
        made = [context() for _path, context in pages]
    assert [path for path, _context in pages] == ["videos.html", "list/all-2.html", "list/all-3.html"]
    told = repr(made) + "".join(content.decode() for _path, content in list_files(data))
    assert not any(word in told for word in ("deer", "cat", "on the road"))


@pytest.mark.parametrize("hidden", [False, True])
def test_the_whole_site_keeps_to_the_rules(tmp_path: Path, hidden: bool) -> None:
    (tmp_path / "in").mkdir()
    make_site(tmp_path / "in", tmp_path / "out", hidden=hidden)
    assert strict_faults(tmp_path / "out") == []
    lines = tmp_path / "out" / "submissions"
    assert (lines / "broad.html").is_file() and (lines / "broad" / "3.html").is_file()
