"""A page as a browser reads it."""

from html.parser import HTMLParser


class Page(HTMLParser):
    """Collects tags, what they load, the visible text and the embedded data."""

    def __init__(self, text):
        super().__init__()
        self.loads = []
        self.words = []
        self.stack = []
        self.data = ""
        self._in_data = False
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        attributes = dict(attrs)
        self.loads += [v for k, v in attrs if k in ("src", "href", "srcset", "action") and v]
        self._in_data = attributes.get("id") == "data"
        if tag not in ("meta", "link", "br", "img", "input"):
            self.stack.append(tag)

    def handle_endtag(self, tag):
        assert self.stack.pop() == tag  # well-formed: nothing unescaped broke out
        self._in_data = False

    def handle_startendtag(self, tag, attrs):
        """Of a picture: opened and closed at once."""

    def handle_data(self, data):
        if self._in_data:
            self.data += data
        elif self.stack and self.stack[-1] not in ("script", "style"):
            self.words.append(data.strip())

    @property
    def text(self):
        return " ".join(word for word in self.words if word)
