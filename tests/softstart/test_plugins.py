"""Entry points: those of installed packages, and those of a source checkout."""

from __future__ import annotations

import pytest

from softstart import plugins

TABLE = '[tool.softstart.entry-points."softstart.test-group"]\nown = "math:pi"\n'


@pytest.fixture
def fresh_entry_points():
    """Nothing that a test registers stays."""
    plugins.registered.cache_clear()
    yield
    plugins.registered.cache_clear()


@pytest.mark.usefixtures("fresh_entry_points")
@pytest.mark.parametrize(
    ("text", "names"),
    [
        ('[project]\nname = "softstart"\n' + TABLE, ["own"]),
        ('[project]\nname = "another"\n' + TABLE, []),
        (TABLE, []),
        (None, []),
    ],
    ids=["checkout", "another project above an installed package", "no project", "installed"],
)
def test_a_checkout_registers_what_its_project_file_names(tmp_path, monkeypatch, text, names):
    if text is not None:
        (tmp_path / "pyproject.toml").write_text(text)
    monkeypatch.setattr(plugins, "CHECKOUT", tmp_path / "pyproject.toml")
    assert list(plugins.registered("softstart.test-group")) == names
    if names:
        assert plugins.load("softstart.test-group", "number", "own", "list") == pytest.approx(
            3.14159, abs=1e-5
        )


@pytest.mark.skipif(not plugins.CHECKOUT.is_file(), reason="the benchmarks are not in the wheel")
def test_the_benchmarks_are_studies_of_the_checkout():
    found = [point.name for point in plugins._of_checkout("softstart.studies")]
    benchmarks = [name for name in found if name.startswith("benchmark-")]
    assert benchmarks == ["benchmark-starts", "benchmark-optima"]
    assert {"paper-g", "real-starts"} <= set(found)  # found without being installed again
    for name in found:
        assert plugins.load("softstart.studies", "study", name, "list").name == name
