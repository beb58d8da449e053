// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What every report page promises: nothing on the console, nothing from a network, nothing that axe-core
/// finds in light or dark, a button at every figure that saves it as a PNG file, and on a phone nothing wider
/// than its screen, at a desk no table cut off. CAIRN_AXE says where npm has put axe-core.
#pragma once

#include <cstddef>
#include <filesystem>
#include <sstream>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include <cairn/io/file.hpp>

#include "support/browser.hpp"
#include "support/folder.hpp"
#include "support/report.hpp"

namespace cairn_test {

/// Whether pages are built and can be opened; says why not.
inline bool can_open_pages() {
  if (!example::has_report_page())
    MESSAGE("skipped: built without the page (npm)");
  else if (!has_chromium())
    MESSAGE("skipped: no chromium");
  else
    return true;
  return false;
}

namespace detail {

/// Looks at the page that it stands in, then at the same page in a frame as wide as a phone and in dark,
/// leaves the answers as attributes of the document, data-desk and data-phone, and gives the document to the
/// page around it (visit). "well" is the answer where there is nothing to object to. Waits for the promise
/// `more`, where the page has one.
constexpr const char* examiner = R"(<script>
(() => {
  const phone = new URLSearchParams(location.search).has('phone');
  const wait = (time) => new Promise((done) => setTimeout(done, time));
  const short = (node) => node.outerHTML.slice(0, 90);

  /** What ends to the right of the screen although nothing around it scrolls. */
  function tooWide() {
    const root = document.documentElement;
    if (root.scrollWidth <= root.clientWidth) return [];
    const out = [...document.body.querySelectorAll('*')].filter((node) =>
      node.getBoundingClientRect().right > root.clientWidth + 1 && !node.closest('.scroll'));
    return [`${root.scrollWidth} px wide of ${root.clientWidth}: ${out.slice(0, 3).map(short).join(' ')}`];
  }

  /** Tables that have to be pushed aside to be read although the page has more room than they were given. */
  function cutTables() {
    return [...document.querySelectorAll('.panel:not(.wide) .scroll')]
      .filter((node) => !phone && node.scrollWidth > node.clientWidth + 1)
      .map((node) => `${node.ariaLabel}: ${node.scrollWidth} px of table in ${node.clientWidth}`);
  }

  /** The width and the height that the first bytes of a PNG file say; zeros where it is none. */
  function sizeOfPng(bytes) {
    const signature = [0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a];
    if (!signature.every((byte, i) => bytes.getUint8(i) === byte)) return [0, 0];
    return [bytes.getUint32(16), bytes.getUint32(20)];
  }

  /** Figures without a button, or whose button saves no PNG file that is at least as large as what is shown. */
  async function unsaved() {
    const wrong = [];
    const click = HTMLAnchorElement.prototype.click;
    for (const panel of document.querySelectorAll('.panel')) {
      const shown = panel.querySelector('canvas, .picture img');
      if (!shown) continue;
      const button = panel.querySelector('button.save');
      if (!button) { wrong.push(`no button at ${panel.id}`); continue; }
      const link = await new Promise((done) => {
        HTMLAnchorElement.prototype.click = function () { done(this); };
        button.click();
        setTimeout(() => done(null), 20000);
      });
      if (!link || !link.download.endsWith('.png')) { wrong.push(`nothing saved at ${panel.id}`); continue; }
      const [width, height] = sizeOfPng(new DataView(await (await fetch(link.href)).arrayBuffer()));
      if (width < shown.clientWidth || height < shown.clientHeight / 2)
        wrong.push(`${panel.id} saved as ${width} x ${height}, shown as ${shown.clientWidth} x ${shown.clientHeight}`);
    }
    HTMLAnchorElement.prototype.click = click;
    return wrong;
  }

  const fetched = () => performance.getEntriesByType('resource').map((entry) => entry.name)
    .filter((name) => !/^(data|blob|file):/.test(name));

  async function violations() {
    if (!globalThis.axe) return [];
    const { violations } = await axe.run(document, {});
    return violations.map((one) => `${one.id}: ${one.nodes[0].html.slice(0, 120)}`);
  }

  async function look() {
    await wait(1500);
    const found = [...tooWide(), ...cutTables(), ...(await unsaved()), ...(await violations()), ...fetched()];
    const answer = found.length > 0 ? found.join('; ') : 'well';
    if (phone) return parent.postMessage(answer, '*');
    document.documentElement.dataset.desk = answer;
    addEventListener('message', async ({ data }) => {
      document.documentElement.dataset.phone = data;
      await globalThis.more;
      parent.postMessage(document.documentElement.outerHTML, '*');
    });
    const frame = document.createElement('iframe');
    frame.width = 390;
    frame.height = 844;
    frame.style.cssText = 'position: fixed; left: 0; top: 0'; // what is out of sight is not drawn
    frame.src = `${location.href.split('?')[0]}?phone&theme=dark`;
    document.body.append(frame);
  }
  look();
})();
</script>)";

/// Shows page0.html, page1.html, ... of its folder, one after the other, each as large as the window, and
/// keeps the document that each becomes.
constexpr const char* visit = R"(<!doctype html><meta charset="utf-8">
<style>body { margin: 0 } iframe { border: 0; width: 100vw; height: 100vh }</style>
<script>
addEventListener('load', async () => {
  for (let i = 0; i < pages; ++i) {
    const frame = document.createElement('iframe');
    frame.src = `page${i}.html`;
    const answer = new Promise((done) => addEventListener('message', ({ data }) => done(data), { once: true }));
    document.body.append(frame);
    const text = await answer;
    frame.remove();
    const kept = document.createElement('pre');
    kept.hidden = true;
    kept.textContent = text;
    document.body.append(kept);
  }
});
</script>)";

