"""Entry points of a source checkout, beside those of installed packages."""

import pytest

from softstart import plugins

TABLE = '[tool.softstart.entry-points."softstart.test-group"]\nown = "math:pi"\n'


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ('[project]\nname = "softstart"\n' + TABLE, ["own"]),
        ('[project]\nname = "another"\n' + TABLE, []),  # above an installed package
        (None, []),
    ],
)
def test_a_checkout_registers_what_its_project_file_names(tmp_path, monkeypatch, request, text, names):
    request.addfinalizer(plugins.registered.cache_clear)
    plugins.registered.cache_clear()
    if text is not None:
        (tmp_path / "pyproject.toml").write_text(text)
    monkeypatch.setattr(plugins, "CHECKOUT", tmp_path / "pyproject.toml")
    assert list(plugins.registered("softstart.test-group")) == names
