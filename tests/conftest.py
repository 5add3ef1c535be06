"""What holds in all tests."""

from pathlib import Path

import pytest

from mocapflow.digests import Digests

CODE = Digests()  # of this process


@pytest.fixture(scope="session", autouse=True)
def code_is_read_once():
    """Let new stores know the digests of code that others have read: reading it all takes a second for each.

    What has no memory of its own, as in the tests of digests, reads for itself.
    """

    def source(self: Digests, path: Path) -> tuple[str, list[str]]:
        return real(self if self._memory is None else CODE, path)

    real = Digests._source
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Digests, "_source", source)
        yield


@pytest.fixture
def unrendered(monkeypatch: pytest.MonkeyPatch) -> None:
    """Compose pictures of a comparison but don't render them, which takes a second each: for who reads its figures."""
    from mocapflow_sequence import comparison_plots

    monkeypatch.setattr(comparison_plots, "save", lambda figure, path: path)
