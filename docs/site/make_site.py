#!/usr/bin/env python3
# SPDX-FileCopyrightText: 2026 The cairn authors
# SPDX-License-Identifier: MIT
"""make_site.py SITE COURSE: makes the site of scripts/docs in the folder SITE, from docs/, the headers, and the results of
scripts/course in the folder COURSE.
make_site.py picture PAGE FIGURE WIDTHxHEIGHT PNG: a picture of one figure of a report page, as README.md has one.
make_site.py links: looks at the links of the documents only, as GitHub shows them. Ends with 1, and a line for each fault, where a link leads nowhere, a picture is missing, a page
asks for something from a network or is wider than a phone, or Doxygen does not understand a page of docs/."""
import concurrent.futures
import csv
import html
import html.parser
import json
import math
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import urllib.parse
import xml.etree.ElementTree as ElementTree

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[1]
sys.path.insert(0, str(HERE))
sys.dont_write_bytecode = True
import page  # noqa: E402


# ---------------------------------------------------------------------------------------------------------------- pages

def version():
    text = (ROOT / "include/cairn/version.hpp").read_text(encoding="utf-8")
    return re.search(r'CAIRN_VERSION_STRING "(.*)"', text).group(1)


def framed(site, name, title, body):
    """A page of our own, with the header and the footer that Doxygen gives its own."""
    up = "../" * name.count("/")
    header = (HERE / "header.html").read_text(encoding="utf-8").replace('<div id="top">\n', "")
    text = header + body + (HERE / "footer.html").read_text(encoding="utf-8")
    text = text.replace("$relpath^", up).replace("$projectnumber", version()).replace("$title", html.escape(title))
    (site / name).parent.mkdir(parents=True, exist_ok=True)
    (site / name).write_text(text, encoding="utf-8")


def run_doxygen(site):
    """Faults of pages are returned; what Doxygen does not understand of C++20 in headers is left in doxygen.log."""
    settings = (HERE / "Doxyfile").read_text(encoding="utf-8") + "\nGENERATE_TAGFILE = $(SITE)/names.xml\n"
    subprocess.run(["doxygen", "-"], cwd=ROOT, input=settings, text=True, check=True,
                   env={**os.environ, "SITE": str(site), "VERSION": version()})
    # What the filter of headers (header.py) is for: Doxygen loses types without a word.
    lost = [f"the type {name} is not in the reference" for name in ("Kalman", "Extended", "Unscented", "Gaussian", "KdTree", "MultiKdTree")
            if not any((site / f"{kind}cairn_1_1{name}.html").is_file() for kind in ("struct", "class"))]
    log = (site / "doxygen.log").read_text(encoding="utf-8")
    return lost + [line for line in log.splitlines() if re.match(rf"({re.escape(str(ROOT))}/)?docs/.*(warning|error)", line)]


def tidied(site):
    """Doxygen's pages without its scripts, which a site that is read does without, and with what screen readers ask for."""
    for path in site.glob("*.html"):
        text = path.read_text(encoding="utf-8")
        text = re.sub(r"<script\b.*?</script>\s*", "", text, flags=re.DOTALL)
        text = re.sub(r' on(click|mouse\w+|key\w+|focus|blur)="[^"]*"', "", text)
        text = re.sub(r'<div class="levels">.*?</div>', "", text, flags=re.DOTALL)
        text = text.replace(' style="display:none;"', "")  # rows of lists that a script would have unfolded
        text = re.sub(r'<a href="javascript:[^"]*"[^>]*>(.*?)</a>', r"\1", text, flags=re.DOTALL)
        text = re.sub(r'<div class="headertitle">\s*<div class="title">(.*?)</div>\s*</div>',
                      r'<div class="headertitle"><h1 class="title">\1</h1></div>', text, flags=re.DOTALL)
        # Doxygen shows the tags of code in a heading instead of following them.
        text = re.sub(r"&lt;(/?)tt&gt;", r"<\1code>", text)
        # What scrolls can be reached by the keyboard.
        text = re.sub(r'<(div|pre) class="(fragment|memproto)">', r'<\1 class="\2" tabindex="0">', text)
        # Doxygen begins the headings below a page's title at 1.
        if '<div class="textblock">' in text:
            for level in (3, 2, 1):
                text = re.sub(rf'<h{level}>(<a class="anchor"|<a id=)(.*?)</h{level}>', rf"<h{level + 1}>\1\2</h{level + 1}>",
                              text, flags=re.DOTALL)
        path.write_text(text, encoding="utf-8")
    for script in ("jquery.js", "dynsections.js", "menu.js", "menudata.js", "doxygen.svg", "tabs.css", "doxygen.css"):
        (site / script).unlink(missing_ok=True)


