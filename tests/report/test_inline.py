"""Drawings inside a page: the figures of a campaign are, and nothing that could do more than be seen is."""

import pytest

from fourpole.report.html import inline

HEAD = '<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" viewBox="0 0 9 9">'


def drawn(inside):
    return inline(f"{HEAD}{inside}</svg>", 'a "b" <c>')


def test_shapes_texts_and_links_within_the_page_stay():
    found = drawn(
        '<style type="text/css">*{stroke-linejoin: round}</style><g style="clip-path: url(#p1)"><text x="1">&lt;D3&gt;'
        '</text><a xlink:href="#dynamic-3"><title>D3</title><use xlink:href="#m1"/></a></g>'
    )
    assert found.startswith('<svg role="group" aria-label="a &#34;b&#34; &lt;c&gt;" xmlns=')
    assert '<a tabindex="-1" xlink:href="#dynamic-3">' in found
    assert "&lt;D3&gt;" in found
    assert "<style" not in found


@pytest.mark.parametrize(
    "inside",
    [
        "<script>alert(1)</script>",
        "<g onclick='alert(1)'/>",
        "<foreignObject/>",
        "<a xlink:href='javascript:alert(1)'/>",
        "<a xlink:href='http://example.org'/>",
        "<image xlink:href='http://example.org/x.png'/>",
        "<image xlink:href='data:image/svg+xml;base64,AAAA'/>",
        "<rect style='fill: url(http://example.org/x)'/>",
        "<animate attributeName='x'/>",
        "<g href='#x'/>",
        "<x:g xmlns:x='http://example.org'/>",
        "<g>",
        "<!-- a comment -->",
    ],
)
def test_anything_else_makes_it_an_image(inside):
    assert drawn(inside) is None


def test_declarations_are_not_read():
    assert inline(f'<!DOCTYPE svg [<!ENTITY a "b">]>{HEAD}</svg>', "x") is None
    assert inline("<html/>", "x") is None
