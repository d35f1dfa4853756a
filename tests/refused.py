"""What a test of a refused value looks at: the key, and that the message is one line."""

from contextlib import contextmanager

import pytest

from alphacut.base.errors import RefusedError


@contextmanager
def refuses(key):
    """Expects that the block raises a RefusedError of a key, in one line.

    The wording is free; a few tests of messages read it. Of a file the key may have its whole path,
    of which `key` is the name. Gives what `pytest.raises` gives.
    """
    with pytest.raises(RefusedError) as caught:
        yield caught
    found = caught.value.key
    assert key in (found, found.rpartition("/")[2]), str(caught.value)
    assert len(str(caught.value).splitlines()) == 1