def find_page(site):
    """All names of the library, narrowed by what is typed; without JavaScript a list."""
    rows = []
    for compound in ElementTree.parse(site / "names.xml").getroot():
        kind, name, file = compound.get("kind"), compound.findtext("name"), compound.findtext("filename")
        if kind in ("class", "struct", "union", "concept") and file:
            if "detail::" not in name:
                rows.append((name, file if file.endswith(".html") else file + ".html", kind))
        for member in compound.findall("member"):
            scope = name + "::" if kind in ("class", "struct", "namespace") else ""
            file = member.findtext("anchorfile")
            if not file or kind == "file" and member.get("kind") != "define" or "detail::" in scope:
                continue
            rows.append((scope + member.findtext("name"), f"{file}#{member.findtext('anchor')}", member.get("kind")))
    rows = sorted(set(rows), key=lambda row: row[0].lower())
    (site / "names.xml").unlink()
    items = "".join(f'<li><a href="{html.escape(link)}">{html.escape(name)}</a> <small>{kind}</small></li>\n'
                    for name, link, kind in rows)
    framed(site, "find.html", "Find a name", f"""<h1>Find a name</h1>
<p><label for="wanted">{len(rows)} names of the library; type a part of one:</label></p>
<p><input class="find-box" id="wanted" type="search" autocomplete="off"/></p>
<ul class="find" id="names">
{items}</ul>
<script>
const box = document.getElementById('wanted');
const items = [...document.getElementById('names').children];
box.addEventListener('input', () => {{
  const wanted = box.value.toLowerCase();
  for (const item of items) item.hidden = !item.firstChild.textContent.toLowerCase().includes(wanted);
}});
</script>
""")


class Links(html.parser.HTMLParser):
    """What a page has, and what it asks for."""

    def __init__(self, text):
        super().__init__(convert_charrefs=True)
        self.ids, self.links, self.loads = set(), [], []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        attributes = dict(attributes)
        for name in ("id", "name"):
            if attributes.get(name) and (name == "id" or tag == "a"):
                self.ids.add(attributes[name])
        if tag == "a" and attributes.get("href"):
            self.links.append(attributes["href"])
        elif tag in ("link", "image") and attributes.get("href"):
            self.loads.append(attributes["href"])
        elif attributes.get("src"):
            self.loads.append(attributes["src"])


def source_pages(site):
    """The files of the project to which pages lead."""
    wanted = set()
    for path in site.glob("*.html"):
        wanted.update(re.findall(r'href="(sources/[^"#]+\.html)"', path.read_text(encoding="utf-8")))
    files = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True).stdout.split()
    if not files:  # an archive
        files = [path.relative_to(ROOT).as_posix() for folder in ("docs", "examples", "include", "scripts", "tests", "benchmarks")
                 for path in (ROOT / folder).rglob("*") if path.is_file()] + ["README.md", "CONTRIBUTING.md"]
    by_page = {page.source_page(file): file for file in files}
    for name in sorted(wanted & by_page.keys()):
        text = html.escape((ROOT / by_page[name]).read_text(encoding="utf-8"))
        framed(site, name, by_page[name], f"<h1>{html.escape(by_page[name])}</h1>\n<pre tabindex=\"0\">{text}</pre>\n")


# ------------------------------------------------------------------------------------------------------------- pictures

INKS = ("#15181d", "#1f6feb", "#c65d00", "#0b7a70", "#8250df", "#6a737d")
DASHES = ("", "10 4", "3 4", "12 4 3 4", "6 6", "2 2")


def nice_ticks(low, high, logarithmic):
    if logarithmic:
        return [10.0 ** p for p in range(math.ceil(low - 1e-9), math.floor(high + 1e-9) + 1)]
    step = 10 ** math.floor(math.log10((high - low) / 4))
    step = next(step * f for f in (1, 2, 5, 10) if (high - low) / (step * f) <= 6)
    return [i * step for i in range(math.ceil(low / step), math.floor(high / step) + 1)]


