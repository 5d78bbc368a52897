#!/usr/bin/env python3
"""Checks that the book is true: runs the commands of its pages and compares what they print and draw with what the pages show.

    python3 docs/book/check.py --program target/release/scrnn            all pages; 1 where something differs
    python3 docs/book/check.py --program scrnn tutorial.md --update      writes outputs and pictures anew

A page is run in a folder of its own, in which there is `assets` of the sources and a copy of what lies in docs/book/data. In blocks of the kind `console` each line that
begins with `$ ` is a command for bash, and what follows is what it prints on both streams. Lines of prose are wrapped at WIDTH.

- `...` within a line stands for anything, times and facts about the machine above all.
- A line that is `...` alone stands for any lines, or none.
- Of a training's lines of progress only the last one is compared: how many there are depends on the machine.

Comments before a block or a picture tell the rest:

    <!-- check: skip, REASON -->      the block is not run, and the reason is told
    <!-- check: fails 2 -->           the block's last command ends with this code
    <!-- check: file NAME -->         the block is the content of a file
    <!-- check: run COMMAND -->       run before what follows, and not shown
    <!-- check: from PAGE -->         this page goes on in a copy of another one's folder, which is run first
    <!-- check: picture FILE -->      the picture below is this file of the folder; FILE.html#2 is the second drawing of a page
    <!-- check: copy FILE -->         the picture below is a copy of this file of the sources
    <!-- check: table of keys -->     what stands from here to `<!-- check: end -->` is made from `scrnn schema`

Needs no package.
"""

import argparse
import difflib
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import textwrap
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
PAGES = HERE / "src"
WIDTH = 100
#: The longest that a command may take, in seconds.
LIMIT = 300
#: What is different each time, or on each machine; `--update` writes `...` in its place.
CHANGES = [
    (re.compile(r"(?<=  )[\d.,]+ (k )?epochs/s.*"), "..."),
    (re.compile(r"(?<=instruction set: )\w+"), "..."),
    (re.compile(r"(?<=instruction set )\w+(?=\))"), "..."),
    # Milliseconds of what follows a stream.
    (re.compile(r"(?<=  )(\d+ %|-)( +)[\d.]+ +[\d.]+ +[\d.]+$"), r"\1\2..."),
    (re.compile(r"^[\d.]+ ms a sample.*"), "... ms a sample, ..."),
]
#: A line of progress, which comes every few seconds; only that of the last epoch is compared.
PROGRESS = re.compile(r"(?:\S+ )?epoch (\d+)/(\d+)  ")
#: What is said while something else takes its time; a slow machine says more of it.
BUSY = re.compile(r".*, (?:\d+ min )?\d+ s|.*: epoch \d+/\d+")
DIRECTIVE = re.compile(r"<!-- check: (.*?) -->")


def wrapped(output):
    """The lines of an output, prose wrapped as a terminal of WIDTH would."""
    lines = []
    for line in output.splitlines():
        line = line.split("\r")[-1].rstrip()
        progress = PROGRESS.match(line)
        if (progress and progress[1] != progress[2]) or BUSY.fullmatch(line):
            continue
        is_prose = len(line) > WIDTH and line.count(" ") > 8 and not re.search(r"\S {2,}\S", line)
        parts = textwrap.wrap(line, WIDTH, break_long_words=False, break_on_hyphens=False) if is_prose else [line]
        lines += parts or [""]
    while lines and not lines[-1]:
        lines.pop()
    return lines


def agrees(shown, line):
    """Whether a line is as shown, `...` standing for anything."""
    return shown == line or re.fullmatch(".*".join(map(re.escape, shown.split("..."))), line) is not None


def matches(shown, lines):
    """Whether lines are as shown, a line `...` standing for any lines."""
    reached = {0}
    for pattern in shown:
        if pattern.strip() == "...":
            reached = set(range(min(reached), len(lines) + 1))
        else:
            reached = {at + 1 for at in reached if at < len(lines) and agrees(pattern, lines[at])}
        if not reached:
            return False
    return len(lines) in reached


def renewed(shown, lines):
    """What to show of lines, as long before and after a `...` as it was."""
    lines = [line for line in lines]
    for pattern, instead in CHANGES:
        lines = [pattern.sub(instead, line) for line in lines]
    cuts = [index for index, line in enumerate(shown) if line.strip() == "..."]
    if len(cuts) != 1 or len(lines) <= len(shown) - 1:
        return lines
    before, after = cuts[0], len(shown) - 1 - cuts[0]
    return lines[:before] + ["..."] + (lines[-after:] if after else [])


class Failed(Exception):
    """What differs, in words."""


