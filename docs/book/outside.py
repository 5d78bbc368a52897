#!/usr/bin/env python3
"""A preprocessor of mdBook: a link that leads out of the book becomes the name of what it leads to.

Pages of the book are also read among the sources, where such links work. Needs no package.
"""

import json
import posixpath
import re
import sys

LINK = re.compile(r"(?<!!)\[([^\]]*)\]\(([^)\s]+)\)")


def plain(text):
    """`text` of a page with its links to files outside taken out."""

    def replaced(link):
        words, target = link.groups()
        path = target.split("#")[0]
        if not posixpath.normpath(path).startswith("../"):
            return link.group(0)
        name = posixpath.normpath(path).removeprefix("../../../").removeprefix("../../").removeprefix("../")
        return words if name in words else f"{words} (`{name}`)"

    parts = re.split(r"(^```.*?^```)", text, flags=re.DOTALL | re.MULTILINE)
    return "".join(part if part.startswith("```") else LINK.sub(replaced, part) for part in parts)


def chapters(items):
    for item in items:
        if "Chapter" in item:
            yield item["Chapter"]
            yield from chapters(item["Chapter"]["sub_items"])


def main():
    if sys.argv[1:2] == ["supports"]:
        return
    _, book = json.load(sys.stdin)
    for chapter in chapters(book["items"]):
        chapter["content"] = plain(chapter["content"])
    json.dump(book, sys.stdout)


if __name__ == "__main__":
    main()