def short(value):
    if value == 0:
        return "0"
    power = math.floor(math.log10(abs(value)))
    if power >= 5 or power <= -3:
        mantissa = value / 10 ** power
        return (f"{mantissa:g}·" if abs(mantissa - 1) > 1e-9 else "") + "10" + str(power).translate(
            str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
    return f"{value:g}"


def draw(path, title, x_label, y_label, curves, logarithmic=False):
    """An SVG of curves (name, [(x, y), ...]), told apart by dashes and by their names at their ends."""
    width, height, left, right, top, bottom = 860, 430, 76, 170, 44, 56
    scale = (lambda v: math.log10(v)) if logarithmic else (lambda v: v)
    points = [(scale(x), scale(y)) for _, curve in curves for x, y in curve if not logarithmic or (x > 0 and y > 0)]
    x0, x1 = min(p[0] for p in points), max(p[0] for p in points)
    y0, y1 = min(p[1] for p in points), max(p[1] for p in points)
    if not logarithmic:
        x0, y0 = min(0, x0), min(0, y0)
    px = lambda x: left + (scale(x) - x0) / (x1 - x0) * (width - left - right)
    py = lambda y: height - bottom - (scale(y) - y0) / (y1 - y0) * (height - top - bottom)
    out = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" font-family="system-ui, sans-serif" font-size="13">',
           f'<rect width="{width}" height="{height}" fill="#ffffff"/>',
           f'<text x="{left}" y="24" font-size="16" font-weight="600" fill="#1b1f24">{html.escape(title)}</text>']
    for tick in nice_ticks(x0, x1, logarithmic):
        out.append(f'<path d="M{px(tick):.1f} {top}V{height - bottom}" stroke="#e3e6ea"/>'
                   f'<text x="{px(tick):.1f}" y="{height - bottom + 18}" text-anchor="middle" fill="#505a66">{short(tick)}</text>')
    for tick in nice_ticks(y0, y1, logarithmic):
        out.append(f'<path d="M{left} {py(tick):.1f}H{width - right}" stroke="#e3e6ea"/>'
                   f'<text x="{left - 8}" y="{py(tick) + 4:.1f}" text-anchor="end" fill="#505a66">{short(tick)}</text>')
    out.append(f'<text x="{(left + width - right) / 2}" y="{height - 14}" text-anchor="middle" fill="#1b1f24">{html.escape(x_label)}</text>'
               f'<text transform="translate(18 {(top + height - bottom) / 2}) rotate(-90)" text-anchor="middle" fill="#1b1f24">{html.escape(y_label)}</text>')
    ends = []
    for i, (name, curve) in enumerate(curves):
        curve = [(x, y) for x, y in curve if not logarithmic or (x > 0 and y > 0)]
        ink, dash = INKS[i % len(INKS)], DASHES[i % len(DASHES)]
        way = " ".join(f"{px(x):.1f},{py(y):.1f}" for x, y in curve)
        out.append(f'<polyline points="{way}" fill="none" stroke="{ink}" stroke-width="2" stroke-dasharray="{dash}"/>')
        ends.append([py(curve[-1][1]), px(curve[-1][0]), name, ink])
    ends.sort()
    for above, below in zip(ends, ends[1:]):  # names do not lie on one another
        below[0] = max(below[0], above[0] + 15)
    for y, x, name, ink in ends:
        out.append(f'<text x="{x + 6:.1f}" y="{y + 4:.1f}" fill="{ink}">{html.escape(name)}</text>')
    path.write_text("\n".join(out) + "\n</svg>\n", encoding="utf-8")


def figures(site):
    """README's picture for the first page and docs/grid.md's; those of docs/multi_kd_tree.md, from the counters of lesson 07 at its longest."""
    folder = site / "figures"
    folder.mkdir(exist_ok=True)
    for name in ("visual_slam.png", "aces_maps.png"):
        shutil.copy(HERE / name, folder)
    with tempfile.TemporaryDirectory() as results:
        subprocess.run([str(ROOT / "build/release/examples/07_growing_forest"), "--steps", "1500", "--quiet", "--out", results],
                       check=True, stdout=subprocess.DEVNULL)
        with open(pathlib.Path(results) / "work.csv", encoding="utf-8") as file:
            rows = [{name: float(value) for name, value in row.items()} for row in csv.DictReader(file)]
    curve = lambda name: [(32 * row["step"], row[name]) for row in rows]
    draw(folder / "forest_work.svg", "Work so far", "points in the set", "moves of points, all steps together",
         [("n log² n", curve("n_log2_n")), ("the forest", curve("sum")), ("built anew each step", curve("anew"))], True)
    alone = [(x, y - before) for (x, y), (_, before) in zip(curve("anew")[1:], curve("anew"))]
    worst, highest = [], 0
    for x, y in curve("moves"):
        highest = max(highest, y)
        worst.append((x, highest))
    mean = [(32 * row["step"], row["sum"] / row["step"]) for row in rows]
    draw(folder / "forest_steps.svg", "Work of one step", "points in the set", "moves of points",
         [("built anew", alone), ("worst so far", worst), ("mean so far", mean)], True)