class Place:
    """A folder in which a page's commands run."""

    def __init__(self, program, origin=None):
        self.folder = Path(tempfile.mkdtemp(prefix="scrnn-book-", dir="/tmp" if os.path.isdir("/tmp") else None))
        shutil.copytree(origin.work if origin else HERE / "data", self.folder / "work", symlinks=True)
        (self.folder / "bin").mkdir()
        (self.folder / "bin" / "scrnn").symlink_to(program)
        if not origin:
            (self.folder / "work" / "assets").symlink_to(HERE.parents[1] / "assets")
        # How wide a terminal is would move the ends of lines.
        kept = {key: value for key, value in os.environ.items() if not key.startswith(("SCRNN_", "COLUMNS", "LINES"))}
        self.environment = kept | {
            "PATH": f"{self.folder / 'bin'}:{os.environ['PATH']}",
            "LC_ALL": "C.UTF-8",
            "NO_COLOR": "1",
        }

    @property
    def work(self):
        return self.folder / "work"

    def run(self, command):
        """Code and output of a command."""
        done = subprocess.run(
            ["bash", "-c", command], cwd=self.work, env=self.environment, stdin=subprocess.DEVNULL, timeout=LIMIT,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, encoding="utf-8", errors="replace",
        )  # fmt: skip
        return done.returncode, done.stdout.replace(str(self.work), "~")

    def remove(self):
        shutil.rmtree(self.folder)


def commands(block):
    """The commands of a block with the lines that each is shown to print."""
    found = []
    lines = iter(block)
    for line in lines:
        if line.startswith("$ "):
            command = [line]
            while command[-1].endswith("\\"):
                command.append(next(lines))
            found.append((command, []))
        elif not found:
            raise Failed(f"a console block begins with a command, not with: {line}")
        else:
            found[-1][1].append(line)
    return found


