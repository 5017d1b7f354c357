"""What a result depends on."""

import re

import pytest

from aliasbench.bench import machine


@pytest.mark.usefixtures("fakes")
def test_the_machine_is_described_by_texts_that_stay_the_same() -> None:
    found = machine.describe_machine()
    assert {"cpu", "cores", "memory", "os", "python", "aliasbench", "opengl", "embree", "numpy"} <= found.keys()
    assert all(isinstance(value, str) and value for value in found.values())
    assert found == machine.describe_machine()


def test_the_version_names_release_and_sources() -> None:
    assert re.fullmatch(r"\d+\.\d+\.\d+\S*\+[0-9a-f]{8}", machine.project_version())


def test_the_version_changes_with_any_source(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(machine.kernel_cache, "source_digest", lambda folder: folder.name)
    before = machine.project_version()
    monkeypatch.setattr(
        machine.kernel_cache, "source_digest", lambda folder: "x" if folder.name == "metrics" else folder.name
    )
    assert machine.project_version() != before


def test_engines_are_described_by_what_they_are_or_why_not() -> None:
    found = machine.describe_engines()
    assert found.keys() == {"opengl", "embree"}
    assert re.match(r"\d+\.\d+\.\d+, |engine=packet needs", found["embree"])
    assert found["opengl"]


def test_a_package_that_is_not_there_is_said_to_be() -> None:
    assert set(machine.package_versions()) == set(machine.PACKAGES)
    assert machine._version("no-such-package-here") == "not installed"