def chromium():
    for name in ("chromium", "chromium-browser", "google-chrome"):
        if shutil.which(name):
            return name
    return None


# Software draws, 3-D figures too: the same picture everywhere, and no second process for a GPU that is not there.
HEADLESS = ("--headless", "--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader", "--disable-dev-shm-usage", "--no-first-run")


def screenshot(browser, page_file, query, target, width, height):
    with tempfile.TemporaryDirectory(prefix="cairn-docs-", ignore_cleanup_errors=True) as profile:
        done = subprocess.run(
            [browser, *HEADLESS, "--hide-scrollbars", "--virtual-time-budget=4000", f"--user-data-dir={profile}",
             f"--window-size={width},{height}", f"--screenshot={target}", page_file.resolve().as_uri() + query],
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, timeout=300)
    return done.returncode == 0 and target.is_file()


def lesson_folders(course):
    return sorted(course.glob("[0-9][0-9]_*"))


# A picture of a lesson's figure; all stand in one image, row by row, since starting a browser takes longer than all of them.
FIGURE_WIDTH, FIGURE_HEIGHT, FIGURES_IN_A_ROW = 640, 720, 4

# The figure of a lesson's page that stands for it; the first, where none is named.
SHOWN = {"12_visual_slam": 2}


def place_of(index):
    return index % FIGURES_IN_A_ROW * FIGURE_WIDTH, index // FIGURES_IN_A_ROW * FIGURE_HEIGHT


