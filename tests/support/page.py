"""An HTML page as a test reads it: elements with their attributes and texts, in order."""

import re
from dataclasses import dataclass, field
from html.parser import HTMLParser

VOID = {"meta", "input", "br", "hr", "img", "link"}


@dataclass
class Element:
    """One element; `text` is all of the text in it."""

    tag: str
    attributes: dict
    ancestors: tuple = ()
    text: str = ""
    children: list = field(default_factory=list)

    def all(self, *tags):
        """Elements within it that have one of these tags."""
        for child in self.children:
            if child.tag in tags:
                yield child
            yield from child.all(*tags)


class Reader(HTMLParser):
    """Reads a page, and insists that every element is closed where it was opened."""

    def __init__(self, page):
        super().__init__(convert_charrefs=True)
        self.root = Element("", {})
        self.open = [self.root]
        self.feed(page)
        self.close()
        assert [e.tag for e in self.open] == [""], "an element is not closed"

    def handle_starttag(self, tag, attrs):
        names = [name for name, _ in attrs]
        assert len(names) == len(set(names)), f"an attribute is given twice: {tag} {names}"
        made = Element(tag, dict(attrs), tuple(self.open))
        self.open[-1].children.append(made)
        if tag not in VOID:
            self.open.append(made)

    def handle_startendtag(self, tag, attrs):
        self.open[-1].children.append(Element(tag, dict(attrs), tuple(self.open)))

    def handle_endtag(self, tag):
        assert self.open[-1].tag == tag, f"{tag} ends where {self.open[-1].tag} is open"
        self.open.pop()

    def handle_data(self, data):
        for element in self.open:
            element.text += data


def read(page):
    """Root of a page."""
    return Reader(page).root


def palettes(style):
    """Variables of the style: of light, dark and print."""
    blocks = re.findall(r":root \{(.*?)\}", style, re.DOTALL)
    found = [dict(re.findall(r"--([\w-]+): (#[0-9a-f]{6});", block)) for block in blocks]
    light, dark, paper = found
    return {"light": light, "dark": light | dark, "print": light | paper}


def luminance(color):
    """Relative luminance of a color #rrggbb, as WCAG 2 defines it."""
    channels = [int(color[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(one, other):
    """Contrast ratio of two colors."""
    low, high = sorted((luminance(one), luminance(other)))
    return (high + 0.05) / (low + 0.05)
