"""Hashes by which facts of results are told apart."""

import hashlib

import msgspec


def content_hash(content: object) -> str:
    """Hash of plain values, of 16 hexadecimal digits; the order of keys does not count."""
    encoded = msgspec.json.encode(content, order="sorted")
    return hashlib.blake2b(encoded, digest_size=8).hexdigest()