/// The next text that visit() has kept, from `at` on, which moves behind it; empty where there is none.
inline std::string next_document(const std::string& visited, std::size_t& at) {
  static const std::string begin = "<pre hidden=\"\">";
  const std::size_t first = visited.find(begin, at);
  if (first == std::string::npos) return {};
  const std::size_t end = visited.find("</pre>", first);
  at = end;
  std::string text = visited.substr(first + begin.size(), end - first - begin.size());
  const auto replace = [&](const std::string& from, const std::string& to) {
    std::string whole;
    std::size_t last = 0;
    for (std::size_t found; (found = text.find(from, last)) != std::string::npos; last = found + from.size())
      whole.append(text, last, found - last) += to;
    text = whole.append(text, last);
  };
  replace("&lt;", "<");
  replace("&gt;", ">");
  replace("&nbsp;", "\u00a0");
  replace("&amp;", "&");
  return text;
}

/// The value of an attribute of the document.
inline std::string attribute(const OpenedPage& opened, const std::string& name) {
  const std::size_t at = opened.document.find(" " + name + "=\"");
  if (at == std::string::npos) return "no answer";
  const std::size_t first = at + name.size() + 3;
  return opened.document.substr(first, opened.document.find('"', first) - first);
}

}  // namespace detail

/// Opens copies of the pages, each with `more` at its end, in one visit of the browser, whose beginning takes
/// it longer than a page, and holds each against what every page promises.
inline std::vector<OpenedPage> check_pages(const std::vector<std::filesystem::path>& pages,
                                           const std::string& more = "") {
  const Folder folder;
  const std::filesystem::path axe = CAIRN_AXE;
  std::string judge;
  if (std::filesystem::exists(axe))
    judge = "<script>" + cairn::read_file(axe) + "</script>";
  else
    MESSAGE("skipped: no axe-core (npm)");
  const auto name = [](std::size_t i) { return "page" + std::to_string(i) + ".html"; };
  for (std::size_t i = 0; i < pages.size(); ++i)
    cairn::write_file_atomically(folder / name(i),
                                 cairn::read_file(pages[i]) + more + judge + detail::examiner);
  cairn::write_file_atomically(
      folder / "visit.html",
      "<script>const pages = " + std::to_string(pages.size()) + ";</script>" + detail::visit);
  const int patience = 120000 * static_cast<int>(pages.size());
  const OpenedPage visited = open_page(folder, folder / "visit.html", patience);
  std::vector<OpenedPage> opened(pages.size());
  std::size_t at = 0;
  for (std::size_t i = 0; i < pages.size(); ++i) {
    CAPTURE(pages[i].string());
    opened[i].document = detail::next_document(visited.document, at);
    std::istringstream console(visited.console);
    for (std::string line; std::getline(console, line);)
      if (line.find(name(i)) != std::string::npos) opened[i].console += line + "\n";
    CHECK(opened[i].console == "");
    CHECK(opened[i].has("data-panels=\""));
    CHECK(detail::attribute(opened[i], "data-desk") == "well");
    CHECK(detail::attribute(opened[i], "data-phone") == "well");
  }
  CHECK(visited.console == "");
  return opened;
}

inline OpenedPage check_page(const std::filesystem::path& page, const std::string& more = "") {
  return check_pages({page}, more).front();
}

}  // namespace cairn_test
