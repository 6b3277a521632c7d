"""Which decoder reads the messages of a channel: by message encoding, ours and plug-ins alike.

A plug-in of the group `seamlog.decoders` is named like its message encoding and called with the
`Schema` of a channel (None if it has none). It returns either a function from payload to mapping,
or a `Grammar`, which makes columns of many messages at once. A decoder factory made for the `mcap`
package (it has `decoder_for`) does as well.
"""

from collections.abc import Callable
from importlib import import_module
from typing import Any, TypeAlias

from seamlog import plugins
from seamlog.errors import SessionError, UnknownName
from seamlog.mcap.one_by_one import DecodeOne
from seamlog.mcap.records import ChannelRecord, Malformed, Schema
from seamlog.mcap.shapes import Grammar

Decoder: TypeAlias = Grammar | DecodeOne
OWN = {
    "cdr": "seamlog.mcap.definitions:cdr",
    "json": "seamlog.mcap.definitions:json",
    "protobuf": "seamlog.mcap.protobuf:ProtobufGrammar",
    "ros1": "seamlog.mcap.definitions:ros1",
}
"""Our own, found without `entry_points()`, which would cost more than opening a file."""

TYPED = ("cdr", "protobuf", "ros1")
"""Encodings whose definitions say which fields there are; others may have any in any message."""


def decoder_of(channel: ChannelRecord, schema: Schema | None, where: str) -> Decoder:
    """The decoder of a channel; `SessionError` if there is none or its schema cannot be used."""
    try:
        factory = _factory(channel.message_encoding)
        if hasattr(factory, "decoder_for"):
            return _of_mcap(factory, channel, schema)
        decoder: Decoder = factory(schema)
    except UnknownName as error:
        found = channel.message_encoding
        raise SessionError(f"{where} is encoded as {found!r}: {error}") from error
    except Malformed as error:
        raise SessionError(f"{where}: {error}") from error
    return decoder


def _factory(encoding: str) -> Any:
    if encoding in OWN:
        module, _, name = OWN[encoding].partition(":")
        return getattr(import_module(module), name)
    try:
        return plugins.load("seamlog.decoders", encoding)
    except UnknownName as error:
        known = ", ".join(sorted(plugins.available("seamlog.decoders")))
        raise UnknownName(
            f"no decoder for it is installed (there are {known}); install a plug-in of the group "
            "seamlog.decoders, or convert the file to one of them"
        ) from error


def _of_mcap(factory: Any, channel: ChannelRecord, schema: Schema | None) -> Callable[[bytes], Any]:
    made = factory() if isinstance(factory, type) else factory
    decode: Callable[[bytes], Any] | None = made.decoder_for(channel.message_encoding, schema)
    if decode is None:
        raise Malformed(f"{type(made).__name__} does not decode its schema")
    return decode
