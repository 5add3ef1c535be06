"""Packets of files that can't be read as a whole."""

from types import SimpleNamespace

import av

from mocapflow.io.video.packets import packets


def test_reading_goes_on_after_an_error():
    def demux(_):
        yield from parts.pop(0)
        if parts:
            raise av.error.OSError(5, "Input/output error")

    parts = [[SimpleNamespace(size=1)], [], [SimpleNamespace(size=2)]]
    read = packets(SimpleNamespace(container=SimpleNamespace(demux=demux)))
    assert [packet and packet.size for packet in read] == [1, None, None, 2]
