"""Bytes that a glTF file has inside its JSON, as ``data:`` URIs: buffers and images."""

import base64
import binascii
import re

from aliasbench.scenes.errors import InputError, shortened

_DATA_URI = re.compile(r"data:[\w.+/-]*(;[\w.+=-]*)*?;base64,", re.ASCII)


def decode_data_uri(uri: str, what: str) -> bytes:
    """Return the bytes of a ``data:`` URI in base64."""
    head = _DATA_URI.match(uri[:200])
    if head is None:
        raise InputError(f"{what}: {shortened(ascii(uri[:100]))} is no data URI in base64")
    try:
        return base64.b64decode(uri[head.end() :], validate=True)
    except (binascii.Error, ValueError) as error:
        raise InputError(f"{what}: its data URI is not valid base64 ({error})") from error