def size_of(count):
    return min(count, FIGURES_IN_A_ROW) * FIGURE_WIDTH, -(-count // FIGURES_IN_A_ROW) * FIGURE_HEIGHT


def lesson_pictures(browser, folders, target):
    """A picture of all lessons' figures as an image; whether there is one."""
    frames = ""
    for index, folder in enumerate(folders):
        left, top = place_of(index)
        shown = f"{(folder / 'index.html').as_uri()}?theme=light&figure={SHOWN.get(folder.name, 1)}"
        frames += (f'<iframe src="{html.escape(shown)}" width="{FIGURE_WIDTH}" height="{FIGURE_HEIGHT}" scrolling="no"'
                   f' style="position: absolute; left: {left}px; top: {top}px; border: 0"></iframe>\n')
    with tempfile.TemporaryDirectory() as place:
        sheet = pathlib.Path(place) / "figures.html"
        sheet.write_text(f'<!doctype html>\n<body style="margin: 0">\n{frames}', encoding="utf-8")
        return screenshot(browser, sheet, "", target, *size_of(len(folders)))


def lesson_pages(site, course, browsing):
    """Copies each lesson's page, and has a picture of their figures taken; returns what will say whether there is one, or nothing
    where there is no browser."""
    targets = []
    for folder in lesson_folders(course):
        target = site / "lessons" / folder.name
        if not (folder / "index.html").is_file():
            sys.exit(f"docs: {folder} has no page: the lessons were built without npm (scripts/install demo)")
        shutil.copytree(folder, target, ignore=shutil.ignore_patterns("mistakes"), dirs_exist_ok=True)
        targets.append(target)
    browser = chromium()
    if browser is None:
        print("docs: no chromium, so the lessons go without pictures", file=sys.stderr)
        return None
    return browsing.submit(lesson_pictures, browser, targets, site / "lessons" / "figures.png")


def gallery(site, course, with_pictures):
    """The list of the lessons, with the pictures that are being taken."""
    items, folders = [], lesson_folders(course)
    width, height = size_of(len(folders))
    for index, folder in enumerate(folders):
        about = subprocess.run([str(ROOT / "build/release/examples" / folder.name), "--about"], capture_output=True, text=True,
                               check=True).stdout.splitlines()
        picture = ""
        if with_pictures:
            left, top = place_of(index)
            picture = (f'<svg role="img" aria-label="A figure of the lesson\'s page" viewBox="{left} {top} {FIGURE_WIDTH} {FIGURE_HEIGHT}">'
                       f'<image href="lessons/figures.png" width="{width}" height="{height}"/></svg>')
        source = page.source_page(f"examples/{folder.name}/main.cpp")
        items.append(f'<li>{picture}<h2>{html.escape(about[0])}</h2><p>{html.escape(about[1])}</p>'
                     f'<p><a href="lessons/{folder.name}/index.html">Its page</a>, <a href="{source}">the program</a></p></li>')
    listed = '<ul class="lessons">' + "\n".join(items) + "</ul>"
    path = site / "course.html"
    text = path.read_text(encoding="utf-8")
    if '<div id="site-course"></div>' not in text:
        sys.exit("docs: docs/course.md has no place for the lessons: <!-- site: course -->")
    path.write_text(text.replace('<div id="site-course"></div>', listed), encoding="utf-8")


# ---------------------------------------------------------------------------------------------------------------- faults

def link_faults(site):
    """One for each link that leads nowhere, and each thing that would be loaded from elsewhere."""
    pages = {path.relative_to(site).as_posix(): Links(path.read_text(encoding="utf-8")) for path in site.rglob("*.html")}
    checked = 0
    for name, found in pages.items():
        for target in found.loads:
            if re.match(r"(https?:)?//", target):
                yield f"{name} loads {target} from a network"
        for target in found.links + found.loads:
            checked += 1
            if re.match(r"(https?|mailto|data):", target):
                continue
            path, _, anchor = urllib.parse.unquote(target).partition("#")
            goal = os.path.normpath(os.path.join(os.path.dirname(name), path)) if path else name
            if not (site / goal).is_file():
                yield f"{name} leads to {target}, which is not there"
            elif anchor and goal in pages and anchor not in pages[goal].ids:
                yield f"{name} leads to {target}, and there is no such place in that page"
    for sheet in site.rglob("*.css"):
        if re.search(r"(url\(|@import)\s*[\"']?(https?:)?//", sheet.read_text(encoding="utf-8")):
            yield f"{sheet.name} loads something from a network"
    print(f"docs: {len(pages)} pages, {checked} links and pictures looked at")


def mended(site):
    """Doxygen leads to members that it then leaves out (defaulted friends, sections that ended up empty): such links of its own pages lead
    to the page. Those of docs/*.md stay as they are, to be found wrong."""
    ids, own = {}, {page.label_of(path.stem) + ".html" for path in (ROOT / "docs").glob("*.md")} | {"index.html"}
    for path in site.glob("*.html"):
        ids[path.name] = set(re.findall(r'\b(?:id|name)="([^"]*)"', path.read_text(encoding="utf-8")))
    for path in site.glob("*.html"):
        if path.name in own:
            continue
        text = path.read_text(encoding="utf-8")

        def lead(match):
            name, anchor = match.group(1) or path.name, match.group(2)
            return match.group(0) if name not in ids or anchor in ids[name] else f'href="{name}"'

        changed = re.sub(r'href="([^"#:]*)#([^"]+)"', lead, text)
        changed = re.sub(r'<a href="file:line">(.*?)</a>', r"\1", changed)
        if changed != text:
            path.write_text(changed, encoding="utf-8")


def readme_faults():
    """Links of the documents as GitHub shows them, and code that doxygen would show as markup."""
    for path in [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]:
        text = re.sub(r"^```.*?^```", "", path.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
        for span in re.findall(r"`([^`]+)`", text):
            if "'" in span:
                yield f"{path.relative_to(ROOT)}: doxygen takes the apostrophe in `{span}` for the end of the code: write it without one, or without backticks"
        for target in re.findall(r"\]\(([^)\s]+)\)", text):
            if re.match(r"[a-z]+:", target):
                continue
            name, _, anchor = target.partition("#")
            goal = (path.parent / name) if name else path
            if not goal.exists():
                yield f"{path.relative_to(ROOT)} leads to {target}, which is not there"
            elif anchor and goal.suffix == ".md":
                body = re.sub(r"^```.*?^```", "", goal.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
                if anchor not in {page.slug_of(found) for found in re.findall(r"^#+ (.*)$", body, flags=re.MULTILINE)}:
                    yield f"{path.relative_to(ROOT)} leads to {target}, and there is no such heading"


# Each page is written into a frame as wide as a phone: sending the frame to the page instead takes three times as long.
PHONE = """<!doctype html>
<body>
<script>
(async () => {
  const names = NAMES, faults = [];
  const textOf = (name) => new Promise((done) => {
    const file = new XMLHttpRequest();
    file.open('GET', SITE + name);
    file.onloadend = () => done(file.responseText);
    file.send();
  });
  const look = async () => {
    const phone = document.body.appendChild(Object.assign(document.createElement('iframe'), { width: 390, height: 844 }));
    phone.style.visibility = 'hidden';
    while (names.length > 0) {
      const name = names.pop();
      const text = await textOf(name);
      await new Promise((loaded) => {
        phone.onload = loaded;
        phone.contentDocument.open();
        phone.contentDocument.write(text.replace('<head>', `<head><base href="${SITE}">`));
        phone.contentDocument.close();
      });
      const page = phone.contentDocument.documentElement;
      if (!phone.contentDocument.querySelector('main') || phone.contentDocument.styleSheets.length === 0)
        faults.push(`${name} could not be looked at as on a phone`);
      else if (page.scrollWidth > page.clientWidth)
        faults.push(`${name} is ${page.scrollWidth} pixels wide on a phone of ${page.clientWidth}`);
    }
  };
  await Promise.all(Array.from({ length: 4 }, look));
  document.body.replaceChildren(Object.assign(document.createElement('pre'), { textContent: ['looked', ...faults.sort()].join('\\n') }));
})();
</script>
"""


def hidden_faults(site):
    """One for each page that keeps something from its reader, as lists do that a script is to unfold."""
    for path in sorted(site.glob("*.html")):
        if re.search(r'style="[^"]*display: *none', path.read_text(encoding="utf-8")):
            yield f"{path.name} hides a part of itself"


def phone_faults(site):
    """One for each page that a phone would have to scroll sideways; those of lessons are looked at by tests/course."""
    browser = chromium()
    if browser is None:
        return []
    names = sorted(path.name for path in site.glob("*.html") if not path.stem.endswith(("_source", "-members")))
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        phone = pathlib.Path(folder) / "phone.html"
        phone.write_text(PHONE.replace("NAMES", json.dumps(names)).replace("SITE", json.dumps(site.as_uri() + "/")), encoding="utf-8")
        seen = subprocess.run(
            [browser, *HEADLESS, "--allow-file-access-from-files", f"--virtual-time-budget={1000 * len(names)}",
             f"--user-data-dir={folder}/profile", "--dump-dom", phone.as_uri()],
            capture_output=True, text=True, timeout=600).stdout
    found = re.search(r"<pre>looked\n?(.*?)</pre>", seen, flags=re.DOTALL)
    if not found:
        return ["no page could be looked at as on a phone"]
    return html.unescape(found.group(1)).splitlines()


def picture(report, figure, size, target):
    width, height = size.split("x")
    if not screenshot(chromium(), pathlib.Path(report), f"?theme=light&figure={figure}", pathlib.Path(target).resolve(), width, height):
        sys.exit(f"docs: no picture of {report}")


def main():
    if len(sys.argv) == 6 and sys.argv[1] == "picture":
        return picture(*sys.argv[2:])
    if sys.argv[1:] == ["links"]:
        faults = [*readme_faults()]
        print("".join(f"docs: {fault}\n" for fault in faults), end="", file=sys.stderr)
        sys.exit(1 if faults else 0)
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    site, course = pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2]).resolve()
    shutil.rmtree(site, ignore_errors=True)
    site.mkdir(parents=True)
    # The browser is most of the time. It runs beside Doxygen and beside the look at links; two browsers at once took longer than in turn.
    with concurrent.futures.ThreadPoolExecutor(1) as browsing:
        pictures = lesson_pages(site, course, browsing)
        faults = run_doxygen(site)
        tidied(site)
        figures(site)
        gallery(site, course, pictures is not None)
        find_page(site)
        source_pages(site)
        mended(site)
        on_a_phone = browsing.submit(phone_faults, site)
        if pictures is not None and not pictures.result():
            faults.append("there is no picture of the lessons")
        faults += [*readme_faults(), *hidden_faults(site), *link_faults(site), *on_a_phone.result()]
    for fault in faults:
        print(f"docs: {fault}", file=sys.stderr)
    sys.exit(1 if faults else 0)


if __name__ == "__main__":
    main()