class Page:
    """A page of the book on its way through the check."""

    def __init__(self, name, place, update):
        self.path = PAGES / name
        self.name = name
        self.place = place
        self.update = update
        self.problems = []
        self.skipped = []
        self.count = 0

    def check(self):
        """Runs the page; with `update` its text and its pictures are written anew."""
        before = self.path.read_text(encoding="utf-8")
        self.lines = before.splitlines()
        self.written = []
        self.at = 0
        pending = []
        while self.at < len(self.lines):
            line = self.lines[self.at]
            directive = DIRECTIVE.fullmatch(line.strip())
            if directive and directive[1].startswith("run "):
                self.keep()
                code, output = self.place.run(directive[1].removeprefix("run "))
                if code:
                    self.problems.append(f"{self.name}: {directive[1]} ended with {code}:\n{output}")
            elif directive and directive[1] == "table of keys":
                self.keep()
                self.table()
            elif directive and not directive[1].startswith("from "):
                pending.append(directive[1])
                self.keep()
            elif line.startswith("```"):
                self.block(pending)
                pending = []
            elif line.startswith("![") and pending and pending[-1].startswith(("picture ", "copy ")):
                kind, source = pending[-1].split(" ", 1)
                self.picture(line, HERE.parents[1] / source if kind == "copy" else self.place.work / source)
                pending = []
            else:
                if line.strip() and pending and not directive:
                    self.problems.append(f"{self.name}: line {self.at + 1}: nothing follows `check: {pending[-1]}`")
                    pending = []
                self.keep()
        if self.name == "help.md":
            self.helps()
        after = "\n".join(self.written) + "\n"
        if self.update and after != before:
            self.path.write_text(after, encoding="utf-8")

    def helps(self):
        """Asks that every command has its help on this page, and a section among the commands."""
        by_hand = re.findall(r"^## (.*)", (PAGES / "commands.md").read_text(encoding="utf-8"), re.MULTILINE)
        waiting = list(subcommands(self.place, "scrnn"))
        while waiting:
            command = waiting.pop(0)
            if more := subcommands(self.place, command):
                waiting += more
            elif f"$ {command} --help" not in self.written:
                self.problems.append(f"{self.name}: there is no help of `{command}`: add a block with `$ {command} --help`")
            if command.count(" ") == 1 and not any(command in heading for heading in by_hand):
                self.problems.append(f"commands.md: there is no section about `{command}`")

    def keep(self, count=1):
        self.written += self.lines[self.at : self.at + count]
        self.at += count

    def block(self, directives):
        first = self.at
        end = next(index for index in range(first + 1, len(self.lines)) if self.lines[index].startswith("```"))
        kind, inside = self.lines[first][3:].strip(), self.lines[first + 1 : end]
        reason = [one.removeprefix("skip, ") for one in directives if one.startswith("skip, ")]
        files = [one.removeprefix("file ") for one in directives if one.startswith("file ")]
        if files:
            path = self.place.work / files[0]
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text("\n".join(inside) + "\n", encoding="utf-8")
        if kind != "console" or reason:
            if kind == "console":
                typed = [line for line in inside if line.startswith("$ ")]
                self.skipped.append(f"{self.name}: {'; '.join(typed)}: {reason[0]}")
            self.keep(end + 1 - first)
            return
        self.keep()
        steps = commands(inside)
        wanted = next((int(one.split()[1]) for one in directives if one.startswith("fails ")), 0)
        for number, (command, shown) in enumerate(steps):
            self.count += 1
            typed = "\n".join([command[0][2:], *command[1:]])
            code, output = self.place.run(typed)
            lines = wrapped(output)
            due = wanted if number == len(steps) - 1 else 0
            if code != due:
                self.problems.append(f"{self.name}: {typed}\nended with {code}, and {due} was due:\n{output}")
            if not matches(shown, lines):
                if self.update:
                    shown = renewed(shown, lines)
                else:
                    differs = difflib.unified_diff(shown, lines, "as the book has it", "as it is", lineterm="", n=2)
                    self.problems.append(f"{self.name}: $ {typed}\n" + "\n".join(differs))
            self.written += command + shown
        self.at = end
        self.keep()

    def picture(self, line, source):
        target = PAGES / re.search(r"\]\(([^)]+)\)", line)[1]
        name, _, number = source.name.partition("#")
        made = source.with_name(name).read_text(encoding="utf-8")
        if number:
            drawings = re.findall(r"<svg.*?</svg>", made, re.DOTALL)
            made = drawings[int(number) - 1] + "\n"
        self.count += 1
        if self.update:
            target.parent.mkdir(exist_ok=True)
            target.write_text(made, encoding="utf-8")
        elif not target.exists() or target.read_text(encoding="utf-8") != made:
            self.problems.append(f"{self.name}: {target.name} is not as {source.name} is drawn today")
        self.keep()

    def table(self):
        """The keys of the experiment file, as the program knows them."""
        code, output = self.place.run("scrnn schema")
        if code:
            raise Failed(output)
        end = next(index for index in range(self.at, len(self.lines)) if self.lines[index].strip() == "<!-- check: end -->")
        schema = json.loads(output)
        made = ["", *keys(schema), ""]
        by_hand = (PAGES / "experiment.md").read_text(encoding="utf-8")
        names = {name for part in [schema, *schema["$defs"].values()] for name in part.get("properties", {})}
        for name in sorted(name for name in names if not re.search(rf"\b{name}\b", by_hand)):
            self.problems.append(f"experiment.md: the key {name} is not explained")
        if self.update:
            self.written += made
        elif self.lines[self.at : end] != made:
            differs = difflib.unified_diff(self.lines[self.at : end], made, "as the book has it", "as it is", lineterm="", n=1)
            self.problems.append(f"{self.name}: the table of keys\n" + "\n".join(differs))
        self.count += 1
        self.at = end
        self.keep()


def subcommands(place, command):
    """The commands below a command, as its help lists them."""
    _, output = place.run(f"{command} --help")
    listed = re.search(r"^Commands:\n(.*?)\n\n", output, re.DOTALL | re.MULTILINE)
    names = re.findall(r"^  ([a-z]\S*)  ", listed[1], re.MULTILINE) if listed else []
    return [f"{command} {name}" for name in names if name != "help"]


def keys(schema):
    """A table for each part of the experiment, from its JSON schema."""
    lines = []

    def resolve(one):
        for other in [one, *one.get("anyOf", []), *one.get("allOf", []), *one.get("oneOf", [])]:
            if "$ref" in other:
                return schema["$defs"][other["$ref"].split("/")[-1]]
        return one

    def kind(one):
        if "const" in one:
            return f"`{json.dumps(one['const'])}`"
        if "enum" in one:
            return " or ".join(f"`{json.dumps(value)}`" for value in one["enum"] if value is not None)
        if "$ref" in one:
            return kind(resolve(one))
        choices = [kind(other) for key in ("anyOf", "oneOf", "allOf") for other in one.get(key, []) if other.get("type") != "null"]
        if choices:
            return " or ".join(dict.fromkeys(choices))
        names = one.get("type", "anything")
        names = [name for name in ([names] if isinstance(names, str) else names) if name != "null"]
        if names == ["array"]:
            return f"list of {kind(one['items'])}" if "items" in one else "list"
        if names == ["object"]:
            return "table"
        return " or ".join({"integer": "whole number", "boolean": "true or false", "string": "text"}.get(n, n) for n in names)

    def section(name, one):
        rows, below = [], []
        for key, value in one.get("properties", {}).items():
            inner = resolve(value["items"] if "items" in value else value)
            if inner.get("type") == "object" and "properties" in inner:
                mark = f"[[{name + '.' if name else ''}{key}]]" if "items" in value else f"[{name + '.' if name else ''}{key}]"
                below.append((f"{name + '.' if name else ''}{key}", inner, mark))
                continue
            words = " ".join(value.get("description", inner.get("description", "")).split())
            words = re.sub(r"\[(`[^`]*`)\](\([^)]*\))?", r"\1", words).replace("|", "\\|")
            start = value.get("default")
            given = key in one.get("required", [])
            default = "needed" if given else "" if start is None else f"`{json.dumps(start)}`"
            rows.append(f"| `{key}` | {kind(value)} | {default} | {words} |")
        if rows:
            lines.extend(["| Key | Value | Default | Meaning |", "|---|---|---|---|", *rows, ""])
        for name, inner, mark in below:
            lines.extend([f"## {mark}", "", " ".join(re.sub(r"\[(`[^`]*`)\](\([^)]*\))?", r"\1", inner.get("description", "")).split()), ""])
            section(name, inner)

    section("", schema)
    while lines and not lines[-1]:
        lines.pop()
    return lines


