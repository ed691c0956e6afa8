"""Who may send an upload: rates, addresses, origins, tokens."""

import pytest

from sitegen.intake_limits import RateLimit, RefusalError, check_origin, check_token, client_address


def test_rates_by_address() -> None:
    now = [0.0]
    rate = RateLimit(30, 3, remembered=2, clock=lambda: now[0])
    assert [rate.wait("192.0.2.1") for _ in range(4)] == [0, 0, 0, 2]
    assert rate.wait("192.0.2.2") == 0
    now[0] = 1.0
    assert rate.wait("192.0.2.1") == 1
    now[0] = 2.0  # a token every two seconds
    assert [rate.wait("192.0.2.1") for _ in range(2)] == [0, 2]
    now[0] = 1_000.0
    assert [rate.wait("192.0.2.1") for _ in range(4)] == [0, 0, 0, 2]
    for address in ("192.0.2.7", "192.0.2.8"):  # the first one is forgotten
        rate.wait(address)
    assert rate.wait("192.0.2.1") == 0


def test_a_network_of_64_bits_is_one_address() -> None:
    rate = RateLimit(30, 1, clock=lambda: 0.0)
    assert rate.wait("2001:db8::1") == 0
    assert rate.wait("2001:db8::ffff:2") == 2
    assert rate.wait("2001:db8:0:1::1") == 0
    assert rate.wait("192.0.2.1") == 0
    assert rate.wait("::ffff:192.0.2.1") == 2
    assert rate.wait("no address") == 0 and rate.wait("another") == 2


def test_a_proxy_is_believed_only_when_told_so() -> None:
    headers = {"x-forwarded-for": "203.0.113.9, 198.51.100.7"}
    assert client_address("192.0.2.1", headers, trust_proxy=False) == "192.0.2.1"
    assert client_address("192.0.2.1", headers, trust_proxy=True) == "198.51.100.7"
    assert client_address("192.0.2.1", {}, trust_proxy=True) == "192.0.2.1"


@pytest.mark.parametrize(
    ("headers", "may"),
    [
        ({}, True),  # no browser
        ({"sec-fetch-site": "same-origin"}, True),
        ({"sec-fetch-site": "none"}, True),
        ({"sec-fetch-site": "cross-site"}, False),
        ({"sec-fetch-site": "same-site"}, False),
        ({"origin": "http://localhost:8000"}, True),
        ({"origin": "https://localhost:8000"}, True),
        ({"origin": "http://localhost:9000"}, False),
        ({"origin": "https://evil.example"}, False),
        ({"origin": "null"}, False),
        (
            {"host": "evil.example:8000", "origin": "http://evil.example:8000"},
            False,
        ),  # a name made to lead here
        ({"host": "[::1]:8000"}, True),
        ({"host": "[oops"}, False),
    ],
)
def test_other_sites_cannot_send_through_a_browser(headers: dict[str, str], may: bool) -> None:
    given = {"host": "localhost:8000", **headers}
    if may:
        check_origin(given, only_local=True)
        return
    with pytest.raises(RefusalError) as caught:
        check_origin(given, only_local=True)
    assert caught.value.status == 403


def test_a_public_server_has_any_name() -> None:
    check_origin({"host": "board.example", "origin": "https://board.example"}, only_local=False)


def test_tokens() -> None:
    check_token("", "")
    check_token("hush", "hush")
    for wrong in ("", "hus", "hushh", "h\ud800", "ü"):
        with pytest.raises(RefusalError) as caught:
            check_token(wrong, "hush")
        assert caught.value.status == 401
