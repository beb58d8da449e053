// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// What every report page promises: nothing on the console, nothing from a network, nothing that axe-core
/// finds in light or dark, a button at every figure that saves it as a PNG file, and on a phone nothing wider
/// than its screen, at a desk no table cut off. CAIRN_AXE says where npm has put axe-core.
#pragma once

#include <filesystem>
#include <string>

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

/// Looks at the page that it stands in, then at the same page in a frame as wide as a phone and in dark, and
/// leaves the answers as attributes of the document: data-desk, data-phone. "well" is the answer where there
/// is nothing to object to.
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
    addEventListener('message', ({ data }) => { document.documentElement.dataset.phone = data; });
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

/// The value of an attribute of the document.
inline std::string attribute(const OpenedPage& opened, const std::string& name) {
  const std::size_t at = opened.document.find(" " + name + "=\"");
  if (at == std::string::npos) return "no answer";
  const std::size_t first = at + name.size() + 3;
  return opened.document.substr(first, opened.document.find('"', first) - first);
}

}  // namespace detail

/// Opens a copy of the page, with `more` at its end, and holds it against what every page promises.
inline OpenedPage check_page(const std::filesystem::path& page, const std::string& more = "") {
  CAPTURE(page.string());
  const Folder folder;
  const std::filesystem::path axe = CAIRN_AXE;
  std::string judge;
  if (std::filesystem::exists(axe))
    judge = "<script>" + cairn::read_file(axe) + "</script>";
  else
    MESSAGE("skipped: no axe-core (npm)");
  cairn::write_file_atomically(folder / "page.html",
                               cairn::read_file(page) + judge + detail::examiner + more);
  OpenedPage opened = open_page(folder, folder / "page.html", 120000);
  CHECK(opened.console == "");
  CHECK(opened.has("data-panels=\""));
  CHECK(detail::attribute(opened, "data-desk") == "well");
  CHECK(detail::attribute(opened, "data-phone") == "well");
  return opened;
}

}  // namespace cairn_test