def pages():
    """Names of the pages, in the order of the book."""
    return re.findall(r"\]\(([^)]+\.md)\)", (PAGES / "SUMMARY.md").read_text(encoding="utf-8"))


def left_out():
    """Pages and documents that the book does not have."""
    known = pages()
    strangers = [f"src/{path.name} is not in SUMMARY.md" for path in PAGES.glob("*.md") if path.name not in [*known, "SUMMARY.md"]]
    texts = "".join((PAGES / name).read_text(encoding="utf-8") for name in known)
    return strangers + [
        f"docs/{path.name} is on no page" for path in HERE.parent.glob("*.md") if f"{{{{#include ../../{path.name}}}}}" not in texts
    ]


def origin(name):
    """The page in whose folder this one goes on."""
    found = re.search(r"<!-- check: from (\S+) -->", (PAGES / name).read_text(encoding="utf-8"))
    return found[1] if found else None


def dead_links(site):
    """Links of a built book that lead nowhere within it."""
    found = []
    for path in sorted(site.rglob("*.html")):
        for target in re.findall(r'(?:href|src)="([^"]+)"', path.read_text(encoding="utf-8")):
            file, _, heading = target.partition("#")
            if re.match(r"[a-z]+:|//|/", target):
                continue
            other = (path.parent / file) if file else path
            if not other.exists():
                found.append(f"{path.name}: {target}")
            elif heading and other.suffix == ".html" and f'id="{heading}"' not in other.read_text(encoding="utf-8"):
                found.append(f"{path.name}: {target}: no such heading")
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default="scrnn", help="the program to run")
    parser.add_argument("--update", action="store_true", help="write outputs and pictures anew")
    parser.add_argument("--site", type=Path, help="instead: look for dead links in a built book")
    parser.add_argument("pages", nargs="*", help="pages to check [default: all]")
    options = parser.parse_args()
    if options.site:
        dead = dead_links(options.site)
        print("\n".join(dead) or "no dead links")
        return bool(dead)
    program = shutil.which(options.program)
    if not program:
        sys.exit(f"there is no program {options.program}; build it: cargo build --release -p scrnn-cli")
    unknown = set(options.pages) - set(pages())
    if unknown:
        sys.exit(f"not in SUMMARY.md: {', '.join(sorted(unknown))}")

    chosen = set(options.pages or pages())
    while more := {origin(name) for name in chosen} - chosen - {None}:
        chosen |= more
    places, problems, skipped, count, begun = {}, left_out(), [], 0, time.monotonic()
    try:
        for name in (one for one in pages() if one in chosen):
            places[name] = Place(Path(program).resolve(), places.get(origin(name)))
            page, start = Page(name, places[name], options.update), time.monotonic()
            try:
                page.check()
            except (Failed, OSError, subprocess.TimeoutExpired, IndexError) as error:
                page.problems.append(f"{name}: {error}")
            problems += page.problems
            skipped += page.skipped
            count += page.count
            if page.count:
                print(f"{name}: {page.count} commands and pictures, {time.monotonic() - start:.1f} s", flush=True)
    finally:
        for place in places.values():
            place.remove()
    for one in skipped:
        print(f"not run: {one}")
    print("\n\n".join(["", *problems, ""]) if problems else "", end="")
    print(f"{count} commands and pictures in {time.monotonic() - begun:.0f} s, {len(skipped)} not run, {len(problems)} wrong")
    return bool(problems)


if __name__ == "__main__":
    sys.exit(main())
