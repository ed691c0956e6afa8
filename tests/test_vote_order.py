"""The order of blind votes, run in a real Chromium on a page that holds nothing else."""

import json

import pytest
from playwright.sync_api import Browser

from sitegen.rendering import find_templates

pytestmark = pytest.mark.browser


def test_the_order_is_fair(browser: Browser) -> None:
    """Four systems on six videos: every pair at once, every video too, nothing twice, sides in balance."""
    systems = [[f"s{n}", f"S{n}", f"{n}" * 64] for n in range(4)]
    data = {"benchmark": "b", "truth": "t", "systems": systems, "videos": list("abcdef"), "first": [0]}
    entry = {"side_of": [0, 1, 2, 3]}
    with browser.new_context() as context:
        page = context.new_page()
        page.evaluate("data => { window.COOOLER_VOTES = data; }", data)
        page.evaluate("() => { let n = 0; crypto.getRandomValues = (array) => array.fill((n += 1)); }")
        page.add_script_tag(path=find_templates() / "assets" / "vote-order.js")
        orders = page.evaluate(
            """async (entries) => {
                COOOLER_VOTE_SHARD(0, entries);
                const orders = [];
                for (let voter = 0; voter < 20; voter += 1) {
                    COOOLER_BALLOT.recall();
                    const order = [];
                    for (let one; (one = await COOOLER_BALLOT.next()); COOOLER_BALLOT.add(one, "tie"))
                        order.push([one.video, one.left, one.right]);
                    orders.push(order);
                }
                return orders;
            }""",
            [entry] * 6,
        )
    assert len({json.dumps(order) for order in orders}) == 20
    lefts = dict.fromkeys(range(4), 0)
    for order in orders:
        pairs = [frozenset(sides) for _, *sides in order]
        assert (
            len({(video, pair) for (video, *_), pair in zip(order, pairs, strict=True)}) == len(order) == 36
        )
        for start in range(0, 36, 6):
            assert len(set(pairs[start : start + 6])) == 6
            assert len({video for video, *_ in order[start : start + 6]}) == 6
        for one, other in set(map(tuple, pairs)):
            assert [left for _, left, right in order if {left, right} == {one, other}].count(one) == 3
        lefts[order[0][1]] += 1
    assert min(lefts.values()) >= 1
