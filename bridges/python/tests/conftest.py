"""A small pool of generated scenes, and a closed one beside it."""

import pytest

import evodrive.gym as eg


@pytest.fixture(scope="session")
def pools(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pools")
    return eg.generate(folder / "open.pool", 24, 7), eg.generate(folder / "closed.pool", 12, 8)
