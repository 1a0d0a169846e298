"""Addresses: the public ones, in every notation, and the resolution of names."""

import asyncio

import pytest

from islands_service.outbound.addresses import OutboundFailedError, is_public, resolve

#: One address of each special range, and notations that hide a private IPv4 address in an IPv6 address.
OTHERS = [
    "0.0.0.0",
    "10.1.2.3",
    "100.64.0.1",
    "127.0.0.1",
    "169.254.169.254",
    "172.16.0.1",
    "192.0.2.1",
    "192.168.1.1",
    "198.18.0.1",
    "224.0.0.1",
    "240.0.0.1",
    "255.255.255.255",
    "::",
    "::1",
    "::127.0.0.1",
    "::ffff:127.0.0.1",
    "64:ff9b::a00:1",
    "64:ff9b:1::1",
    "2001::1",
    "2001:db8::1",
    "2002:7f00:1::1",
    "fc00::1",
    "fe80::1",
    "fe80::1%2",
    "fec0::1",
    "ff02::1",
]


@pytest.mark.parametrize("address", OTHERS)
def test_a_special_address_is_not_public(address):
    assert not is_public(address)


@pytest.mark.parametrize("host", ["127.0.0.1", "127.1", "0x7f000001", "2130706433"])
def test_every_notation_of_an_address_is_resolved_before_it_is_checked(host):
    assert asyncio.run(resolve(host, 443)) == ("127.0.0.1",)


@pytest.mark.parametrize("host", ["no-such-name.invalid", "a" * 64 + ".example", "a\x00b"])
def test_a_name_without_an_address_is_an_error_with_the_name(host):
    with pytest.raises(OutboundFailedError, match=f"the name {host}"):
        asyncio.run(resolve(host, 443))
