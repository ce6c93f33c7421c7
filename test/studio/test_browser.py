"""The tests' browser runs pages, and hears what goes wrong in them."""

from helpers.studio.browser import browser_tab


def test_a_tab_shows_a_page_and_collects_its_errors(tmp_path):
    page = tmp_path / "page.html"
    page.write_text("<h1>before</h1><script>document.querySelector('h1').textContent = 'after'; missing();</script>")
    with browser_tab() as tab:
        tab.page.goto(page.as_uri())
        assert tab.page.text_content("h1") == "after"
        assert any("missing is not defined" in error for error in tab.errors)
