"""Records of a store: each carries its own checksum, so damage to one spoils no other.

A record is a mark, the length of its content, a checksum of both, and the content. What lies
between two records is damage, unless it has been voided by a repair or is the torn end of a write
that was killed.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from hashlib import blake2b
from typing import NamedTuple

NAME = b"\xffcut"
FORMAT = 2
MARK = NAME + bytes([FORMAT]) + b"\x00\r\n"
VOID = b"\x16"  # fills what a repair dropped
_LENGTH = struct.Struct("<I")
_DIGEST = 16
HEAD = len(MARK) + _LENGTH.size + _DIGEST
_BLOCK = 1 << 24  # bytes read at once, at least
_SHOWN = 4096  # bytes of a damaged record in which its sample's inputs are looked for


class Record(NamedTuple):
    """Content of a record and where it starts in the file."""

    start: int
    content: bytes

    @property
    def end(self) -> int:
        """Offset of what follows."""
        return self.start + HEAD + len(self.content)


class Damage(NamedTuple):
    """Part of the file that holds no record.

    Args:
        start: Where it begins.
        content: Its first bytes.
        size: Its bytes in all.
        torn: Whether it is the beginning of a record that the file ends within.
    """

    start: int
    content: bytes
    size: int
    torn: bool

    @property
    def end(self) -> int:
        """Offset of what follows."""
        return self.start + self.size


def marked(start: bytes) -> bool:
    """Whether a file begins with the mark of a record of any format."""
    return start[: len(NAME)] == NAME and start[len(NAME) + 1 :] == MARK[len(NAME) + 1 :]


def packed(content: bytes) -> bytes:
    """A content as a record."""
    length = _LENGTH.pack(len(content))
    return MARK + length + _checksum(length, content) + content


def _checksum(length: bytes, content: bytes) -> bytes:
    return blake2b(length + content, digest_size=_DIGEST).digest()


def _at(data: bytes, position: int) -> tuple[bytes | None, int]:
    """Content of the record at a position of the data, and the bytes that it needs from there."""
    head = data[position : position + HEAD]
    if len(head) < HEAD:
        return None, HEAD if head and (MARK.startswith(head) or head.startswith(MARK)) else 0
    if not head.startswith(MARK):
        return None, 0
    length = head[len(MARK) : len(MARK) + _LENGTH.size]
    size = HEAD + _LENGTH.unpack(length)[0]
    content = data[position + HEAD : position + size]
    if len(content) == size - HEAD and _checksum(length, content) == head[-_DIGEST:]:
        return content, size
    return None, size


def scan(read: Callable[[int, int], bytes], start: int, end: int) -> Iterator[Record | Damage]:
    """Records and damage of a file between two offsets, in their order.

    Args:
        read: Bytes of the file by offset and count.
        start: Where to begin; the end of a record.
        end: Size of the file.
    """
    while start < end:
        head = read(start, HEAD)
        needed = _LENGTH.unpack(head[len(MARK) :][: _LENGTH.size]) if len(head) == HEAD else (0,)
        size = max(_BLOCK, HEAD + needed[0])
        data = read(start, min(size, end - start))
        last, position = start + len(data) >= end, 0
        while position < len(data):
            content, size = _at(data, position)
            if content is not None:
                yield Record(start + position, content)
            elif data[position : position + 1] == VOID:
                rest = data[position:]
                size = len(rest) - len(rest.lstrip(VOID))
            elif position and not last and position + size > len(data):
                break  # it goes on in the next block
            else:
                size, torn = _broken(data, position, size, last)
                yield Damage(start + position, data[position:][: HEAD + _SHOWN], size, torn)
            position += size
        start += position


def _broken(data: bytes, position: int, size: int, last: bool) -> tuple[int, bool]:
    """Bytes up to the next mark, and whether they are the torn end of the file."""
    found = data.find(MARK, position + 1)
    if found > 0:
        return found - position, False
    spared = 0 if last else len(MARK) - 1  # a mark may begin here and end in the next block
    return max(len(data) - spared - position, 1), last and position + size > len(data)
