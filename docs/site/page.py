#!/usr/bin/env python3
# SPDX-FileCopyrightText: 2026 The cairn authors
# SPDX-License-Identifier: MIT
"""Turns one of docs/*.md, as GitHub shows it, into what Doxygen reads: page.py FILE, to the standard output.

  headings     get the ids that GitHub gives them, with the name of the page before (Doxygen's are global)
  links        to other pages and their headings become references, those to any other file of the project links to sources/
  <!-- site: NAME | words -->   becomes the figure figures/NAME.svg or figures/NAME.png with these words below, or,
               for the NAME `course`, the place of the lessons (make_site.py)
  ![words](site/NAME)           a picture kept beside this file, likewise
"""
import html
import os
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
FENCE = re.compile(r"^\s*```")
HEADING = re.compile(r"^(#{1,4}) (.*?)\s*$")
LINK = re.compile(r"\]\(([^)\s]+)\)")
IMAGE = re.compile(r"!\[(.*?)\]\(site/([^)\s]+)\)")
FIGURE = re.compile(r"<!-- site: (\S+)(?: \| (.*?))? -->")


def label_of(page):
    """Of a page of docs/: its name, but "index" is the first page of a site."""
    return {"index": "indices"}.get(page, page)


def slug_of(heading):
    """GitHub's id of a heading."""
    text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).replace("`", "")
    return re.sub(r"[^\w\- ]", "", text.strip().lower()).replace(" ", "-")


def source_page(path):
    """The page of the site that shows a file of the project."""
    return "sources/" + path.replace("/", "-") + ".html"


def link_target(target, page, folder):
    if re.match(r"[a-z]+:", target):
        return target
    path, _, anchor = target.partition("#")
    label = label_of(page)
    if not path:
        return f"#{label}-{anchor}"
    resolved = os.path.normpath(folder / path)
    if re.fullmatch(r"docs/(site/)?\w+\.md", resolved):
        other = label_of(pathlib.PurePath(resolved).stem)
        return f"#{other}-{anchor}" if anchor else f"#{other}"
    if not (ROOT / resolved).is_file():
        sys.exit(f"{folder}/{page}.md: there is no file {resolved}, to which a link leads")
    return source_page(resolved)


def figure(match):
    name, words = match.group(1), match.group(2) or ""
    if name == "course":
        return '\\htmlonly<div id="site-course"></div>\\endhtmlonly'
    return picture(name, words)


def picture(name, words):
    words = html.escape(words)
    return (f'\\htmlonly<figure><img src="figures/{name}" alt="{words}"/><figcaption>{words}</figcaption></figure>'
            "\\endhtmlonly")


def outside_code(line, change):
    """`change` of all of the line but what stands between backticks."""
    parts = re.split(r"(`[^`]*`)", line)
    return "".join(part if part.startswith("`") else change(part) for part in parts)


def filtered(path):
    path = pathlib.Path(os.path.relpath(path, ROOT))
    page, folder = path.stem, path.parent
    label = label_of(page)
    code, out = False, []
    for line in (ROOT / path).read_text(encoding="utf-8").split("\n"):
        if FENCE.match(line):
            code = not code
            line = line.replace("```cpp", "```{.cpp}").replace("```cmake", "```{.cmake}").replace("```sh", "```{.sh}")
        elif not code:
            heading = HEADING.match(line)
            line = IMAGE.sub(lambda found: picture(found.group(2), found.group(1)), line)
            # A link's words may hold backticks, so links are seen before them.
            line = LINK.sub(lambda found: f"]({link_target(found.group(1), page, folder)})", line)
            line = FIGURE.sub(figure, line)
            if heading:
                words = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading.group(2))
                name = label if len(heading.group(1)) == 1 else f"{label}-{slug_of(heading.group(2))}"
                line = f"{heading.group(1)} {words} {{#{name}}}"
            elif "\\htmlonly" not in line:
                line = outside_code(line, lambda text: text.replace("@", "\\@"))
        out.append(line)
    return "\n".join(out)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    sys.stdout.write(filtered(sys.argv[1]))
